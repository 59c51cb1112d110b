"""The task alone: of all q̈ that track best the nearest to q̈₀, the command of every law whose rows do not act.

Ranks are decided by singular values, which LAPACK gives; compiled code proves full rank by reflections where it can,
which is faster: :mod:`vsconstraints.compiled.least_squares`. ``test_every_law_answers_alike_in_both_forms`` in
``tests/test_laws.py`` holds the pair together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..qp.decomposition import svd
from ..rows import UNKNOWN, Array, Task

RANK_TOLERANCE = 1e-6
"""Singular values below this fraction of the largest one count as zero."""


class LeastNorm(NamedTuple):
    """The least-squares solution of J q̈ = b that is nearest to q̈₀, and the decomposition it was read from.

    Attributes
    ----------
    qdd
        (n,) q̈ = q̈₀ + J† (b − J q̈₀).
    directions
        (n, n) right singular vectors of J, one a column: an orthonormal basis of the joint space.
    gains
        (n,) their singular values, with exact zeros for the directions that count as the null space of J.
    """

    qdd: Array
    directions: Array
    gains: Array


def least_norm(J: Array, b: Array, rank_tolerance: float, rest: Array = UNKNOWN) -> LeastNorm:
    """Of all q̈ with the least ‖J q̈ − b‖, the one with the least ‖q̈ − q̈₀‖; ``rest`` is q̈₀ (n,), or (0,) for zero.

    Directions whose singular value is below ``rank_tolerance`` times the largest count as null space, and only q̈₀
    moves them: without it ‖q̈‖ ≤ ‖b‖ / (rank_tolerance · ‖J‖) in every configuration. J may be zero, or have no rows.
    """
    if len(rest):
        way = least_norm(J, b - J @ rest, rank_tolerance)
        return way._replace(qdd=rest + way.qdd)
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
