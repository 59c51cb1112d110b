"""Arms with mass: rigid-body dynamics under the usual joint controllers, and their eq. (6)."""

from .equivalent import Equivalent
from .plant import DynamicPlant
from .settings import PLANTS, ArmDynamics, Friction, MujocoDynamics, Payload, Rods

__all__ = [
    "PLANTS",
    "ArmDynamics",
    "DynamicPlant",
    "Equivalent",
    "Friction",
    "MujocoDynamics",
    "Payload",
    "Rods",
]
