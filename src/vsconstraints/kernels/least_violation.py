"""Level 1 of the hierarchy, compiled: the points that violate rows least."""

from __future__ import annotations

import math

import numpy as np

from ..qp.least_violation import CONVERGED, ROUNDING
from ..rows import Array, BoolArray
from .compiler import inner
from .least_distance import FAILED
from .linear import DONE, add_solution, decompose, dot, full_rank_solution, norm


@inner
def least_violation(A: Array, c: Array, weights: Array, bound: float, x: Array) -> int:
    """As :func:`vsconstraints.qp.least_violation.least_violation`, beginning at x, which becomes the minimiser."""
    m, n = A.shape
    B, d, rounding, sizes = np.empty((m, n)), np.empty(m), np.empty(m), np.empty(m)
    residual, change, step = np.empty(m), np.empty(m), np.empty(n)
    held, violated = np.zeros(n, np.bool_), np.zeros(m, np.bool_)
    for i in range(m):
        for j in range(n):
            B[i, j] = weights[i] * A[i, j]
        d[i] = weights[i] * c[i]
        sizes[i] = norm(B[i])
    for j in range(n):
        x[j] = min(max(x[j], -bound), bound)
    last = released_at = math.inf
    fruitless = 0
    for _ in range(20 + 10 * (m + n)):
        length = norm(x)
        met = True
        value = 0.0
        for i in range(m):
            residual[i] = dot(B[i], x, 0, n) - d[i]
            rounding[i] = ROUNDING * (sizes[i] * length + abs(d[i]))
            met = met and residual[i] <= rounding[i]
            # rows exceeded by rounding alone count here: a row of large scale holds small ones by just that much
            violated[i] = residual[i] > 0.0
            if violated[i]:
                value += residual[i] * residual[i]
        if met:
            return DONE
        newton_step(B, residual, violated, held, step)
        still = CONVERGED * math.sqrt(value)
        stationary = True
        for i in range(m):
            change[i] = dot(B[i], step, 0, n)
            stationary = stationary and (not violated[i] or abs(change[i]) <= still + rounding[i])
        if stationary or value >= last:
            # stationary on this face of the box: which held coordinate is pulled inward the most?
            worst, strongest, threshold = 0, -math.inf, 0.0
            for j in range(n):
                pull = noise = 0.0
                for i in range(m):
                    if violated[i]:
                        pull += residual[i] * B[i, j]
                        noise += abs(B[i, j]) * (still + rounding[i])
                pull *= np.sign(x[j]) if held[j] else 0.0
                if pull > strongest:
                    worst, strongest, threshold = j, pull, noise
            # in a corner several releases may be needed before there is descent; more than n are a cycle of rounding
            fruitless = fruitless + 1 if value >= released_at else 0
            if strongest <= threshold or fruitless > n:
                return DONE
            released_at = value
            held[worst] = False
            last = math.inf
            continue
        limit = math.inf
        for j in range(n):
            if step[j] != 0.0:
                limit = min(limit, max(0.0, (bound - math.copysign(1.0, step[j]) * x[j]) / abs(step[j])))
        t = line_search(residual, change, limit)
        last = math.inf if t >= limit else value
        for j in range(n):
            blocked = (
                t >= limit and step[j] != 0.0 and (bound - math.copysign(1.0, step[j]) * x[j]) / abs(step[j]) <= limit
            )
            x[j] += t * step[j]
            if blocked:
                held[j] = True
                x[j] = math.copysign(bound, step[j])
    return FAILED


@inner
def newton_step(B: Array, residual: Array, violated: BoolArray, held: BoolArray, step: Array) -> None:
    """The step that takes the violated rows to their bounds in the least-squares sense, held coordinates apart."""
    m, n = B.shape
    rows = columns = 0
    for i in range(m):
        rows += violated[i]
    for j in range(n):
        columns += not held[j]
        step[j] = 0.0
    M, target, Y = np.empty((rows, columns)), np.empty(rows), np.zeros((1, columns))
    at = 0
    for i in range(m):
        if violated[i]:
            target[at] = -residual[i]
            to = 0
            for j in range(n):
                if not held[j]:
                    M[at, to] = B[i, j]
                    to += 1
            at += 1
    if rows == 0 or columns == 0:
        return
    if not full_rank_solution(M, 0, target, 1e-4 * norm(M), Y):
        gains, W, V = decompose(M)
        add_solution(gains, W, V, target, 1e-14 * gains[0], Y[0])
    to = 0
    for j in range(n):
        if not held[j]:
            step[j] = Y[0, to]
            to += 1


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
