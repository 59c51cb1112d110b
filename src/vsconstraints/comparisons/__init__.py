"""Comparisons: suites, the runner, scores, and what is stored."""

from .job import Entry, Job
from .metrics import DEFINITIONS, score
from .record import RunRecord
from .runner import Finished, compare
from .stored import StoredComparison
from .suite import Suite

__all__ = [
    "DEFINITIONS",
    "Entry",
    "Finished",
    "Job",
    "RunRecord",
    "StoredComparison",
    "Suite",
    "compare",
    "score",
]
