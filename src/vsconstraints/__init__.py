"""Constrained visual servoing: comparison of controllers on the same constraint rows."""

from typing import TYPE_CHECKING

from .plugins.earlier_names import install
from .plugins.lazy import exported

if TYPE_CHECKING:
    from .robots.kinematics import RobotPoint
    from .robots.robot import Robot
    from .view.notebooks import compare, run
    from .vision.camera import Camera

__version__ = "0.1.0"

__all__ = ["Camera", "Robot", "RobotPoint", "__version__", "compare", "run"]

_MODULES = {
    "Camera": "vision.camera",
    "Robot": "robots.robot",
    "RobotPoint": "robots.kinematics",
    "compare": "view.notebooks",
    "run": "view.notebooks",
}
# importing Pinocchio alone takes longer than the whole of ``--help``
__getattr__, __dir__ = exported(__name__, _MODULES)
install()
