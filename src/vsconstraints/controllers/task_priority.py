"""Task priority for laws of users: eq. (15)."""

from __future__ import annotations

import numpy as np

from ..rows import Array, BoolArray, Command, Rows, Task
from .least_norm import dependent_rows, unit_rows
from .resolvers import Priority

__all__ = ["dependent_rows", "prioritise", "unit_rows"]


def prioritise(rows: Rows, task: Task, acts: BoolArray, demand: Array, rank_tolerance: float) -> Command:
    """The command in which the acting rows have the first level and the task the second.

    Parameters
    ----------
    rows, task
        What the controller was given.
    acts
        (m,) rows that act.
    demand
        (m,) what L_gφ q̈ of those rows must be.
    rank_tolerance
        As of :class:`.Priority`.

    Returns
    -------
    Command
        ``rank-loss`` if rows with φ ≥ 0 depend on each other (section 5.2), with the names of those that do. Rows
        that act before their boundary is reached are then met in the least-squares sense.
    """
    return Priority(rank_tolerance).prioritise(rows, task, np.where(acts, demand, np.inf))
