"""Which rows act, and whether they have lost rank: seen from what is commanded, not from what a law says of it."""

from __future__ import annotations

import numpy as np

from ..controllers.least_norm import RANK_TOLERANCE
from ..controllers.task_priority import dependent_rows, unit_rows
from ..rows import Array, BoolArray, Rows

NOTICED = 1e-3
"""From which share of u⁺ on a row counts as slowed: less is what solvers' tolerances make."""


def acting(phi: Array, slowed: Array, gain: Array, scale: Array) -> BoolArray:
    """(N, m) rows that act: that hold the arm back.

    Their φ is slowed: the command makes it rise by less than tracking alone would, from the same state. What slows one
    row slows others as well. Of the slowed rows, those with φ ≥ 0 act; where there is none, the one nearest to that.

    Parameters
    ----------
    phi
        (N, m) φ.
    slowed
        (N, m) L_gφ (q̈_tracking − q̈_c) [units of φ per second].
    gain
        (m,) switching gain u⁺ [units of φ per second].
    scale
        (m,) size of the allowed range in units of φ.
    """
    acts: BoolArray = slowed > NOTICED * gain
    if acts.size:
        nearness = np.where(acts, np.minimum(phi, 0.0) / scale, -np.inf)
        acts &= nearness >= nearness.max(axis=1, keepdims=True)
    return acts


def loses_rank(rows: Rows) -> bool:
    """Whether L_gφ of the rows with φ ≥ 0 has lost full row rank (section 5.2), whatever the rows' units."""
    reached = rows.phi >= 0.0
    return bool(dependent_rows(unit_rows(rows, rows.phi, reached)[0], RANK_TOLERANCE).shape[1])
