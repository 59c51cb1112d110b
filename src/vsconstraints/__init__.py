"""Constrained visual servoing: controllers on the same rows, compared."""

from .camera import Camera
from .kinematics import RobotPoint
from .robot import Robot

__version__ = "0.1.0"

__all__ = ["Camera", "Robot", "RobotPoint", "__version__"]
