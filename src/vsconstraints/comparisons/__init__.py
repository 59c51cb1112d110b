"""Comparisons: suites, the runner, scores and stored results."""

from typing import TYPE_CHECKING

from ..plugins.earlier_names import earlier_constants
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

if not TYPE_CHECKING:  # type checkers would then accept any name
    __getattr__ = earlier_constants(__name__, {"DEFINITIONS": definitions})
