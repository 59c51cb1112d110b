"""Task priority (eq. 15) for custom laws."""

from __future__ import annotations

import numpy as np

from ..rows import Array, BoolArray, Command, Rows, Task
from .least_norm import dependent_rows, unit_rows
from .resolver import Priority

__all__ = ["dependent_rows", "prioritise", "unit_rows"]


def prioritise(
    rows: Rows, task: Task, acts: BoolArray, demand: Array, rank_tolerance: float
) -> Command:
    """Compute the command in which active rows (m,) meet L_gφ q̈ = demand (m,) before the task.

    The status is ``rank-loss``, and the reason names the rows, if rows with φ ≥ 0 depend on each
    other (section 5.2). Rows that act before their boundary is reached are then met in the
    least-squares sense. The tolerance is that of :class:`.Priority`.
    """
    return Priority(rank_tolerance).solve(rows, task, np.where(acts, demand, np.inf), None)
