"""Level 1 of the hierarchy: the points that violate rows least, found exactly.

Compiled in :mod:`vsconstraints.compiled.least_violation`; see :mod:`vsconstraints.qp.lexicographic`.
"""

from __future__ import annotations

import numpy as np

from ..errors import SolverError
from ..rows import Array

ROUNDING = 1e-13
"""Below this fraction of its terms a row counts as met while iterating."""

CONVERGED = 1e-12
"""A step that would change no violation by more than this fraction of their norm, or by more than rounding, is none."""

RANK = 1e-14
"""Singular values below this fraction of the largest count as zero in a step."""

LOST = 1e-7
"""Fraction of the largest term below which a violation may be lost where rows differ most."""


def least_violation(A: Array, c: Array, weights: Array, start: Array, box: Array | None = None) -> Array:
    """Find a minimiser of ½‖max(0, W(Ax − c))‖² in a box, W = diag(weights).

    The function is convex and piecewise quadratic: Newton's method on the rows that are violated, with an
    exact line search, ends after finitely many steps with an exact minimiser. Coordinates that the box holds
    are kept in a working set and released when the gradient pulls them inward. The minimiser need not be
    unique, but its violations are.

    Beside large rows small ones are lost in rounding. The result exceeds the least value of ‖max(0, W(Ax − c))‖ by at
    most a fraction of 1e-9 of it and a part of the largest wᵢ(‖Aᵢ‖‖x‖ + |cᵢ|): :data:`LOST` where the norms of weighted
    rows are up to 1e10 apart, some of them nearly repeating others, and 1e-3 of that where they are up to 1e6 apart.
    Tests hold both forms to this, by rational arithmetic.

    Parameters
    ----------
    A, c
        (m, n) and (m,).
    weights
        (m,) positive.
    start
        (n,) where to begin; clipped to the box.
    box
        (2, n) least and greatest x, the first nowhere above the second; None for no bounds.

    Returns
    -------
    Array
        (n,) the minimiser reached from ``start``.

    Raises
    ------
    SolverError
        if weighted rows are not finite; or if the limit of iterations is reached, which only rounding could bring
        about.
    """
    B = weights[:, None] * A
    d = weights * c
    if not (np.isfinite(B).all() and np.isfinite(d).all()):
        raise SolverError("weighted rows are beyond the range of floating point")
    row_norms = np.sqrt(np.einsum("ij,ij->i", B, B))
    lower, upper = (-np.inf, np.inf) if box is None else box
    x = np.clip(start, lower, upper)
    # at which end the box holds a coordinate: −1, 1, or 0 if at none
    held, reached = np.zeros(x.size), np.zeros(c.size, dtype=np.bool_)
    last = released_at = np.inf
    fruitless = 0
    for _ in range(20 + 10 * (x.size + c.size)):
        residual = B @ x - d
        rounding = ROUNDING * (row_norms * np.sqrt(x @ x) + np.abs(d))
        if (residual <= rounding).all():
            return x
        # Rows exceeded by rounding alone count here: a row of large scale holds small ones by just that much.
        violated = residual > 0.0
        excess = residual[violated]
        touching = residual >= -rounding
        reached &= touching
        pulled, free = violated | reached, held == 0.0
        step = np.zeros(x.size)
        step[free] = np.linalg.lstsq(B[pulled][:, free], -residual[pulled], rcond=RANK)[0]
        change = B @ step
        # A row of large scale that is just met ends a step before it begins, unless it takes part.
        blocking = touching & ~pulled & (change > rounding)
        if blocking.any():
            reached |= blocking
            continue
        value = float(excess @ excess)
        still = CONVERGED * np.sqrt(value) + rounding[violated]
        if (np.abs(change[violated]) <= still).all() or value >= last:
            # Stationary on this face of the box. Which held coordinate is pulled inward the most?
            pull = np.where((held != 0.0) & (lower < upper), held * (excess @ B[violated]), 0.0)
            worst = int(np.argmax(pull))
            # In a corner several releases may be needed before there is descent; more than n are a cycle of rounding.
            fruitless = fruitless + 1 if value >= released_at else 0
            if pull[worst] <= np.abs(B[violated, worst]) @ still or fruitless > x.size:
                return x
            released_at = value
            held[worst] = 0.0
            last = np.inf
            continue
        longest = np.full(x.size, np.inf)
        np.divide(np.where(step > 0.0, upper - x, x - lower), np.abs(step), out=longest, where=step != 0.0)
        limit = max(0.0, float(longest.min()))
        length = _exact_line_search(residual, change, limit)
        x = x + length * step
        # A step of exact line search descends, unless rounding is all that is left or the box has cut it short.
        last = value
        if length >= limit:
            last = np.inf
            blocked = longest <= limit
            held[blocked] = np.sign(step[blocked])
            x[blocked] = np.where(step > 0.0, upper, lower)[blocked]
    raise SolverError("the least violation of the rows was not found within the limit of iterations")


def _exact_line_search(residual: Array, change: Array, limit: float) -> float:
    """Length t in [0, limit] that minimises ½‖max(0, residual + t·change)‖².

    The derivative is continuous, nondecreasing and piecewise linear in t, with kinks where a row is just met. It is
    evaluated afresh at every kink: sums that are updated from kink to kink end in differences that are pure rounding.
    """
    moving = change != 0.0
    r, s = residual[moving], change[moving]
    kinks = -r / s
    kinks = np.sort(kinks[(kinks > 0.0) & (kinks < limit)])
    derivatives = np.maximum(r + kinks[:, None] * s, 0.0) @ s
    right = int(np.searchsorted(derivatives >= 0.0, True))
    lower = float(kinks[right - 1]) if right > 0 else 0.0
    upper = float(kinks[right]) if right < kinks.size else limit
    middle = 0.5 * (lower + upper) if np.isfinite(upper) else lower + 1.0
    active = r + middle * s > 0.0
    curvature = float(s[active] @ s[active])
    if curvature == 0.0:
        return lower
    return min(max(-float(r[active] @ s[active]) / curvature, lower), upper)
