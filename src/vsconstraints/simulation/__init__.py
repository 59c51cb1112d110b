"""Simulation: setup, closed loop and resulting trajectory."""

from .prepared import RunWorkspace
from .runs import PATIENCE, score_run, simulate, until_settled
from .setup import Setup, Tolerances
from .trajectory import RunScores, Trajectory, intervals

__all__ = [
    "PATIENCE",
    "RunScores",
    "RunWorkspace",
    "Setup",
    "Tolerances",
    "Trajectory",
    "intervals",
    "score_run",
    "simulate",
    "until_settled",
]
