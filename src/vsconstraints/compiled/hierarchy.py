"""The resolver ``hierarchy``, compiled: demands, task and least acceleration with strict priorities.

A pair with :mod:`vsconstraints.controllers.cascade`: ``test_the_two_descents_agree`` compares them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..rows import Array, BoolArray, IntArray
from ..rows.tolerances import DEPENDENT, MET, PULLING, ZERO_GRADIENT
from .compiler import in_place, inner
from .least_distance import KINDS, MULTIPLIER, SIDE, nearest
from .least_residual import cut, least_residual
from .least_squares import CERTAIN, pseudoinverse
from .least_violation import GREATEST, LEAST, least_violation
from .levels import (
    CENTER,
    ORIGIN,
    ROWS_OF_X,
    damped,
    find_freedom,
    join,
    meets,
    metric,
    optimal,
    place,
    settle,
    start_from,
    with_room,
)
from .linear import ONE, S_ROWS, START, constant, copy, copy_vector, dot, length
from .scratch import blank, matrix, vector
from .workspace import FAILED, RELAXED_ROWS, RELAXED_SHORT, SHORT, SOLVED, Scratch

HARD, RELAXING, STRICT_TASK = constant(0), constant(1), constant(2)
"""Stages: all rows; the points that violate least; level 2 by itself."""


class Demands(NamedTuple):
    """What rows ask of the acceleration, A q̈ ≤ c with A (m, n) and c (m,), ∞ for a row that asks for nothing.

    ``scale`` (m,) is the positive ‖Aᵢ‖ that counts as usual: a row far below it is one that no acceleration influences.
    ``weights`` (m,) are those of level 1, positive.
    """

    A: Array
    c: Array
    scale: Array
    weights: Array


class Priorities(NamedTuple):
    """Options of the levels.

    ``box`` (2, n) has the least and greatest q̈, level 0; ``damping`` weighs level 3 within the QP, relative to ‖J‖²;
    singular values of J below the ``tolerance`` times the largest one count as zero; ``strict`` tells to find level 2
    by itself where the damping has cost it something.
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
    """Rows N x ≤ sides (w,) of which the first f are demands that accelerations influence; those of the box follow.

    ``limits`` (w,) are sides that a point is known to meet, ∞ for rows that are settled; ``held`` (w,) the rows that
    hold the answer; ``rows`` (4, w) as :func:`nearest` takes them. Of the demands, ``weights`` of level 1, ``which``
    each is, and ``violation``, by what it is exceeded where that cannot be helped, are (f,).
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


@in_place
def count_resisting(demands: Demands, box: Array, X: Array, fixed: BoolArray, resolved: Resolved) -> int:
    """How many demands accelerations influence; −1 if tracking, which is written to q̈, meets them all, and the box.

    Marks those that ask for something in ``acted`` and those that nothing influences in ``fixed`` (m,).
    """
    A, c, scale, _ = demands
    qdd, slack, acted = resolved
    n, free = qdd.size, 0
    below = within = tracks = True
    for j in range(n):
        qdd[j] = X[ORIGIN, j] = X[CENTER, j]
        within = within and box[LEAST, j] <= qdd[j] <= box[GREATEST, j]
    far = length(X, CENTER, n)
    for i in range(c.size):
        acted[i] = c[i] != math.inf
        slack[i] = 0.0
        if acted[i]:
            size, excess = length(A, i, n), dot(A, i, X, CENTER, START, n) - c[i]
            fixed[i] = size <= ZERO_GRADIENT * scale[i]
            below = below and excess <= 0.0
            tracks = tracks and excess < math.inf
            tracks = tracks and (c[i] >= 0.0 if fixed[i] else excess <= MET * (size * far + abs(c[i])))
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
    slack, acted, n, w, at = resolved.slack, resolved.acted, box.shape[1], free, START
    for j in range(n):
        w += box[GREATEST, j] < math.inf
        w += box[LEAST, j] > -math.inf
    normals, sides, W, which = blank(scratch, w, n), vector(scratch, w), vector(scratch, free), np.empty(free, np.int64)
    violation, rows = vector(scratch, free), matrix(scratch, KINDS, w)
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
    copy_vector(limits, sides)
    return Walls(normals, sides, limits, held, rows, W, which, violation)


@in_place
def restate(walls: Walls, Z: Array, X: Array, H: Array) -> bool:
    """State the rows in y of x = origin + Z y: H (p, w), and their sides; False if there is none that is a number."""
    p, n, free = H.shape[0], X.shape[1], walls.violation.size
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


@in_place
def hold(walls: Walls) -> None:
    """Mark the rows that pull on the answer."""
    strongest = 0.0
    for i in range(walls.held.size):
        strongest = max(strongest, walls.rows[MULTIPLIER, i])
    for i in range(walls.held.size):
        walls.held[i] = walls.held[i] or walls.rows[MULTIPLIER, i] > PULLING * strongest


@inner
def solve_stage(
    walls: Walls, G: Array, Z: Array, p: int, priorities: Priorities, X: Array, point: Array, scratch: Scratch
) -> tuple[int, int]:
    """Find the point of origin + Z y of levels 2 and 3 within the rows, and mark those that hold it.

    ``SOLVED``; another code where the point fails the check; −1 if a side is no number. And the rows that were added.
    """
    w = walls.sides.size
    H, R, T = matrix(scratch, p, w), matrix(scratch, p + 1, p), matrix(scratch, S_ROWS, p)
    if not restate(walls, Z, X, H):
        return -1, 0
    metric(G, priorities.damping, Z, X, R, T, scratch)
    code, steps = nearest(H, walls.rows, R, T, X, scratch)
    if code == SOLVED:
        place(Z, p, priorities.box, X, point)
        good = meets(walls.normals, walls.sides, walls.violation, point)
        if good and optimal(G, priorities.damping, Z, walls.normals, walls.limits, walls.rows, X, point):
            hold(walls)
            return SOLVED, steps
    return FAILED, steps


@in_place
def report(walls: Walls, resolved: Resolved) -> bool:
    """Write slack and the rows that act; whether any demand is unmet."""
    qdd, slack, acted = resolved
    violation, unmet = walls.violation, False
    for i in range(violation.size):
        if violation[i] > 0.0:
            excess = -walls.sides[i]
            for j in range(qdd.size):
                excess += walls.normals[i, j] * qdd[j]
            violation[i] = max(0.0, excess)
        slack[walls.which[i]] = violation[i]
        acted[walls.which[i]] = violation[i] > 0.0 or walls.held[i]
    for i in range(slack.size):
        unmet = unmet or slack[i] > 0.0
    return unmet


@inner
def descend_levels(
    walls: Walls, G: Array, X: Array, redundant: bool, priorities: Priorities, qdd: Array, scratch: Scratch
) -> tuple[int, bool, int]:
    """Go down the levels from rows that resist: the code, whether levels 2 and 3 may be better met, the iterations.

    x = origin + Z y, in all directions first; if that is in vain in those which the least violations leave; and in
    those which level 2 leaves, where the damping has cost it something or no answer has passed the check.
    """
    box, damping, tolerance, strict = priorities
    n, steps, stage, point = qdd.size, 0, HARD, matrix(scratch, ONE, qdd.size)
    Z, p = matrix(scratch, START, n), n
    equal: Array = Z
    E = equal
    while True:
        if stage == RELAXING:
            f = walls.violation.size
            code = least_violation(walls.normals[:f], walls.sides[:f], walls.weights, box, qdd)
            if code != SOLVED:
                return code, False, steps
        if stage != HARD:
            for j in range(n):
                point[0, j] = qdd[j]
        if stage == RELAXING:
            start_from(X, point, box, qdd)
            equal = settle(walls.normals, walls.sides, walls.weights, box, X, walls.limits, walls.violation)
            E = equal.copy()
        elif stage == STRICT_TASK:
            with_room(walls.normals, walls.limits, point)
            cutoff = cut(G, n, damping, tolerance)
            proved = least_residual(G, X, E, walls.normals, walls.limits, point, walls.held, cutoff)
            start_from(X, point, box, qdd)
            if not proved:
                return SOLVED, True, steps
            equal = join(E, walls.normals, walls.held, G)
        if stage != HARD:
            Z, p = find_freedom(equal, X, stage == RELAXING, scratch)
            if p == 0:
                return SOLVED, False, steps if stage == STRICT_TASK else 0
        code, more = solve_stage(walls, G, Z, p, priorities, X, point, scratch)
        if code < 0:
            return FAILED, False, 0
        steps = steps + more if stage == STRICT_TASK else more
        if code == SOLVED:
            for j in range(n):
                qdd[j] = point[0, j]
        if stage == STRICT_TASK:
            return SOLVED, code != SOLVED, steps
        if code == SOLVED and not (strict and redundant and damped(G, X, point)):
            return SOLVED, False, steps
        stage = STRICT_TASK if code == SOLVED or stage == RELAXING else RELAXING


@inner
def hierarchy(
    demands: Demands, J: Array, b: Array, rest: Array, priorities: Priorities, resolved: Resolved, scratch: Scratch
) -> tuple[int, int]:
    """Of q̈ in the box those that violate the demands least, of these those of least ‖J q̈ − b‖, then of least ‖q̈ − q̈₀‖.

    The least ‖W max(0, A q̈ − c)‖; see :class:`vsconstraints.controllers.HierarchicalQP` for how strict level 2 is.
    J (k, n) and b (k,) are the task's, ``rest`` is q̈₀ (n,), or (0,) for zero. Shapes, signs and finite numbers are for
    the caller to check before; and after, that ``resolved`` is finite.

    Returns ``SOLVED``; ``RELAXED_ROWS``, where demands are unmet; ``SHORT``, where levels 2 and 3 may be better met;
    ``RELAXED_SHORT``, both; or ``FAILED``. And the iterations of the active-set method, at least 1 if it was needed.
    """
    n, box = resolved.qdd.size, priorities.box
    G, X = matrix(scratch, J.shape[0], n + 1), blank(scratch, ROWS_OF_X, n)
    redundant = find_center(J, b, rest, priorities.tolerance, G, X, scratch) < n
    fixed = np.zeros(demands.c.size, np.bool_)
    free = count_resisting(demands, box, X, fixed, resolved)
    if free < 0:
        return SOLVED, 0
    walls = gather_walls(demands, box, fixed, free, resolved, scratch)
    code, short, steps = descend_levels(walls, G, X, redundant, priorities, resolved.qdd, scratch)
    if code != SOLVED:
        return code, steps
    unmet = report(walls, resolved)
    if short:
        return (RELAXED_SHORT if unmet else SHORT), steps
    return (RELAXED_ROWS if unmet else SOLVED), steps
