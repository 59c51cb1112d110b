"""Level 1 of the hierarchy, compiled: the points that violate rows least."""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array, BoolArray
from .compiler import inner
from .least_squares import WELL, pseudoinverse
from .linear import ONE, START, constant, dot
from .scratch import no_scratch
from .structures import FAILED, SOLVED

ROUNDING = 1e-13
"""Below this fraction of its terms a row counts as met while iterating."""

CONVERGED = 1e-12
"""A step that would change no violation by more than this fraction of their norm, or by more than rounding, is none."""

RANK = 1e-14
"""Singular values below this fraction of the largest count as zero in a step."""

LEAST, GREATEST = constant(0), constant(1)
"""Rows of a box: (2, n) least and greatest x, infinite where there is no bound."""


@inner
def least_violation(A: Array, c: Array, weights: Array, box: Array, x: Array) -> int:
    """Minimise ½‖max(0, W(Ax − c))‖² in a box, W = diag(weights), beginning at x, which becomes the minimiser.

    The function is convex and piecewise quadratic: Newton's method on the rows that are violated, with an exact line
    search, ends after finitely many steps with an exact minimiser. Coordinates that the box holds are kept in a
    working set and released when the gradient pulls them inward. The minimiser need not be unique, but its violations
    are.

    Beside large rows small ones are lost in rounding. The result exceeds the least value of ‖max(0, W(Ax − c))‖ by at
    most a fraction of 1e-9 of it and a part of the largest wᵢ(‖Aᵢ‖‖x‖ + |cᵢ|): 1e-7 where the norms of weighted rows
    are up to 1e10 apart, some of them nearly repeating others, and 1e-3 of that where they are up to 1e6 apart.

    Returns
    -------
    int
        ``SOLVED``, or ``FAILED`` if the limit of iterations is reached, which only rounding could bring about.
    """
    m, n = A.shape
    B, d, rounding, sizes = np.empty((m, n)), np.empty(m), np.empty(m), np.empty(m)
    residual, change = np.empty(m), np.empty(m)
    X, step, Y, longest = np.empty((ONE, n)), np.empty((ONE, n)), np.empty((ONE, n)), np.empty(n)
    # at which end the box holds a coordinate: −1, 1, or 0 if at none
    held, violated = np.zeros(n), np.zeros(m, np.bool_)
    reached, pulled = np.zeros(m, np.bool_), np.zeros(m, np.bool_)
    for i in range(m):
        for j in range(n):
            B[i, j] = weights[i] * A[i, j]
        d[i] = weights[i] * c[i]
        sizes[i] = math.sqrt(dot(B, i, B, i, START, n))
    for j in range(n):
        x[j] = X[0, j] = min(max(x[j], box[LEAST, j]), box[GREATEST, j])
    last = released_at = math.inf
    fruitless = 0
    for _ in range(20 + 10 * (m + n)):
        met = True
        value = 0.0
        length = math.sqrt(dot(X, START, X, START, START, n))
        for i in range(m):
            residual[i] = dot(B, i, X, START, START, n) - d[i]
            rounding[i] = ROUNDING * (sizes[i] * length + abs(d[i]))
            met = met and residual[i] <= rounding[i]
            # rows exceeded by rounding alone count here: a row of large scale holds small ones by just that much
            violated[i] = residual[i] > 0.0
            reached[i] = reached[i] and residual[i] >= -rounding[i]
            pulled[i] = violated[i] or reached[i]
            if violated[i]:
                value += residual[i] * residual[i]
        if met:
            return SOLVED
        # the step that takes the violated rows to their bounds in the least-squares sense, held coordinates apart
        M = newton_system(B, residual, pulled, held)
        pseudoinverse(M, START, WELL, RANK, M, Y, START, no_scratch())
        free = 0
        for j in range(n):
            step[0, j] = 0.0 if held[j] != 0.0 else Y[0, free]
            free += held[j] == 0.0
        still = CONVERGED * math.sqrt(value)
        stationary, blocked = True, False
        for i in range(m):
            change[i] = dot(B, i, step, START, START, n)
            stationary = stationary and (not violated[i] or abs(change[i]) <= still + rounding[i])
            # a row of large scale that is just met ends a step before it begins, unless it takes part
            if not pulled[i] and residual[i] >= -rounding[i] and change[i] > rounding[i]:
                reached[i] = blocked = True
        if blocked:
            continue
        if stationary or value >= last:
            # stationary on this face of the box: which held coordinate is pulled inward the most?
            worst, strongest, threshold = 0, -math.inf, 0.0
            for j in range(n):
                pull = noise = 0.0
                for i in range(m):
                    if violated[i]:
                        pull += residual[i] * B[i, j]
                        noise += abs(B[i, j]) * (still + rounding[i])
                pull *= held[j] if box[LEAST, j] < box[GREATEST, j] else 0.0
                if pull > strongest:
                    worst, strongest, threshold = j, pull, noise
            # in a corner several releases may be needed before there is descent; more than n are a cycle of rounding
            fruitless = fruitless + 1 if value >= released_at else 0
            if strongest <= threshold or fruitless > n:
                return SOLVED
            released_at = value
            held[worst] = 0.0
            last = math.inf
            continue
        limit = math.inf
        for j in range(n):
            moves = step[0, j]
            room = box[GREATEST, j] - x[j] if moves > 0.0 else x[j] - box[LEAST, j]
            longest[j] = room / abs(moves) if moves != 0.0 else math.inf
            limit = min(limit, max(0.0, longest[j]))
        t = line_search(residual, change, limit)
        last = math.inf if t >= limit else value
        for j in range(n):
            x[j] += t * step[0, j]
            if t >= limit and longest[j] <= limit:
                held[j] = math.copysign(1.0, step[0, j])
                x[j] = box[GREATEST if step[0, j] > 0.0 else LEAST, j]
            X[0, j] = x[j]
    return FAILED


@inner
def newton_system(B: Array, residual: Array, pulled: BoolArray, held: Array) -> Array:
    """The rows that take part and what they ask of the coordinates that are not held: [M | target]."""
    m, n = B.shape
    rows = columns = 0
    for i in range(m):
        rows += pulled[i]
    for j in range(n):
        columns += held[j] == 0.0
    M = np.empty((rows, columns + 1))
    at = 0
    for i in range(m):
        if pulled[i]:
            to = 0
            for j in range(n):
                if held[j] == 0.0:
                    M[at, to] = B[i, j]
                    to += 1
            M[at, to] = -residual[i]
            at += 1
    return M


@inner
def line_search(residual: Array, change: Array, limit: float) -> float:
    """Length t in [0, limit] that minimises ½‖max(0, residual + t·change)‖².

    The derivative is nondecreasing and piecewise linear, with kinks where a row is just met: the kinks on either side
    of its zero are found by evaluating it at every one of them.
    """
    m = residual.size
    lower, upper = 0.0, limit
    for k in range(m):
        if change[k] == 0.0:
            continue
        kink = -residual[k] / change[k]
        if not lower < kink < upper:
            continue
        derivative = 0.0
        for i in range(m):
            derivative += max(residual[i] + kink * change[i], 0.0) * change[i]
        if derivative >= 0.0:
            upper = kink
        else:
            lower = kink
    middle = 0.5 * (lower + upper) if upper < math.inf else lower + 1.0
    slope = curvature = 0.0
    for i in range(m):
        if change[i] != 0.0 and residual[i] + middle * change[i] > 0.0:
            curvature += change[i] * change[i]
            slope += residual[i] * change[i]
    if curvature == 0.0:
        return lower
    return min(max(-slope / curvature, lower), upper)
