"""Constrained visual servoing: comparison of controllers on the same constraint rows."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .robots.kinematics import RobotPoint
    from .robots.robot import Robot
    from .view.notebooks import compare, run
    from .vision.camera import Camera

__version__ = "0.1.0"

__all__ = ["Camera", "Robot", "RobotPoint", "__version__", "compare", "run"]

_PLACES = {
    "Camera": "vision.camera",
    "Robot": "robots.robot",
    "RobotPoint": "robots.kinematics",
    "compare": "view.notebooks",
    "run": "view.notebooks",
}


def __getattr__(name: str) -> Any:
    """Import an exported object at its first use.

    Importing Pinocchio alone takes longer than the whole of ``--help``.
    """
    if name in _PLACES:
        return getattr(import_module(f".{_PLACES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *_PLACES]
