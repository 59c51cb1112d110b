"""Tracking command by singular values, and linear dependence of rows.

For QP solvers and for formulas in Python.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..qp.decomposition import svd
from ..rows import UNKNOWN, Array, BoolArray, Command, Rows, Task
from ..rows.tolerances import ZERO_GRADIENT

#: Least coefficient of a row in a combination of rows that vanishes, for the row to be named.
PART = 1e-3
RANK_TOLERANCE = 1e-6  #: Singular values below this fraction of the largest one count as zero.


class LeastNorm(NamedTuple):
    """Solution q̈ = q̈₀ + J† (b − J q̈₀) (n,), with the decomposition of J.

    ``directions`` (n, n) are the right singular vectors of J, one a column: an orthonormal basis of
    the joint space. ``gains`` (n,) are their singular values, with exact zeros for the directions
    that count as the null space of J.
    """

    qdd: Array
    directions: Array
    gains: Array


def least_norm(J: Array, b: Array, rank_tolerance: float, rest: Array = UNKNOWN) -> LeastNorm:
    """Return the q̈ with the least ‖q̈ − q̈₀‖ among those with the least ‖J q̈ − b‖.

    ``rest`` is q̈₀ (n,), or (0,) for zero. Directions whose singular value is below
    ``rank_tolerance`` times the largest count as null space, and only q̈₀ moves them: without it
    ‖q̈‖ ≤ ‖b‖ / (rank_tolerance · ‖J‖) in every configuration. J may be zero, or have no rows.
    """
    if len(rest):
        step = least_norm(J, b - J @ rest, rank_tolerance)
        return step._replace(qdd=rest + step.qdd)
    k, n = J.shape
    gains = np.zeros(n)
    if k == 0:
        return LeastNorm(np.zeros(n), np.eye(n), gains)
    U, s, Vt = svd(J, full_matrices=k < n)
    is_used = s > rank_tolerance * s[0]
    rank = int(np.count_nonzero(is_used))
    used = s[:rank]
    gains[:rank] = used
    along_directions = (U[:, :rank].T @ b) / used
    qdd: Array = Vt[:rank].T @ along_directions
    return LeastNorm(qdd, Vt.T, gains)


def track(task: Task, rank_tolerance: float) -> Array:
    """Return the q̈ (n,) of :func:`least_norm`."""
    return least_norm(task.J, task.b, rank_tolerance, task.rest).qdd


def unit_rows(rows: Rows, demand: Array, which: BoolArray) -> tuple[Array, Array]:
    """Return L_gφ (b, n) and demands (b,) of some rows, divided by ‖L_gφ‖.

    Linear dependence of these rows does not depend on units. A row that no acceleration influences
    (``ZERO_GRADIENT``) becomes zero.
    """
    A = rows.Lg[which]
    # the squares of very large and very small numbers would leave the range of floating point
    size = np.abs(A).max(axis=1)
    direction = np.divide(A, size[:, None], out=np.zeros_like(A), where=size[:, None] > 0.0)
    squared = np.einsum("ij,ij->i", direction, direction)
    length = np.sqrt(squared)
    influenced = size * length > ZERO_GRADIENT * rows.scale[which]
    direction[~influenced] = 0.0
    length[~influenced] = 1.0
    size[~influenced] = 1.0
    unit = direction / length[:, None]
    scaled_demand = demand[which] / size / length * influenced
    return unit, scaled_demand


def dependent_rows(A: Array, rank_tolerance: float) -> Array:
    """Return the combinations (b, b − rank) of the rows of A (b, n) that vanish."""
    if not len(A):
        return np.empty((0, 0))
    U, s, _ = svd(A)
    rank = int((s > rank_tolerance * s[0]).sum())
    return U[:, rank:]


def rank_loss(rows: Rows, command: Command, rank_tolerance: float) -> Command:
    """Return the command with the status ``rank-loss``.

    Its reason names the rows with φ ≥ 0 that depend on each other.
    """
    reached = command.acted & (rows.phi >= 0.0)
    gradients, _ = unit_rows(rows, rows.phi, reached)
    dependent = dependent_rows(gradients, rank_tolerance)
    takes_part = np.abs(dependent).max(axis=1, initial=0.0) > PART
    involved = np.flatnonzero(reached)[takes_part]
    names = ", ".join(rows.labels[i] for i in involved)
    return replace(
        command,
        status="rank-loss",
        reason=f"the active rows have lost full row rank; dependent: {names}",
    )
