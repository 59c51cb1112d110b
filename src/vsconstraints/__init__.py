"""Constrained visual servoing: controllers on the same rows, compared."""

from typing import TYPE_CHECKING, Any

from .camera import Camera
from .kinematics import RobotPoint
from .robot import Robot

if TYPE_CHECKING:
    from .notebooks import compare, run

__version__ = "0.1.0"

__all__ = ["Camera", "Robot", "RobotPoint", "__version__", "compare", "run"]


def __getattr__(name: str) -> Any:
    """What needs much more than a controller does is imported when it is asked for."""
    if name in ("compare", "run"):
        from . import notebooks

        return getattr(notebooks, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
