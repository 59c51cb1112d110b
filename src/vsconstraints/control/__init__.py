"""Control step: rows and task from time, coordinates and speeds, and the command for them."""

from .control_step import ControlStep, Model, Prediction

__all__ = ["ControlStep", "Model", "Prediction"]
