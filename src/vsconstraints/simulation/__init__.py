"""Simulation: a setup, the closed loop, and the trajectory it leaves."""

from .loop import score_run, simulate
from .patience import PATIENCE, until_settled
from .prepared import Prepared
from .scores import RunScores
from .setup import Setup, Tolerances
from .trajectory import Trajectory, intervals

__all__ = [
    "PATIENCE",
    "Prepared",
    "RunScores",
    "Setup",
    "Tolerances",
    "Trajectory",
    "intervals",
    "score_run",
    "simulate",
    "until_settled",
]
