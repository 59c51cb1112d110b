"""Scores of a run. The definitions are part of the product: reports print :data:`DEFINITIONS`."""

from .measured import NEGLIGIBLE, SLIDING_GAP, TOLERANCES, TOLERANT, Measured, Metric
from .table import (
    CONSTRAINT_COLUMNS,
    DEFINITIONS,
    METRICS,
    RESULT_COLUMNS,
    ROW_METRICS,
    RUN,
    TIMING_COLUMNS,
    Score,
    score,
)

__all__ = [
    "CONSTRAINT_COLUMNS",
    "DEFINITIONS",
    "METRICS",
    "NEGLIGIBLE",
    "RESULT_COLUMNS",
    "ROW_METRICS",
    "RUN",
    "SLIDING_GAP",
    "TIMING_COLUMNS",
    "TOLERANCES",
    "TOLERANT",
    "Measured",
    "Metric",
    "Score",
    "score",
]
