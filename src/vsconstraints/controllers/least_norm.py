"""The tracking command by singular values, for QP solvers and formulas in Python; and dependence of
rows.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..qp.decomposition import svd
from ..rows import UNKNOWN, Array, BoolArray, Command, Rows, Task
from ..rows.tolerances import ZERO_GRADIENT

RANK_TOLERANCE = 1e-6  #: Singular values below this fraction of the largest one count as zero.


class LeastNorm(NamedTuple):
    """Q̈ = q̈₀ + J† (b − J q̈₀) (n,), and the decomposition it was read from.

    ``directions`` (n, n) are the right singular vectors of J, one a column: an orthonormal basis of
    the joint space; ``gains`` (n,) their singular values, with exact zeros for the directions that
    count as the null space of J.
    """

    qdd: Array
    directions: Array
    gains: Array


def least_norm(J: Array, b: Array, rank_tolerance: float, rest: Array = UNKNOWN) -> LeastNorm:
    """Of all q̈ with the least ‖J q̈ − b‖, the one with the least ‖q̈ − q̈₀‖; ``rest`` is q̈₀ (n,),
    or (0,) for zero.

    Directions whose singular value is below ``rank_tolerance`` times the largest count as null
    space, and only q̈₀ moves them: without it ‖q̈‖ ≤ ‖b‖ / (rank_tolerance · ‖J‖) in every
    configuration. J may be zero, or have no rows.
    """
    if len(rest):
        step = least_norm(J, b - J @ rest, rank_tolerance)
        return step._replace(qdd=rest + step.qdd)
    k, n = J.shape
    gains = np.zeros(n)
    if k == 0:
        return LeastNorm(np.zeros(n), np.eye(n), gains)
    U, s, Vt = svd(J, full_matrices=k < n)
    rank = int(np.count_nonzero(s > rank_tolerance * s[0]))
    gains[:rank] = s[:rank]
    qdd: Array = Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank])
    return LeastNorm(qdd, Vt.T, gains)


def track(task: Task, rank_tolerance: float) -> Array:
    """q̈ (n,) of :func:`least_norm`."""
    return least_norm(task.J, task.b, rank_tolerance, task.rest).qdd


def unit_rows(rows: Rows, demand: Array, which: BoolArray) -> tuple[Array, Array]:
    """L_gφ (b, n) and demands (b,) of some rows, divided by ‖L_gφ‖: dependence must not depend on
    units.

    A row that no acceleration influences (``ZERO_GRADIENT``) becomes zero.
    """
    A = rows.Lg[which]
    # the squares of very large and very small numbers would leave the range
    size = np.abs(A).max(axis=1)
    direction = np.divide(A, size[:, None], out=np.zeros_like(A), where=size[:, None] > 0.0)
    length = np.sqrt(np.einsum("ij,ij->i", direction, direction))
    seen = size * length > ZERO_GRADIENT * rows.scale[which]
    direction[~seen] = 0.0
    length[~seen] = size[~seen] = 1.0
    return direction / length[:, None], demand[which] / size / length * seen


def dependent_rows(A: Array, rank_tolerance: float) -> Array:
    """(b, b − rank) combinations of the rows of A (b, n) that vanish."""
    if not len(A):
        return np.empty((0, 0))
    U, s, _ = svd(A)
    return U[:, int((s > rank_tolerance * s[0]).sum()) :]


def rank_loss(rows: Rows, command: Command, rank_tolerance: float) -> Command:
    """The command with the status ``rank-loss``, and the reason: which of the rows with φ ≥ 0
    depend on each other.
    """
    reached = command.acted & (rows.phi >= 0.0)
    dependent = dependent_rows(unit_rows(rows, rows.phi, reached)[0], rank_tolerance)
    involved = np.flatnonzero(reached)[np.abs(dependent).max(axis=1, initial=0.0) > 1e-3]
    names = ", ".join(rows.labels[i] for i in involved)
    return replace(
        command,
        status="rank-loss",
        reason=f"the active rows have lost full row rank; dependent: {names}",
    )
