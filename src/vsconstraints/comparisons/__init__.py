"""Comparisons: suites, the runner, scores and stored results."""

from .metrics import definitions, score
from .record import RunRecord
from .runner import Finished, compare
from .runs.spec import ControllerSpec, RunSpec
from .stored import StoredComparison, keep_trajectories
from .suite import Suite

__all__ = [
    "ControllerSpec",
    "Finished",
    "RunRecord",
    "RunSpec",
    "StoredComparison",
    "Suite",
    "compare",
    "definitions",
    "keep_trajectories",
    "score",
]
