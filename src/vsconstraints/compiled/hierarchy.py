"""The resolver ``hierarchy``, compiled: demands, task and least acceleration with strict priorities.

:mod:`vsconstraints.controllers.cascade` goes the same way with QPs solved by solvers with names: the test
``test_the_two_descents_agree`` in ``tests/test_kernels.py`` compares the two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..rows import Array, BoolArray
from ..rows.tolerances import DEPENDENT, MET, PULLING, ZERO_GRADIENT
from .compiler import inner
from .least_distance import KINDS, MULTIPLIER, POINT, SIDE, nearest
from .least_residual import cut, least_residual
from .least_squares import CERTAIN, pseudoinverse
from .least_violation import GREATEST, LEAST, least_violation
from .levels import CENTER, OFFSET, ORIGIN, ROWS_OF_X, damped, join, meets, metric, optimal, settle, with_room
from .linear import ONE, S_ROWS, START, apply, constant, copy, dot
from .scratch import blank, matrix, vector
from .structures import FAILED, RELAXED_ROWS, RELAXED_SHORT, SHORT, SOLVED, Scratch

HARD, RELAXING, STRICT_TASK = constant(0), constant(1), constant(2)
"""Stages: all rows; the points that violate least; level 2 by itself."""


class Demands(NamedTuple):
    """What rows ask of the acceleration, A q̈ ≤ c.

    Attributes
    ----------
    A, c
        (m, n) and (m,) in units of φ per second; c = ∞ for a row that asks for nothing.
    scale
        (m,) ‖Aᵢ‖ that counts as usual, positive: a row far below it is one that no acceleration influences.
    weights
        (m,) of level 1, positive.
    """

    A: Array
    c: Array
    scale: Array
    weights: Array


class Priorities(NamedTuple):
    """Options of the levels.

    Attributes
    ----------
    box
        (2, n) least and greatest q̈, the box of level 0; infinite where there is no bound.
    damping
        Weight of level 3 within the QP, relative to ‖J‖².
    tolerance
        Singular values of J below this fraction of the largest one count as zero.
    strict
        Whether level 2 is found by itself where the damping has cost it something.
    """

    box: Array
    damping: float
    tolerance: float
    strict: bool


class Resolved(NamedTuple):
    """Outputs: q̈ (n,), what each demand is exceeded by (m,), and which rows act (m,)."""

    qdd: Array
    slack: Array
    acted: BoolArray


@inner
def hierarchy(
    demands: Demands, J: Array, b: Array, rest: Array, priorities: Priorities, resolved: Resolved, scratch: Scratch
) -> tuple[int, int]:
    """Of q̈ in the box those that violate the demands least, of these those of least ‖J q̈ − b‖, then of least ‖q̈ − q̈₀‖.

    The least ‖W max(0, A q̈ − c)‖; see :class:`vsconstraints.controllers.HierarchicalQP` for how strict level 2 is.
    Shapes, signs and finite numbers are for the caller to check before; and after, that ``resolved`` is finite.

    Parameters
    ----------
    demands
        m of them.
    J, b
        (k, n) and (k,) of the task.
    rest
        q̈₀ (n,), or (0,) for zero.
    priorities
        Box, damping and rank tolerance.
    resolved
        Outputs.
    scratch
        For use here.

    Returns
    -------
    tuple
        ``SOLVED``; ``RELAXED_ROWS``, where demands are unmet; ``SHORT``, where levels 2 and 3 may be better met;
        ``RELAXED_SHORT``, both; or ``FAILED``. And the iterations of the active-set method, at least 1 if it was
        needed.
    """
    A, c, scale, weights = demands
    box, damping, tolerance, strict = priorities
    qdd, slack, acted = resolved
    m = c.size
    n, k = qdd.size, J.shape[0]
    G, X = matrix(scratch, k, n + 1), blank(scratch, ROWS_OF_X, n)
    for i in range(k):
        copy(G, i, J, i, n)
        G[i, n] = b[i]
        for j in range(rest.size):
            G[i, n] -= J[i, j] * rest[j]
    _, _, rank, _ = pseudoinverse(G, START, CERTAIN * tolerance, tolerance, G, X, CENTER, scratch)
    for j in range(rest.size):
        X[CENTER, j] += rest[j]
    redundant = rank < n
    fixed = np.zeros(m, np.bool_)
    below = within = tracks = True
    for j in range(n):
        qdd[j] = X[ORIGIN, j] = X[CENTER, j]
        within = within and box[LEAST, j] <= qdd[j] <= box[GREATEST, j]
    length = math.sqrt(dot(X, CENTER, X, CENTER, START, n))
    free = 0
    for i in range(m):
        acted[i] = c[i] != math.inf
        slack[i] = 0.0
        if acted[i]:
            size = math.sqrt(dot(A, i, A, i, START, n))
            excess = dot(A, i, X, CENTER, START, n) - c[i]
            fixed[i] = size <= ZERO_GRADIENT * scale[i]
            below = below and excess <= 0.0
            tracks = tracks and excess < math.inf
            tracks = tracks and (c[i] >= 0.0 if fixed[i] else excess <= MET * (size * length + abs(c[i])))
            free += not fixed[i]
    if within and (below or tracks):
        for i in range(m):
            acted[i] = False
        return SOLVED, 0

    w = free
    for j in range(n):
        w += int(box[GREATEST, j] < math.inf) + int(box[LEAST, j] > -math.inf)
    walls, sides, W, index = blank(scratch, w, n), vector(scratch, w), vector(scratch, free), np.empty(free, np.int64)
    violation, rows = vector(scratch, free), matrix(scratch, KINDS, w)
    at = START
    unmet = False
    for i in range(m):
        if acted[i]:
            acted[i] = False
            if fixed[i]:
                slack[i] = max(0.0, -c[i])
                unmet = unmet or slack[i] > 0.0
            else:
                sides[at], W[at], index[at], violation[at] = c[i], weights[i], i, 0.0
                copy(walls, at, A, i, n)
                at += 1
    for end, sign in ((GREATEST, 1.0), (LEAST, -1.0)):
        for j in range(n):
            if sign * box[end, j] < math.inf:
                walls[at, j], sides[at] = sign, sign * box[end, j]
                at += 1

    # x = origin + Z y, in all directions first; if that is in vain in those which the least violations leave; and in
    # those which level 2 leaves, where the damping has cost it something or no answer has passed the check
    Z, p, steps, stage = matrix(scratch, START, n), n, 0, HARD
    equal: Array = Z
    E = equal
    limits, held, point = vector(scratch, w), np.zeros(w, np.bool_), matrix(scratch, ONE, n)
    for i in range(w):
        limits[i] = sides[i]
    short = False
    while True:
        if stage == RELAXING:
            code = least_violation(walls[:free], sides[:free], W, box, qdd)
            if code != SOLVED:
                return code, steps
            for j in range(n):
                X[ORIGIN, j] = qdd[j]
                X[OFFSET, j] = qdd[j] - X[CENTER, j]
            equal = settle(walls, sides, W, box, X, limits, violation)
            E = equal.copy()
        elif stage == STRICT_TASK:
            for j in range(n):
                point[0, j] = qdd[j]
            with_room(walls, limits, point)
            proved = least_residual(G, X, E, walls, limits, point, held, cut(G, n, damping, tolerance))
            for j in range(n):
                X[ORIGIN, j] = qdd[j] = min(max(point[0, j], box[LEAST, j]), box[GREATEST, j])
                X[OFFSET, j] = qdd[j] - X[CENTER, j]
            short = not proved
            if short:
                break
            equal = join(E, walls, held, G)
        if stage != HARD:
            Z, p = matrix(scratch, START, n), n
            if equal.shape[0] > 0:
                F, T, rank, _ = pseudoinverse(equal, START, CERTAIN * DEPENDENT, DEPENDENT, equal, X, POINT, scratch)
                p = n - rank
                if p == 0:
                    steps = steps if stage == STRICT_TASK else 0
                    break
                Z = blank(scratch, p, n)
                for d in range(p):
                    Z[d, rank + d] = 1.0
                    apply(F, T, rank, Z, d)
            elif stage == RELAXING:
                for j in range(n):
                    X[ORIGIN, j], X[OFFSET, j] = X[CENTER, j], 0.0
        H, R, T = matrix(scratch, p, w), matrix(scratch, p + 1, p), matrix(scratch, S_ROWS, p)
        for i in range(w):
            outside = 0.0
            for d in range(p):
                H[d, i] = walls[i, d] if p == n else dot(walls, i, Z, d, START, n)
                outside += H[d, i] * H[d, i]
            if p < n:
                # rows within the span of the violated ones are settled
                settled = outside <= DEPENDENT * DEPENDENT * dot(walls, i, walls, i, START, n)
                if settled or (i < free and violation[i] > 0.0):
                    limits[i] = math.inf
            rows[SIDE, i] = limits[i] - dot(walls, i, X, ORIGIN, START, n)
            if not rows[SIDE, i] > -math.inf:
                return FAILED, 0
        metric(G, damping, Z, X, R, T, scratch)
        code, more = nearest(H, rows, R, T, X, scratch)
        steps = steps + more if stage == STRICT_TASK else more
        if code == SOLVED:
            for j in range(n):
                point[0, j] = X[POINT, j] if p == n else 0.0
                for d in range(p if p < n else START):
                    point[0, j] += X[POINT, d] * Z[d, j]
                point[0, j] = min(max(X[ORIGIN, j] + point[0, j], box[LEAST, j]), box[GREATEST, j])
        good = code == SOLVED and meets(walls, sides, violation, point)
        good = good and optimal(G, damping, Z, walls, limits, rows, X, point)
        if good:
            for j in range(n):
                qdd[j] = point[0, j]
            strongest = 0.0
            for i in range(w):
                strongest = max(strongest, rows[MULTIPLIER, i])
            for i in range(w):
                held[i] = held[i] or rows[MULTIPLIER, i] > PULLING * strongest
        if stage == STRICT_TASK:
            short = not good
            break
        if good and not (strict and redundant and damped(G, X, point)):
            break
        stage = STRICT_TASK if good or stage == RELAXING else RELAXING
    for i in range(free):
        at = index[i]
        if violation[i] > 0.0:
            excess = -sides[i]
            for j in range(n):
                excess += walls[i, j] * qdd[j]
            violation[i] = max(0.0, excess)
        slack[at] = violation[i]
        unmet = unmet or violation[i] > 0.0
        acted[at] = violation[i] > 0.0 or held[i]
    if short:
        return (RELAXED_SHORT if unmet else SHORT), steps
    return (RELAXED_ROWS if unmet else SOLVED), steps
