"""Simulation: a setup, the closed loop, and the trajectory it leaves."""

from .loop import simulate
from .setup import Setup, Tolerances
from .trajectory import Trajectory, intervals

__all__ = ["Setup", "Tolerances", "Trajectory", "intervals", "simulate"]
