"""Level 2 of the hierarchy by itself: the least residual of the task among points that rows allow.

Compiled in :mod:`vsconstraints.compiled.least_residual`; see :mod:`vsconstraints.qp.lexicographic`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..rows import Array, BoolArray
from .decomposition import norm, svd

REACHED = 1e-12
"""A step that changes the residual by less than this fraction of its terms is none."""

PUSHING = 1e-9
"""A row holds the task back if its multiplier exceeds this fraction of the terms of the gradient."""


class LeastResidual(NamedTuple):
    """What :func:`least_residual` found.

    Attributes
    ----------
    x
        (n,) a point that meets every row, at least as good as the start.
    holding
        (w,) rows at their bound that hold the task back: all points with the least residual have them there.
    proved
        Whether no point has a smaller residual; if not, the iterations were used up.
    """

    x: Array
    holding: BoolArray
    proved: bool


def least_residual(
    G: Array, target: Array, equal: Array, walls: Array, sides: Array, x: Array, active: BoolArray, tolerance: float
) -> LeastResidual:
    """Minimise ‖G x − target‖ subject to walls x ≤ sides, with ``equal`` x staying as it is.

    A primal active-set method. It starts at a point that meets every row, and never leaves these points. On the rows
    that are active it takes the step of eq. (15): the task's step of least norm within their null space. The first row
    in the way becomes active, and where no step is left the one that pulls most the wrong way is let go.

    Parameters
    ----------
    G, target
        (k, n) and (k,): the task; ‖G‖ is of the order of 1.
    equal
        (e, n).
    walls, sides
        (w, n), none of them zero, and (w,).
    x
        (n,) where to start.
    active
        (w,) rows at their bound there that are active at first.
    tolerance
        Singular values of G within the null space of the active rows below this fraction of ‖G‖ count as zero: the
        task does not ask for directions that the rows nearly take from it.
    """
    norms = np.sqrt(np.einsum("ij,ij->i", walls, walls))
    A, e = walls / norms[:, None], len(equal)
    rows, limits = [int(i) for i in np.flatnonzero(active)], sides / norms
    cut = tolerance * norm(G)
    for _ in range(2 * (len(walls) + x.size)):
        held = np.vstack((equal, A[rows]))
        Q, R = np.linalg.qr(held.T, mode="complete")
        Z = Q[:, len(held) :]
        rest = target - G @ x
        U, s, Vt = svd(G @ Z, full_matrices=False)
        kept = s > cut
        step = Z @ (Vt[kept].T @ ((U[:, kept].T @ rest) / s[kept]))
        size = REACHED * (float(np.linalg.norm(target)) + float(np.linalg.norm(x)))
        if np.linalg.norm(G @ step) <= size:
            pull = G.T @ rest
            force = np.linalg.lstsq(R[: len(held)], Q[:, : len(held)].T @ pull, rcond=REACHED)[0][e:]
            noise = PUSHING * float(np.linalg.norm(pull))
            if not rows or force.min() >= -noise - size:
                holding = np.zeros(len(walls), dtype=np.bool_)
                holding[[row for row, f in zip(rows, force, strict=True) if f > noise + size]] = True
                return LeastResidual(x, holding, True)
            rows.pop(int(np.argmin(force)))
            continue
        change, room = A @ step, np.maximum(limits - A @ x, 0.0)
        change[rows] = 0.0
        length, blocking = 1.0, -1
        ahead = change > REACHED * float(np.linalg.norm(step))
        if ahead.any():
            lengths = np.where(ahead, room / np.where(ahead, change, 1.0), np.inf)
            if lengths.min() < 1.0:
                blocking = int(np.argmin(lengths))
                length = float(lengths[blocking])
        x = x + length * step
        if blocking >= 0:
            rows.append(blocking)
    return LeastResidual(x, np.zeros(len(walls), dtype=np.bool_), False)
