"""Scores of a run. The definitions are part of the product: reports print :data:`DEFINITIONS`."""

from .chattering import SLIDING_GAP
from .clearance import NEGLIGIBLE, tolerated
from .score import Score, score
from .table import CONSTRAINT_COLUMNS, DEFINITIONS, METRICS, RESULT_COLUMNS, TIMING_COLUMNS, Metric

__all__ = [
    "CONSTRAINT_COLUMNS",
    "DEFINITIONS",
    "METRICS",
    "NEGLIGIBLE",
    "RESULT_COLUMNS",
    "SLIDING_GAP",
    "TIMING_COLUMNS",
    "Metric",
    "Score",
    "score",
    "tolerated",
]
