"""Arms with mass: rigid-body dynamics under the usual joint controllers, and their eq. (6)."""

from typing import TYPE_CHECKING

from ..plugins.lazy import exported

if TYPE_CHECKING:
    from .equivalent import Equivalent
    from .plant import DynamicPlant
    from .settings import ArmDynamics, Friction, MujocoDynamics, Payload, Rods

__all__ = [
    "ArmDynamics",
    "DynamicPlant",
    "Equivalent",
    "Friction",
    "MujocoDynamics",
    "Payload",
    "Rods",
]
__getattr__, __dir__ = exported(
    __name__,
    {
        "Equivalent": "equivalent",
        "DynamicPlant": "plant",
        "ArmDynamics": "settings",
        "Friction": "settings",
        "MujocoDynamics": "settings",
        "Payload": "settings",
        "Rods": "settings",
    },
)
