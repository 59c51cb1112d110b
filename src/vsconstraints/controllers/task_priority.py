"""Task priority for laws of users: eq. (15)."""

from __future__ import annotations

import numpy as np

from ..rows import Array, BoolArray, Command, Rows, Task
from .least_norm import dependent_rows, unit_rows
from .resolver import Priority

__all__ = ["dependent_rows", "prioritise", "unit_rows"]


def prioritise(
    rows: Rows, task: Task, acts: BoolArray, demand: Array, rank_tolerance: float
) -> Command:
    """The command in which the rows that act (m,) meet L_gφ q̈ = demand (m,) first, and the task
    comes second.

    ``rank-loss`` if rows with φ ≥ 0 depend on each other (section 5.2), with the names of those
    that do. Rows that act before their boundary is reached are then met in the least-squares sense.
    The tolerance is that of :class:`.Priority`.
    """
    return Priority(rank_tolerance).solve(rows, task, np.where(acts, demand, np.inf), None)
