"""Point of a polyhedron nearest to the origin, compiled: a dual active-set method.

Its steps also serve :mod:`.plan_search`, which evaluates rows where the search needs them.
"""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array, IntArray
from . import linear as la
from .codes import FAILED, INCOMPATIBLE, SOLVED
from .compiler import in_place, inner
from .linear import INVERSE, QR, START, constant
from .scratch import empty_qr, integers
from .workspace import Scratch

EXCEEDED = 1e-12  #: A row exceeded by less than this fraction of its terms counts as met.
#: A row of unit norm depends on the active rows if its part outside their span is below this.
DEPENDENT = 1e-11
OPTIMAL = 1e-9  #: Largest error in the optimality conditions, relative to the size of the answer.
NONE = constant(-1)  #: Number of a row that does not exist.
STUCK = constant(-2)  #: Answer of :func:`advance` if no point meets the row.
NO_POINT = constant(-1)  #: Answer of :func:`reach` if no point meets the row.
#: Entries for every row of the problem: its side, its excess, its multiplier, and the factor that
#: makes it of unit norm; number of these entries.
SIDE = constant(0)
EXCESS = constant(1)
MULTIPLIER = constant(2)
SCALE = constant(3)
KINDS = constant(4)
#: Rows of the workspace ``X``.
POINT = constant(0)
NEW = constant(1)
DIRECTION = constant(2)
FORCE = constant(3)
RATIO = constant(4)


@in_place
def normalise(G: Array, rows: Array, metric: QR) -> bool:
    """Express the rows in u = R y + r, with unit norms. Return False if a side is not finite.

    Gᵀ y ≤ h is G'ᵀ u ≤ h + G'ᵀ r with RᵀG' = G. Absent rows count as infinitely long, so that their
    scale becomes zero.
    """
    p, m = G.shape
    R = metric.columns
    # first the squared norms stand in place of the scales
    for i in range(m):
        rows[SCALE, i] = 0.0 if rows[SIDE, i] < math.inf else math.inf
    for j in range(p):
        for i in range(j):
            la.add(G, j, -R[j, i], G, i, START, m)
        for i in range(m):
            entry = G[j, i] * metric.scalars[INVERSE, j]
            G[j, i] = entry
            rows[SCALE, i] += entry * entry
        la.add(rows, SIDE, R[p, j], G, j, START, m)
    for i in range(m):
        scale = 1.0 / np.sqrt(rows[SCALE, i])
        rows[MULTIPLIER, i] = 0.0
        rows[SCALE, i] = scale
        if scale > 0.0:
            side = scale * rows[SIDE, i]
            rows[SIDE, i] = side
            if not abs(side) < math.inf:
                return False
    for j in range(p):
        for i in range(m):
            G[j, i] *= rows[SCALE, i]
    return True


@in_place
def most_violated(G: Array, rows: Array, X: Array, size: float) -> int:
    """Return the row that the point violates most beyond rounding, and write all excesses."""
    p, m = G.shape
    chosen = NONE
    worst = 0.0
    for i in range(m):
        rows[EXCESS, i] = -rows[SIDE, i]
    for j in range(p):
        la.add(rows, EXCESS, X[POINT, j], G, j, START, m)
    for i in range(m):
        excess = rows[EXCESS, i]
        rounding = EXCEEDED * (size + abs(rows[SIDE, i]))
        if excess > worst and excess > rounding:
            chosen = i
            worst = excess
    return chosen


@in_place
def drop(G: Array, qr: QR, X: Array, active: IntArray, leaving: int, q: int) -> None:
    """Remove one active row, so that q are left, and refactor the rows behind it."""
    for j in range(leaving, q):
        active[j] = active[j + 1]
        X[FORCE, j] = X[FORCE, j + 1]
        for i in range(G.shape[0]):
            qr.columns[j, i] = G[i, active[j]]
        la.apply_transposed(qr, j, qr.columns, j)
        la.make_reflection(qr, j)


@in_place
def longest_step(X: Array, q: int) -> tuple[int, float]:
    """Return the active row whose multiplier becomes zero first along the step, and the step.

    Return ``NONE`` and infinity if no multiplier becomes zero.
    """
    leaving = NONE
    step = math.inf
    for j in range(q):
        force = X[FORCE, j]
        ratio = X[RATIO, j]
        if ratio > 0.0 and force < step * ratio:
            leaving = j
            step = force / ratio
    return leaving, step


@in_place
def advance(qr: QR, X: Array, turned: int, excess: float, q: int, p: int) -> int:
    """Move the point (p,) until a violated row is met or an active row's multiplier becomes zero.

    X[turned] is the violated row's normal in the basis of the QR of the q active rows. Return the
    active row that has to leave; ``NONE``; or ``STUCK`` if no point meets the row together with
    them.
    """
    la.copy(X, RATIO, X, turned, q)
    la.solve_upper(qr, q, X, RATIO)
    outside = la.squared_length(X, turned, q, p)
    leaving, step = longest_step(X, q)
    if np.sqrt(outside) > DEPENDENT:
        full = excess / outside
        if full <= step:
            leaving = NONE
            step = full
        la.copy(X, DIRECTION, X, turned, p)
        for j in range(q):
            X[DIRECTION, j] = 0.0
        la.apply(qr, q, X, DIRECTION)
        la.add(X, POINT, -step, X, DIRECTION, START, p)
    if step == math.inf:
        return STUCK
    for j in range(q):
        force = X[FORCE, j] - step * X[RATIO, j]
        X[FORCE, j] = max(0.0, force)
    return leaving


@in_place
def reach(G: Array, rows: Array, qr: QR, X: Array, active: IntArray, chosen: int, q: int) -> int:
    """Move the point until a row is met, and remove rows whose multiplier would become negative.

    Return how many of the q active rows are left, or ``NO_POINT`` if no point meets the row
    together with them. X[NEW] becomes the row's normal in the basis of the QR.
    """
    p = G.shape[0]
    while True:
        excess = -rows[SIDE, chosen]
        for j in range(p):
            X[NEW, j] = G[j, chosen]
            excess += X[NEW, j] * X[POINT, j]
        la.apply_transposed(qr, q, X, NEW)
        leaving = advance(qr, X, NEW, excess, q, p)
        if leaving < 0:
            return q if leaving == NONE else NO_POINT
        q -= 1
        drop(G, qr, X, active, leaving, q)


@in_place
def minimise(qr: QR, X: Array, q: int) -> None:
    """Recompute point and multipliers from the QR, so that errors do not accumulate.

    On input X[POINT] contains the sides of the q active rows, then zeros.
    """
    la.solve_lower(qr, q, X, POINT)
    la.copy(X, FORCE, X, POINT, q)
    la.solve_upper(qr, q, X, FORCE)
    for j in range(q):
        X[FORCE, j] = -X[FORCE, j]
    la.apply(qr, q, X, POINT)


@in_place
def clip_forces(X: Array, q: int) -> None:
    """Set multipliers to zero that rounding has made negative."""
    for j in range(q):
        X[FORCE, j] = max(0.0, X[FORCE, j])


@in_place
def recompute(rows: Array, qr: QR, X: Array, active: IntArray, q: int) -> None:
    """Recompute point and multipliers from the rows of the problem; see :func:`minimise`."""
    for j in range(qr.columns.shape[0]):
        X[POINT, j] = rows[SIDE, active[j]] if j < q else 0.0
    minimise(qr, X, q)
    clip_forces(X, q)


@in_place
def proved(G: Array, rows: Array, X: Array, active: IntArray, q: int, size: float) -> bool:
    """True if the point satisfies the optimality conditions.

    Rows are met, multipliers are positive only for rows that are reached, and the point is a sum of
    the normals of those rows.
    """
    p, m = G.shape
    are_met = size < math.inf
    for i in range(m):
        allowed = OPTIMAL * (size + abs(rows[SIDE, i]))
        are_met = are_met and rows[EXCESS, i] <= allowed
    are_complementary = True
    la.copy(X, NEW, X, POINT, p)
    for i in range(q):
        row = active[i]
        force = X[FORCE, i]
        rows[MULTIPLIER, row] = force
        product = force * abs(rows[EXCESS, row])
        are_complementary = are_complementary and product <= OPTIMAL * size * size
        for j in range(p):
            X[NEW, j] += force * G[j, row]
    is_stationary = la.length(X, NEW, p) <= OPTIMAL * size
    return are_met and are_complementary and is_stationary


@inner
def nearest(G: Array, rows: Array, metric: QR, X: Array, scratch: Scratch) -> tuple[int, int]:
    """Minimise ½‖R y + r‖² subject to Gᵀ y ≤ h. Return the code and the number of added rows.

    In u = R y + r, and with rows of unit norm, this is the point of Gᵀ u ≤ h nearest to the origin.
    The most violated row is added to the active ones. Active rows whose multiplier would become
    negative on the way are removed. The active rows are stored as a QR factorization, from which
    the point and the multipliers are recomputed after every addition. Each addition increases the
    norm of the point, so that no set of active rows recurs. If rounding prevents the increase, the
    search ends. (Goldfarb, Idnani, "A numerically stable dual method for solving strictly convex
    quadratic programs", Mathematical Programming, 1983.)

    ``G`` (p, m) has a column for each row of the problem, so that all rows are processed at once;
    it is overwritten. ``rows`` (4, m) contains h in SIDE, where ∞ is an absent row. It receives the
    multipliers of rows of unit norm and the inverses of the norms. ``metric`` contains R, and r as
    a further column behind it (p + 1, p). The first p entries of the first row of ``X`` (5, p) or
    wider are the answer y.
    """
    p, m = G.shape
    qr = empty_qr(scratch, p, p)
    active = integers(scratch, p)
    if not normalise(G, rows, metric):
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
        met = chosen == NONE or not size > before
        if met:
            break
        q = reach(G, rows, qr, X, active, chosen, q)
        if q == NO_POINT:
            return INCOMPATIBLE, steps
        la.copy(qr.columns, q, X, NEW, p)
        la.make_reflection(qr, q)
        active[q] = chosen
        q += 1
        recompute(rows, qr, X, active, q)
        before = size
        size = la.length(X, POINT, p)
    met = proved(G, rows, X, active, q, size) and met
    la.add(X, POINT, -1.0, metric.columns, p, START, p)
    la.solve_upper(metric, p, X, POINT)
    return (SOLVED if met else FAILED), steps
