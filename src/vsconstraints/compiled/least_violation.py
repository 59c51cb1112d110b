"""Level 1 of the hierarchy, compiled: the points of least violation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..rows import Array, BoolArray
from .codes import FAILED, SOLVED
from .compiler import inner
from .least_squares import WELL, pseudoinverse
from .linear import ONE, START, clip, constant, dot, length
from .scratch import filled, flags, matrix, vector
from .workspace import Scratch

#: A row exceeded by less than this fraction of its terms counts as met during the iteration.
ROUNDING = 1e-13
#: A step counts as zero if it changes no violation by more than this fraction of their norm, or by
#: more than rounding.
CONVERGED = 1e-12
RANK = 1e-14  #: Singular values below this fraction of the largest count as zero in a step.
#: Rows of a box (2, n): least and greatest x, infinite if there is no bound.
LEAST = constant(0)
GREATEST = constant(1)


class Violations(NamedTuple):
    """Weighted rows B x ≤ d of norms ‖Bᵢ‖, with their residuals, rounding errors and states.

    ``residual`` is B x − d, and ``rounding`` the rounding error in it. ``change`` is the change of
    the residual by a step. ``reached`` rows are just met and would be violated by the step.
    ``pulled`` rows take part in the step. ``held`` (n,) is the end of the box at which a coordinate
    is held: −1, 1, or 0 if at none.
    """

    B: Array
    d: Array
    norms: Array
    residual: Array
    rounding: Array
    change: Array
    violated: BoolArray
    reached: BoolArray
    pulled: BoolArray
    held: Array


@inner
def weigh(A: Array, c: Array, weights: Array, scratch: Scratch) -> Violations:
    """Return the rows W A x ≤ W c, with no row reached and no coordinate held."""
    m, n = A.shape
    B = matrix(scratch, m, n)
    d = vector(scratch, m)
    norms = vector(scratch, m)
    for i in range(m):
        for j in range(n):
            B[i, j] = weights[i] * A[i, j]
        d[i] = weights[i] * c[i]
        norms[i] = length(B, i, n)
    residual = vector(scratch, m)
    rounding = vector(scratch, m)
    change = vector(scratch, m)
    violated = flags(scratch, m)
    reached = flags(scratch, m)
    pulled = flags(scratch, m)
    held = filled(scratch, n, 0.0)
    return Violations(B, d, norms, residual, rounding, change, violated, reached, pulled, held)


@inner
def measure(rows: Violations, X: Array) -> tuple[bool, float]:
    """Write the violations at X[0]. Return True if all rows are met, and the sum of the squares."""
    n = X.shape[1]
    met = True
    value = 0.0
    size = length(X, START, n)
    for i in range(rows.d.size):
        side = rows.d[i]
        residual = dot(rows.B, i, X, START, START, n) - side
        rounding = ROUNDING * (rows.norms[i] * size + abs(side))
        met = met and residual <= rounding
        # rows exceeded by rounding alone count here: a row of large scale blocks small ones by just
        # that much
        is_violated = residual > 0.0
        is_reached = rows.reached[i] and residual >= -rounding
        rows.residual[i] = residual
        rows.rounding[i] = rounding
        rows.violated[i] = is_violated
        rows.reached[i] = is_reached
        rows.pulled[i] = is_violated or is_reached
        if is_violated:
            value += residual * residual
    return met, value


@inner
def newton_step(rows: Violations, step: Array, Y: Array, scratch: Scratch) -> None:
    """Write the step that moves the pulled rows to their bounds in the least-squares sense.

    Held coordinates do not move.
    """
    B = rows.B
    held = rows.held
    m, n = rows.B.shape
    count = 0
    columns = 0
    at = 0
    free = 0
    taken = scratch.taken[0]
    for i in range(m):
        count += rows.pulled[i]
    for j in range(n):
        columns += held[j] == 0.0
    M = matrix(scratch, count, columns + 1)
    for i in range(m):
        if rows.pulled[i]:
            to = 0
            for j in range(n):
                if held[j] == 0.0:
                    M[at, to] = B[i, j]
                    to += 1
            M[at, to] = -rows.residual[i]
            at += 1
    pseudoinverse(M, START, WELL, RANK, M, Y, START, scratch)
    scratch.taken[0] = taken
    for j in range(n):
        step[0, j] = 0.0 if held[j] != 0.0 else Y[0, free]
        free += held[j] == 0.0


@inner
def look_along(rows: Violations, step: Array, still: float) -> tuple[bool, bool]:
    """Write the change of the rows by the step, and return two flags.

    The first is True if the step changes no violated row, the second if a row blocks it at once.
    """
    stationary = True
    blocked = False
    n = step.shape[1]
    for i in range(rows.d.size):
        rounding = rows.rounding[i]
        change = dot(rows.B, i, step, START, START, n)
        rows.change[i] = change
        if rows.violated[i] and not abs(change) <= still + rounding:
            stationary = False
        # a row of large scale that is just met blocks the step at once, unless it takes part in it
        is_just_met = not rows.pulled[i] and rows.residual[i] >= -rounding
        if is_just_met and change > rounding:
            rows.reached[i] = True
            blocked = True
    return stationary, blocked


@inner
def most_pulled(rows: Violations, box: Array, still: float) -> tuple[int, bool]:
    """Return the held coordinate that the violations pull inward the most.

    Also return True if the pull exceeds rounding.
    """
    worst = 0
    strongest = -math.inf
    threshold = 0.0
    for j in range(rows.held.size):
        pull = 0.0
        noise = 0.0
        for i in range(rows.d.size):
            if rows.violated[i]:
                entry = rows.B[i, j]
                pull += rows.residual[i] * entry
                noise += abs(entry) * (still + rows.rounding[i])
        has_room = box[LEAST, j] < box[GREATEST, j]
        pull *= rows.held[j] if has_room else 0.0
        if pull > strongest:
            worst = j
            strongest = pull
            threshold = noise
    return worst, not strongest <= threshold


@inner
def line_search(residual: Array, change: Array, limit: float) -> float:
    """Return the length t in [0, limit] that minimises ½‖max(0, residual + t·change)‖².

    The derivative is nondecreasing and piecewise linear, with kinks where a row is just met. It is
    evaluated at every kink to find the two on either side of its zero.
    """
    lower = 0.0
    upper = limit
    slope = 0.0
    curvature = 0.0
    for k in range(residual.size):
        if change[k] == 0.0:
            continue
        kink = -residual[k] / change[k]
        if not lower < kink < upper:
            continue
        derivative = 0.0
        for i in range(residual.size):
            excess = max(residual[i] + kink * change[i], 0.0)
            derivative += excess * change[i]
        if derivative >= 0.0:
            upper = kink
        else:
            lower = kink
    middle = 0.5 * (lower + upper) if upper < math.inf else lower + 1.0
    for i in range(residual.size):
        if change[i] != 0.0 and residual[i] + middle * change[i] > 0.0:
            curvature += change[i] * change[i]
            slope += residual[i] * change[i]
    if curvature == 0.0:
        return lower
    return clip(-slope / curvature, lower, upper)


@inner
def advance(rows: Violations, box: Array, step: Array, x: Array, longest: Array) -> bool:
    """Move along the step as far as it helps within the box, and hold coordinates that reach it.

    Return True if a coordinate reaches the box.
    """
    limit = math.inf
    for j in range(x.size):
        moves = step[0, j]
        if moves == 0.0:
            longest[j] = math.inf
        elif moves > 0.0:
            longest[j] = (box[GREATEST, j] - x[j]) / moves
        else:
            longest[j] = (x[j] - box[LEAST, j]) / -moves
        limit = min(limit, max(0.0, longest[j]))
    t = line_search(rows.residual, rows.change, limit)
    reaches_box = t >= limit
    for j in range(x.size):
        moves = step[0, j]
        x[j] += t * moves
        if reaches_box and longest[j] <= limit:
            rows.held[j] = np.copysign(1.0, moves)
            x[j] = box[GREATEST if moves > 0.0 else LEAST, j]
    return reaches_box


@inner
def least_violation(
    A: Array, c: Array, weights: Array, box: Array, x: Array, scratch: Scratch
) -> int:
    """Minimise ½‖max(0, W(Ax − c))‖² in a box, with W = diag(weights).

    The search begins at x, which becomes the minimiser. The function is convex and piecewise
    quadratic. Newton's method on the violated rows, with an exact line search, ends after finitely
    many steps with an exact minimiser. Coordinates that the box holds are kept in a working set and
    released when the gradient pulls them inward. The minimiser need not be unique, but its
    violations are.

    Beside large rows, small ones are lost in rounding. The result exceeds the least value of
    ‖max(0, W(Ax − c))‖ by at most a fraction of 1e-9 of it plus a part of the largest wᵢ(‖Aᵢ‖‖x‖ +
    |cᵢ|). This part is 1e-7 if the norms of weighted rows are up to 1e10 apart and some rows nearly
    repeat others, and 1e-3 of that if the norms are up to 1e6 apart.

    Return ``SOLVED``, or ``FAILED`` at the limit of iterations, which only rounding could cause.
    """
    m, n = A.shape
    rows = weigh(A, c, weights, scratch)
    longest = vector(scratch, n)
    X = matrix(scratch, ONE, n)
    step = matrix(scratch, ONE, n)
    Y = matrix(scratch, ONE, n)
    for j in range(n):
        x[j] = clip(x[j], box[LEAST, j], box[GREATEST, j])
    last = released_at = math.inf
    fruitless = 0
    for _ in range(20 + 10 * (m + n)):
        for j in range(n):
            X[0, j] = x[j]
        met, value = measure(rows, X)
        if met:
            return SOLVED
        newton_step(rows, step, Y, scratch)
        still = CONVERGED * np.sqrt(value)
        stationary, blocked = look_along(rows, step, still)
        if blocked:
            continue
        if stationary or value >= last:
            # stationary on this face of the box; in a corner, descent may need several releases
            worst, inward = most_pulled(rows, box, still)
            fruitless = fruitless + 1 if value >= released_at else 0
            # more than n fruitless releases are a cycle caused by rounding
            if not inward or fruitless > n:
                return SOLVED
            rows.held[worst] = 0.0
            released_at = value
            last = math.inf
        else:
            last = math.inf if advance(rows, box, step, x, longest) else value
    return FAILED
