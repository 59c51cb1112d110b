"""The control step: from time, coordinates and speeds to rows and task, and on to a controller's
command.
"""

from .control_step import ControlStep, Model, Prediction

__all__ = ["ControlStep", "Model", "Prediction"]
