"""The point of a polyhedron nearest to the origin, compiled: a dual active-set method.

Its steps serve :mod:`.plan_program` too, which has rows of its own.
"""

from __future__ import annotations

import math

from ..rows import Array, IntArray
from . import linear as la
from .compiler import in_place, inner
from .linear import S_ROWS, START, constant
from .scratch import integers, matrix
from .workspace import FAILED, INCOMPATIBLE, SOLVED, Scratch

EXCEEDED = 1e-12  #: A row exceeded by less than this fraction of its terms is met.
#: A row of unit norm whose part outside the span of the active ones is below this depends on them.
DEPENDENT = 1e-11
OPTIMAL = 1e-9  #: Largest error in the optimality conditions, relative to the size of the answer.
NONE = constant(-1)  #: No row; no point meets all of them.
STUCK = constant(-2)
#: Of every row of the problem: its side, by how much it is exceeded, its multiplier, and what made
#: it of unit norm; and how many of these there are.
SIDE = constant(0)
EXCESS = constant(1)
MULTIPLIER = constant(2)
SCALE = constant(3)
KINDS = constant(4)
#: Rows of the work space.
POINT = constant(0)
NEW = constant(1)
DIRECTION = constant(2)
FORCE = constant(3)
RATIO = constant(4)


@in_place
def normalise(G: Array, rows: Array, R: Array, S: Array) -> bool:
    """State the rows in u = R y + r, with unit norms; False if a side is no number then."""
    p, m = G.shape
    for i in range(m):
        rows[EXCESS, i] = 0.0 if rows[SIDE, i] < math.inf else math.inf
    for j in range(p):
        for i in range(j):
            la.add(G, j, -R[j, i], G, i, START, m)
        for i in range(m):
            G[j, i] *= S[0, j]
            rows[EXCESS, i] += G[j, i] * G[j, i]
        la.add(rows, SIDE, R[p, j], G, j, START, m)
    for i in range(m):
        rows[MULTIPLIER, i] = 0.0
        rows[SCALE, i] = rows[EXCESS, i] = 1.0 / math.sqrt(rows[EXCESS, i])
        if rows[EXCESS, i] > 0.0:
            rows[SIDE, i] *= rows[EXCESS, i]
            if not abs(rows[SIDE, i]) < math.inf:
                return False
    for j in range(p):
        for i in range(m):
            G[j, i] *= rows[EXCESS, i]
    return True


@in_place
def most_violated(G: Array, rows: Array, X: Array, size: float) -> int:
    """The row that the point exceeds most, by more than rounding; writes all excesses."""
    p, m = G.shape
    chosen = NONE
    worst = 0.0
    for i in range(m):
        rows[EXCESS, i] = -rows[SIDE, i]
    for j in range(p):
        la.add(rows, EXCESS, X[POINT, j], G, j, START, m)
    for i in range(m):
        excess = rows[EXCESS, i]
        if excess > worst and excess > EXCEEDED * (size + abs(rows[SIDE, i])):
            chosen = i
            worst = excess
    return chosen


@in_place
def drop(G: Array, F: Array, T: Array, X: Array, active: IntArray, leaving: int, q: int) -> None:
    """Let one of the active rows leave, of which q are left, and factor those behind it anew."""
    for j in range(leaving, q):
        active[j], X[FORCE, j] = active[j + 1], X[FORCE, j + 1]
        for i in range(F.shape[1]):
            F[j, i] = G[i, active[j]]
        la.apply_transposed(F, T, j, F, j)
        la.make_reflection(F, T, j)


@in_place
def longest_step(X: Array, q: int) -> tuple[int, float]:
    """Which active row's multiplier is the first to become zero on the way, if any does, and at
    what step.
    """
    leaving = NONE
    step = math.inf
    for j in range(q):
        if X[RATIO, j] > 0.0 and X[FORCE, j] < step * X[RATIO, j]:
            leaving = j
            step = X[FORCE, j] / X[RATIO, j]
    return leaving, step


@in_place
def advance(F: Array, T: Array, X: Array, turned: int, excess: float, q: int, p: int) -> int:
    """Move the point (p,) until a row that it exceeds is met, or the multiplier of an active one
    would turn negative.

    X[turned] is the row's normal in the basis of the QR of the q active ones. Returns which of
    these is to leave; ``NONE``; or ``STUCK`` if no point meets the row together with them.
    """
    la.copy(X, RATIO, X, turned, q)
    la.solve_upper(F, T, q, X, RATIO)
    outside = la.dot(X, turned, X, turned, q, p)
    leaving, step = longest_step(X, q)
    if math.sqrt(outside) > DEPENDENT:
        full = excess / outside
        if full <= step:
            leaving = NONE
            step = full
        la.copy(X, DIRECTION, X, turned, p)
        for j in range(q):
            X[DIRECTION, j] = 0.0
        la.apply(F, T, q, X, DIRECTION)
        la.add(X, POINT, -step, X, DIRECTION, START, p)
    if step == math.inf:
        return STUCK
    for j in range(q):
        X[FORCE, j] = max(0.0, X[FORCE, j] - step * X[RATIO, j])
    return leaving


@in_place
def reach(
    G: Array, rows: Array, F: Array, T: Array, X: Array, active: IntArray, chosen: int, q: int
) -> int:
    """Move the point until a row is met; rows whose multiplier would turn negative leave. Of q, how
    many are left.

    −1 if no point meets the row together with the active ones. X[NEW] becomes its normal in the
    basis of the QR.
    """
    p = G.shape[0]
    while True:
        excess = -rows[SIDE, chosen]
        for j in range(p):
            X[NEW, j] = G[j, chosen]
            excess += X[NEW, j] * X[POINT, j]
        la.apply_transposed(F, T, q, X, NEW)
        leaving = advance(F, T, X, NEW, excess, q, p)
        if leaving < 0:
            return q if leaving == NONE else -1
        q -= 1
        drop(G, F, T, X, active, leaving, q)


@in_place
def minimise(F: Array, T: Array, X: Array, q: int) -> None:
    """Compute point and multipliers anew, so that errors do not add up: X[POINT] has sides of q
    active rows, then 0.
    """
    la.solve_lower(F, T, q, X, POINT)
    la.copy(X, FORCE, X, POINT, q)
    la.solve_upper(F, T, q, X, FORCE)
    for j in range(q):
        X[FORCE, j] = -X[FORCE, j]
    la.apply(F, T, q, X, POINT)


@in_place
def clip_forces(X: Array, q: int) -> None:
    """Multipliers that rounding makes negative are zero."""
    for j in range(q):
        X[FORCE, j] = max(0.0, X[FORCE, j])


@in_place
def recompute(rows: Array, F: Array, T: Array, X: Array, active: IntArray, q: int) -> None:
    """Likewise, from the rows of the problem."""
    for j in range(F.shape[0]):
        X[POINT, j] = rows[SIDE, active[j]] if j < q else 0.0
    minimise(F, T, X, q)
    clip_forces(X, q)


@in_place
def proved(G: Array, rows: Array, X: Array, active: IntArray, q: int, size: float) -> bool:
    """Whether rows are met, multipliers only where a row is reached, and the point a sum of those
    rows.
    """
    p, m = G.shape
    met = size < math.inf
    for i in range(m):
        met = met and rows[EXCESS, i] <= OPTIMAL * (size + abs(rows[SIDE, i]))
    la.copy(X, NEW, X, POINT, p)
    for i in range(q):
        row = active[i]
        rows[MULTIPLIER, row] = X[FORCE, i]
        met = met and X[FORCE, i] * abs(rows[EXCESS, row]) <= OPTIMAL * size * size
        for j in range(p):
            X[NEW, j] += X[FORCE, i] * G[j, row]
    return met and la.length(X, NEW, p) <= OPTIMAL * size


@inner
def nearest(
    G: Array, rows: Array, R: Array, S: Array, X: Array, scratch: Scratch
) -> tuple[int, int]:
    """Minimise ½‖R y + r‖² subject to Gᵀ y ≤ h: the code, and how many rows were added.

    In u = R y + r, and with rows of unit norm, this is the point of Gᵀ u ≤ h nearest to the origin.
    The most violated row is added to the active ones; those whose multiplier would turn negative on
    the way leave. The active rows are kept as a QR factorization, and the point and the multipliers
    are computed from it anew after every addition. Each addition makes the point longer, so that no
    set of active rows returns; one that does not, by rounding, ends the search. (Goldfarb, Idnani,
    "A numerically stable dual method for solving strictly convex quadratic programs", Mathematical
    Programming, 1983.)

    ``G`` (p, m) has a column for each row of the problem, so that all are worked on at once, and is
    used up. ``rows`` (4, m) has h in SIDE, where ∞ is no row at all, and gets the multipliers of
    rows of unit norm and the inverses of the norms. ``R`` (p + 1, p) is upper triangular by
    columns, with r as the last one; ``S`` (3, p) has the inverses of its diagonal in the first row.
    The first p entries of the first row of ``X`` (5, p) or wider are the answer y.
    """
    p, m = G.shape
    F = matrix(scratch, p, p)
    T = matrix(scratch, S_ROWS, p)
    active = integers(scratch, p)
    if not normalise(G, rows, R, S):
        return FAILED, 0
    for j in range(p):
        X[POINT, j] = 0.0
    q = START
    steps = 0
    size = 0.0
    before = -1.0
    met = False
    for steps in range(10 * (m + p)):
        chosen = most_violated(G, rows, X, size)
        met = chosen < 0 or not size > before
        if met:
            break
        q = reach(G, rows, F, T, X, active, chosen, q)
        if q < 0:
            return INCOMPATIBLE, steps
        la.copy(F, q, X, NEW, p)
        la.make_reflection(F, T, q)
        active[q] = chosen
        q += 1
        recompute(rows, F, T, X, active, q)
        before = size
        size = la.length(X, POINT, p)
    met = proved(G, rows, X, active, q, size) and met
    la.add(X, POINT, -1.0, R, p, START, p)
    la.solve_upper(R, S, p, X, POINT)
    return (SOLVED if met else FAILED), steps
