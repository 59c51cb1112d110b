"""The point of a polyhedron nearest to the origin, compiled: a dual active-set method."""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array
from .compiler import inner
from .linear import DONE, apply, dot, make_reflection, norm, reflect, solve_lower, solve_upper

FAILED = 2
"""No answer that passes the check."""

INCOMPATIBLE = 3
"""The rows contradict each other."""

EXCEEDED = 1e-12
"""A row exceeded by less than this fraction of its terms is met."""

DEPENDENT = 1e-11
"""A row of unit norm whose part outside the span of the active ones is below this depends on them."""

OPTIMAL = 1e-9
"""Largest error in the optimality conditions, relative to the size of the answer."""


@inner
def nearest(center: Array, T: Array, walls: Array, sides: Array, x: Array, multipliers: Array) -> tuple[int, int]:
    """Minimise ½‖u‖² subject to walls · x ≤ sides, x = center + T u: the code, and how many rows were added.

    Parameters
    ----------
    center
        (n,) the answer where no row excludes it.
    T
        (p, n) by columns.
    walls, sides
        (m, n) and (m,).
    x, multipliers
        (n,) and (m,) outputs; the multipliers are those of rows of unit norm in u.
    """
    m, n = walls.shape
    p = T.shape[0]
    G, h, u = np.empty((m, p)), np.empty(m), np.empty(p)
    size = 0.0
    for i in range(m):
        squared = 0.0
        for j in range(p):
            G[i, j] = dot(walls[i], T[j], 0, n)
            squared += G[i, j] * G[i, j]
        length = math.sqrt(squared)
        h[i] = (sides[i] - dot(walls[i], center, 0, n)) / length
        if not abs(h[i]) < math.inf:
            return FAILED, 0
        size = max(size, -h[i])
        for j in range(p):
            G[i, j] /= length
    for j in range(n):
        x[j] = center[j]
    for i in range(m):
        multipliers[i] = 0.0
    if size == 0.0:
        return DONE, 0
    for i in range(m):
        h[i] /= size
    code, steps = nearest_to_origin(G, h, u, multipliers)
    for j in range(p):
        for i in range(n):
            x[i] += size * u[j] * T[j, i]
    return code, steps


@inner
def nearest_to_origin(G: Array, h: Array, u: Array, multipliers: Array) -> tuple[int, int]:
    """Minimise ½‖u‖² subject to G u ≤ h, rows of unit norm: the code, and how many rows were added.

    The most violated row is added to the active ones; those whose multiplier would turn negative on the way leave.
    The active rows are kept as a QR factorization, and the point and the multipliers are computed from it anew after
    every addition, so that errors do not accumulate. Each addition makes the point longer, so that no set of active
    rows returns; one that does not, by rounding, ends the search.

    Reference: Goldfarb, Idnani, "A numerically stable dual method for solving strictly convex quadratic programs",
    Mathematical Programming, 1983.
    """
    m, p = G.shape
    F, S, X = np.zeros((p, p)), np.empty((2, p + 1)), np.zeros((2, p))
    active, force, ratio = np.zeros(p, np.int64), np.zeros(p + 1), np.zeros((1, p + 1))
    for j in range(p):
        u[j] = 0.0
    q = steps = 0
    length = 0.0
    for steps in range(10 * (m + p)):
        chosen, worst = -1, 0.0
        for i in range(m):
            excess = dot(G[i], u, 0, p) - h[i]
            if excess > worst and excess > EXCEEDED * (length + abs(h[i])):
                chosen, worst = i, excess
        if chosen < 0:
            break
        amount = 0.0
        while True:
            for j in range(p):
                X[0, j] = G[chosen, j]
            for j in range(q):
                reflect(F, j, S[1, j], X, 0)
            outside = 0.0
            for j in range(q, p):
                outside += X[0, j] * X[0, j]
            for j in range(q):
                ratio[0, j] = X[0, j]
            solve_upper(F[:q], S, ratio, 0)
            leaving, step = -1, math.inf
            for j in range(q):
                if ratio[0, j] > 0.0 and force[j] < step * ratio[0, j]:
                    leaving, step = j, force[j] / ratio[0, j]
            independent = math.sqrt(outside) > DEPENDENT
            full = (dot(G[chosen], u, 0, p) - h[chosen]) / outside if independent else math.inf
            if full <= step:
                leaving, step = -1, full
            if step == math.inf:
                return INCOMPATIBLE, steps
            if independent:
                for j in range(p):
                    X[1, j] = X[0, j] if j >= q else 0.0
                apply(F[:q], S, X, 1)
                for j in range(p):
                    u[j] -= step * X[1, j]
            for j in range(q):
                force[j] = max(0.0, force[j] - step * ratio[0, j])
            amount += step
            if leaving < 0:
                break
            q -= 1
            for j in range(leaving, q):
                active[j], force[j] = active[j + 1], force[j + 1]
                for i in range(p):
                    F[j, i] = G[active[j], i]
                for i in range(j):
                    reflect(F, i, S[1, i], F, j)
                make_reflection(F, S, j)
        for j in range(p):
            F[q, j] = X[0, j]
        make_reflection(F, S, q)
        active[q] = chosen
        q += 1
        for j in range(p):
            X[0, j] = h[active[j]] if j < q else 0.0
        solve_lower(F[:q], S, X, 0)
        for j in range(q):
            ratio[0, j] = X[0, j]
        solve_upper(F[:q], S, ratio, 0)
        for j in range(q):
            force[j] = max(0.0, -ratio[0, j])
        apply(F[:q], S, X, 0)
        for j in range(p):
            u[j] = X[0, j]
        before, length = length, norm(u)
        if not length > before:
            break
    for i in range(m):
        if not dot(G[i], u, 0, p) - h[i] <= OPTIMAL * (length + abs(h[i])):
            return FAILED, steps
    for j in range(p):
        X[0, j] = u[j]
    for i in range(q):
        multipliers[active[i]] = force[i]
        if not force[i] * abs(dot(G[active[i]], u, 0, p) - h[active[i]]) <= OPTIMAL * length * length:
            return FAILED, steps
        for j in range(p):
            X[0, j] += force[i] * G[active[i], j]
    return (DONE if math.sqrt(dot(X[0], X[0], 0, p)) <= OPTIMAL * length else FAILED), steps
