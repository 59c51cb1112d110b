"""The resolver ``hierarchy``, compiled: demands, task and least acceleration with strict priorities.

:mod:`vsconstraints.controllers.cascade` goes the same way with QPs solved by solvers with names: the test
``test_the_two_descents_agree`` in ``tests/test_kernels.py`` compares the two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..rows import Array, BoolArray, IntArray
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


class Walls(NamedTuple):
    """Rows N x ≤ sides of which the first f are demands that accelerations influence; those of the box follow.

    Attributes
    ----------
    normals, sides
        (w, n) and (w,).
    limits
        (w,) sides that a point is known to meet; ∞ for rows that are settled.
    held
        (w,) rows that hold the answer.
    rows
        (4, w) as :func:`nearest` takes them.
    weights, which, violation
        (f,) of level 1, which demand each is, and by what it is exceeded where that cannot be helped.
    """

    normals: Array
    sides: Array
    limits: Array
    held: BoolArray
    rows: Array
    weights: Array
    which: IntArray
    violation: Array


@inner
def find_center(J: Array, b: Array, rest: Array, tolerance: float, G: Array, X: Array, scratch: Scratch) -> int:
    """Write J†b of least distance to q̈₀ to X[CENTER] and the task without its null space to G; its rank."""
    n = X.shape[1]
    for i in range(J.shape[0]):
        copy(G, i, J, i, n)
        G[i, n] = b[i]
        for j in range(rest.size):
            G[i, n] -= J[i, j] * rest[j]
    _, _, rank, _ = pseudoinverse(G, START, CERTAIN * tolerance, tolerance, G, X, CENTER, scratch)
    for j in range(rest.size):
        X[CENTER, j] += rest[j]
    return rank


@inner
def count_resisting(demands: Demands, box: Array, X: Array, fixed: BoolArray, resolved: Resolved) -> int:
    """How many demands accelerations influence; −1 if tracking, which is written to q̈, meets them all, and the box.

    Marks those that ask for something in ``acted`` and those that nothing influences in ``fixed`` (m,).
    """
    A, c, scale, _ = demands
    qdd, slack, acted = resolved
    n = qdd.size
    below = within = tracks = True
    for j in range(n):
        qdd[j] = X[ORIGIN, j] = X[CENTER, j]
        within = within and box[LEAST, j] <= qdd[j] <= box[GREATEST, j]
    length = math.sqrt(dot(X, CENTER, X, CENTER, START, n))
    free = 0
    for i in range(c.size):
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
    if not (within and (below or tracks)):
        return free
    for i in range(c.size):
        acted[i] = False
    return -1


@inner
def gather_walls(
    demands: Demands, box: Array, fixed: BoolArray, free: int, resolved: Resolved, scratch: Scratch
) -> Walls:
    """Demands and the box as rows; what nothing influences is slack."""
    A, c, _, weights = demands
    slack, acted, n = resolved.slack, resolved.acted, box.shape[1]
    w = free
    for j in range(n):
        w += box[GREATEST, j] < math.inf
        w += box[LEAST, j] > -math.inf
    normals, sides, W, which = blank(scratch, w, n), vector(scratch, w), vector(scratch, free), np.empty(free, np.int64)
    violation, rows = vector(scratch, free), matrix(scratch, KINDS, w)
    at = START
    for i in range(c.size):
        if acted[i]:
            acted[i] = False
            if fixed[i]:
                slack[i] = max(0.0, -c[i])
            else:
                sides[at], W[at], which[at], violation[at] = c[i], weights[i], i, 0.0
                copy(normals, at, A, i, n)
                at += 1
    for end, sign in ((GREATEST, 1.0), (LEAST, -1.0)):
        for j in range(n):
            if sign * box[end, j] < math.inf:
                normals[at, j], sides[at] = sign, sign * box[end, j]
                at += 1
    limits, held = vector(scratch, w), np.zeros(w, np.bool_)
    for i in range(w):
        limits[i] = sides[i]
    return Walls(normals, sides, limits, held, rows, W, which, violation)


@inner
def start_from(X: Array, point: Array, row: int, box: Array, qdd: Array) -> None:
    """Make a row of points, brought into the box, the origin of what follows, and the answer if nothing does."""
    for j in range(qdd.size):
        X[ORIGIN, j] = qdd[j] = min(max(point[row, j], box[LEAST, j]), box[GREATEST, j])
        X[OFFSET, j] = qdd[j] - X[CENTER, j]


@inner
def find_freedom(equal: Array, X: Array, from_center: bool, scratch: Scratch) -> tuple[Array, int]:
    """An orthonormal basis (p, n) of what equalities [A | 0] leave, and p; none, and p = n, where there are none.

    Then the origin may be the center, which is taken if that is asked for.
    """
    n = X.shape[1]
    if equal.shape[0] == 0:
        if from_center:
            for j in range(n):
                X[ORIGIN, j], X[OFFSET, j] = X[CENTER, j], 0.0
        return matrix(scratch, START, n), n
    F, T, rank, _ = pseudoinverse(equal, START, CERTAIN * DEPENDENT, DEPENDENT, equal, X, POINT, scratch)
    p = n - rank
    Z = blank(scratch, p, n)
    for d in range(p):
        Z[d, rank + d] = 1.0
        apply(F, T, rank, Z, d)
    return Z, p


@inner
def restate(walls: Walls, Z: Array, X: Array, H: Array) -> bool:
    """State the rows in y of x = origin + Z y: H (p, w), and their sides; False if there is none that is a number."""
    p, n = H.shape[0], X.shape[1]
    free = walls.violation.size
    for i in range(walls.sides.size):
        outside = 0.0
        for d in range(p):
            H[d, i] = walls.normals[i, d] if p == n else dot(walls.normals, i, Z, d, START, n)
            outside += H[d, i] * H[d, i]
        if p < n:
            # rows within the span of the violated ones are settled
            settled = outside <= DEPENDENT * DEPENDENT * dot(walls.normals, i, walls.normals, i, START, n)
            if settled or (i < free and walls.violation[i] > 0.0):
                walls.limits[i] = math.inf
        walls.rows[SIDE, i] = walls.limits[i] - dot(walls.normals, i, X, ORIGIN, START, n)
        if not walls.rows[SIDE, i] > -math.inf:
            return False
    return True


@inner
def place(Z: Array, p: int, box: Array, X: Array, point: Array) -> None:
    """Write origin + Z y, with y of X[POINT], to the point, in the box."""
    n = X.shape[1]
    for j in range(n):
        point[0, j] = X[POINT, j] if p == n else 0.0
        for d in range(p if p < n else START):
            point[0, j] += X[POINT, d] * Z[d, j]
        point[0, j] = min(max(X[ORIGIN, j] + point[0, j], box[LEAST, j]), box[GREATEST, j])


@inner
def hold(walls: Walls) -> None:
    """Mark the rows that pull on the answer."""
    strongest = 0.0
    for i in range(walls.held.size):
        strongest = max(strongest, walls.rows[MULTIPLIER, i])
    for i in range(walls.held.size):
        walls.held[i] = walls.held[i] or walls.rows[MULTIPLIER, i] > PULLING * strongest


@inner
def report(walls: Walls, resolved: Resolved) -> bool:
    """Write slack and the rows that act; whether any demand is unmet."""
    qdd, slack, acted = resolved
    violation = walls.violation
    for i in range(violation.size):
        at = walls.which[i]
        if violation[i] > 0.0:
            excess = -walls.sides[i]
            for j in range(qdd.size):
                excess += walls.normals[i, j] * qdd[j]
            violation[i] = max(0.0, excess)
        slack[at] = violation[i]
        acted[at] = violation[i] > 0.0 or walls.held[i]
    unmet = False
    for i in range(slack.size):
        unmet = unmet or slack[i] > 0.0
    return unmet


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
    box, damping, tolerance, strict = priorities
    qdd = resolved.qdd
    n = qdd.size
    G, X = matrix(scratch, J.shape[0], n + 1), blank(scratch, ROWS_OF_X, n)
    redundant = find_center(J, b, rest, tolerance, G, X, scratch) < n
    fixed = np.zeros(demands.c.size, np.bool_)
    free = count_resisting(demands, box, X, fixed, resolved)
    if free < 0:
        return SOLVED, 0
    walls = gather_walls(demands, box, fixed, free, resolved, scratch)
    normals, sides, w = walls.normals, walls.sides, walls.sides.size
    # x = origin + Z y, in all directions first; if that is in vain in those which the least violations leave; and in
    # those which level 2 leaves, where the damping has cost it something or no answer has passed the check
    Z, p, steps, stage = matrix(scratch, START, n), n, 0, HARD
    equal: Array = Z
    E = equal
    point, short = matrix(scratch, ONE, n), False
    while True:
        if stage == RELAXING:
            code = least_violation(normals[:free], sides[:free], walls.weights, box, qdd)
            if code != SOLVED:
                return code, steps
            for j in range(n):
                point[0, j] = qdd[j]
            start_from(X, point, START, box, qdd)
            equal = settle(normals, sides, walls.weights, box, X, walls.limits, walls.violation)
            E = equal.copy()
        elif stage == STRICT_TASK:
            for j in range(n):
                point[0, j] = qdd[j]
            with_room(normals, walls.limits, point)
            cutoff = cut(G, n, damping, tolerance)
            short = not least_residual(G, X, E, normals, walls.limits, point, walls.held, cutoff)
            start_from(X, point, START, box, qdd)
            if short:
                break
            equal = join(E, normals, walls.held, G)
        if stage != HARD:
            Z, p = find_freedom(equal, X, stage == RELAXING, scratch)
            if p == 0:
                steps = steps if stage == STRICT_TASK else 0
                break
        H, R, T = matrix(scratch, p, w), matrix(scratch, p + 1, p), matrix(scratch, S_ROWS, p)
        if not restate(walls, Z, X, H):
            return FAILED, 0
        metric(G, damping, Z, X, R, T, scratch)
        code, more = nearest(H, walls.rows, R, T, X, scratch)
        steps = steps + more if stage == STRICT_TASK else more
        if code == SOLVED:
            place(Z, p, box, X, point)
        good = code == SOLVED and meets(normals, sides, walls.violation, point)
        good = good and optimal(G, damping, Z, normals, walls.limits, walls.rows, X, point)
        if good:
            for j in range(n):
                qdd[j] = point[0, j]
            hold(walls)
        if stage == STRICT_TASK:
            short = not good
            break
        if good and not (strict and redundant and damped(G, X, point)):
            break
        stage = STRICT_TASK if good or stage == RELAXING else RELAXING
    unmet = report(walls, resolved)
    if short:
        return (RELAXED_SHORT if unmet else SHORT), steps
    return (RELAXED_ROWS if unmet else SOLVED), steps
