"""The hierarchical quadratic program, compiled: rows, task and least acceleration with strict priorities."""

from __future__ import annotations

import math

import numpy as np

from ..qp.lexicographic import DEPENDENT, PULLING, RELAXED, SIGNIFICANT
from ..rows import Array, BoolArray
from .compiler import compiled, inner
from .least_distance import FAILED, INCOMPATIBLE, nearest
from .least_violation import least_violation
from .linear import (
    ASK,
    CERTAIN,
    DONE,
    apply_transposed,
    decompose,
    dot,
    factor,
    finite,
    full_rank_solution,
    norm,
    resolve,
    solve_upper,
)
from .task_priority import OUTPUT, ROWS, TASK, valid

RELAXED_ROWS = 4
"""The outputs hold the answer; some demands are unmet."""

ROUNDING = 1e-12
"""A demand exceeded by less than this fraction of its terms is met: it is the rounding of A q̈ − c."""

ZERO_GRADIENT = 1e-12
"""A row with ‖L_gφ‖ below this times its scale is one that no acceleration can influence."""


@inner
def cost(J: Array, b: Array, tolerance: float, damping: float) -> Array:
    """E by columns, (n, ·): levels 2 and 3 are ½‖E (q̈ − J†b)‖² (see the controller's ``task_cost``)."""
    k, n = J.shape
    size = norm(J)
    Y = np.empty((1, n))
    if k > 0 and full_rank_solution(J, 0, b, CERTAIN * tolerance * size, Y):
        E = np.zeros((n, k + n))
        for j in range(n):
            for i in range(k):
                E[j, i] = J[i, j] / size
            E[j, k + j] = math.sqrt(damping)
        return E
    gains, _, V = decompose(J)
    floor = tolerance * gains[0]
    size = 0.0
    for j in range(n):
        if not gains[j] > floor:
            gains[j] = 0.0
        size = math.hypot(size, gains[j])
    E = np.zeros((n, n))
    for i in range(n):
        relative = gains[i] / size if size > 0.0 else 0.0
        stiffness = math.sqrt(relative * relative + damping)
        for j in range(n):
            E[j, i] = stiffness * V[i, j]
    return E


@inner
def metric(E: Array, offset: Array, Z: Array, T: Array, shift: Array) -> None:
    """The change of variables in which ½‖E (offset + Z y)‖² is ½‖u‖², up to a constant: Z y = T u − shift.

    Parameters
    ----------
    E
        (n, r) by columns.
    offset
        (n,).
    Z
        (p, n) by columns.
    T, shift
        (p, n) by columns and (n,), outputs.
    """
    n, r = E.shape
    p = Z.shape[0]
    F, S, X = np.zeros((p, r)), np.empty((2, p)), np.zeros((1, r))
    for i in range(r):
        for j in range(n):
            X[0, i] += E[j, i] * offset[j]
            for d in range(p):
                F[d, i] += E[j, i] * Z[d, j]
    factor(F, S)
    apply_transposed(F, S, X, 0)
    solve_upper(F, S, X, 0)
    for j in range(n):
        shift[j] = 0.0
        for d in range(p):
            shift[j] += X[0, d] * Z[d, j]
    for d in range(p):
        for i in range(p):
            X[0, i] = 1.0 if i == d else 0.0
        solve_upper(F, S, X, 0)
        for j in range(n):
            T[d, j] = 0.0
            for i in range(d + 1):
                T[d, j] += X[0, i] * Z[i, j]


@inner
def within_least_violation(
    walls: Array,
    sides: Array,
    weights: Array,
    E: Array,
    T: Array,
    bound: float,
    center: Array,
    x: Array,
    violation: Array,
    multipliers: Array,
) -> tuple[int, int]:
    """The least cost among the points that violate as little as x, which becomes that point."""
    w, n = walls.shape
    m = weights.size
    length = norm(x)
    relaxed = sides.copy()
    pinned, forces, terms = np.zeros(n, np.bool_), np.zeros(n), np.zeros(n)
    count = 0
    for i in range(w):
        value = dot(walls[i], x, 0, n)
        size = norm(walls[i])
        if i < m and value - sides[i] > SIGNIFICANT * (size * length + abs(sides[i])):
            violation[i] = value - sides[i]
            count += 1
            for j in range(n):
                force = walls[i, j] * weights[i] * weights[i] * violation[i]
                forces[j] += force
                terms[j] += abs(force)
        # x itself becomes feasible, with a little room: the rows may leave a set without interior
        room = RELAXED * (size * length + abs(sides[i]))
        relaxed[i] = max(sides[i], value) + room
    if count == 0:
        code, steps = nearest(center, T, walls, relaxed, x, multipliers)
        return (FAILED if code == INCOMPATIBLE else code), steps
    # where the violations pull a coordinate against the box, every point that violates least has it at that bound
    for j in range(n):
        pinned[j] = abs(forces[j]) > SIGNIFICANT * terms[j] and abs(x[j]) >= bound
        count += pinned[j]
    settled = np.zeros((count, n))
    at = 0
    for i in range(m):
        if violation[i] > 0.0:
            size = norm(walls[i])
            for j in range(n):
                settled[at, j] = walls[i, j] / size
            at += 1
    for j in range(n):
        if pinned[j]:
            settled[at, j] = 1.0
            at += 1
    gains, _, V = decompose(settled)
    rank = 0
    while rank < n and gains[rank] > DEPENDENT * gains[0]:
        rank += 1
    for i in range(w):
        multipliers[i] = 0.0
    if rank == n:
        return DONE, 0
    Z = V[rank:]
    p = n - rank
    others = np.zeros(w, np.bool_)
    count = 0
    for i in range(w):
        if i >= m or violation[i] == 0.0:
            seen = 0.0
            for d in range(p):
                seen = math.hypot(seen, dot(walls[i], Z[d], 0, n))
            # rows within the span of the violated ones are settled by the equalities
            others[i] = seen > DEPENDENT * norm(walls[i])
            count += others[i]
    G, h, held = np.empty((count, n)), np.empty(count), np.empty(count)
    at = 0
    for i in range(w):
        if others[i]:
            h[at] = relaxed[i]
            for j in range(n):
                G[at, j] = walls[i, j]
            at += 1
    offset, reduced, shift = np.empty(n), np.empty((p, n)), np.empty(n)
    for j in range(n):
        offset[j] = x[j] - center[j]
    metric(E, offset, Z, reduced, shift)
    for j in range(n):
        shift[j] = x[j] - shift[j]
    code, steps = nearest(shift, reduced, G, h, x, held)
    at = 0
    for i in range(w):
        if others[i]:
            multipliers[i] = held[at]
            at += 1
    for j in range(n):
        x[j] = min(max(x[j], -bound), bound)
    for i in range(m):
        if violation[i] > 0.0:
            violation[i] = max(0.0, dot(walls[i], x, 0, n) - sides[i])
    return (FAILED if code == INCOMPATIBLE else code), steps


OPTIONS = "float64, boolean, float64, float64[::1], float64, float64"
"""Signature of the tolerance, the form of the rows, α, weights, box and damping."""


@compiled(f"UniTuple(int64, 2)({ROWS}, {TASK}, {OPTIONS}, float64[::1], {OUTPUT})")
def descend(
    m: int,
    phi: Array,
    Lg: Array,
    Lf: Array,
    gain: Array,
    scale: Array,
    J: Array,
    b: Array,
    tolerance: float,
    barrier: bool,
    alpha: float,
    weights: Array,
    bound: float,
    damping: float,
    slack: Array,
    acted: BoolArray,
    qdd: Array,
) -> tuple[int, int]:
    """The three levels, as :class:`vsconstraints.controllers.HierarchicalQP` defines them, after a check of the input.

    Parameters
    ----------
    m
        The number of labels.
    phi, Lg, Lf, gain, scale
        (m,), (m, n), (m,), (m,) and (m,) of the rows.
    J, b
        (k, n) and (k,) of the task.
    tolerance, alpha, damping
        Options of the controller.
    barrier
        Whether the rows demand decay of φ; if not, the active ones demand −u⁺.
    weights
        (m,) of level 1.
    bound
        Half the width of the box, or infinity.
    slack, acted, qdd
        (m,), (m,) and (n,) outputs.

    Returns
    -------
    tuple
        ``DONE``, ``RELAXED_ROWS``, ``FAILED`` or ``ASK``; and the iterations of the active-set method, at least 1 if it
        was needed.
    """
    if not valid(m, phi, Lg, Lf, gain, scale, J, b, qdd.size) or acted.size != m or slack.size != m:
        return ASK, 0
    n = qdd.size
    resolve(Lg[:0], phi[:0], J, b, tolerance, qdd)
    # demands A q̈ ≤ c of the rows that have any
    c, fixed = np.empty(m), np.zeros(m, np.bool_)
    length = norm(qdd)
    below = within = True
    for j in range(n):
        within = within and abs(qdd[j]) <= bound
    tracks = True
    for i in range(m):
        acted[i] = barrier or phi[i] >= 0.0
        slack[i] = 0.0
        if not acted[i]:
            continue
        c[i] = -alpha * phi[i] - Lf[i] if barrier else -gain[i]
        size = norm(Lg[i])
        excess = dot(Lg[i], qdd, 0, n) - c[i]
        fixed[i] = size <= ZERO_GRADIENT * scale[i]
        below = below and excess <= 0.0
        tracks = tracks and (c[i] >= 0.0 if fixed[i] else excess <= ROUNDING * (size * length + abs(c[i])))
    if within and (below or tracks):
        for i in range(m):
            acted[i] = False
        return (DONE if finite(qdd) else ASK), 0

    free = 0
    for i in range(m):
        free += acted[i] and not fixed[i]
    walls = np.zeros((free + (2 * n if bound < math.inf else 0), n))
    sides, W, index = np.empty(walls.shape[0]), np.empty(free), np.empty(free, np.int64)
    at = 0
    unmet = False
    for i in range(m):
        if acted[i]:
            acted[i] = False
            if fixed[i]:
                slack[i] = max(0.0, -c[i])
                unmet = unmet or slack[i] > 0.0
            else:
                sides[at], W[at], index[at] = c[i], weights[i], i
                for j in range(n):
                    walls[at, j] = Lg[i, j]
                at += 1
    for i in range(free, walls.shape[0]):
        j = i - free
        walls[i, j % n] = 1.0 if j < n else -1.0
        sides[i] = bound
    violation, multipliers = np.zeros(free), np.empty(walls.shape[0])
    E = cost(J, b, tolerance, damping)
    center, T, shift, Z = qdd.copy(), np.empty((n, n)), np.zeros(n), np.zeros((n, n))
    for j in range(n):
        Z[j, j] = 1.0
    metric(E, shift, Z, T, shift)
    code, steps = nearest(center, T, walls, sides, qdd, multipliers)
    if code == INCOMPATIBLE:
        for j in range(n):
            qdd[j] = center[j]
        code = least_violation(walls[:free], sides[:free], W, bound, qdd)
        if code == DONE:
            code, steps = within_least_violation(walls, sides, W, E, T, bound, center, qdd, violation, multipliers)
    if code != DONE:
        return code, steps
    for j in range(n):
        qdd[j] = min(max(qdd[j], -bound), bound)
    strongest = 0.0
    for i in range(walls.shape[0]):
        strongest = max(strongest, multipliers[i])
    for i in range(free):
        slack[index[i]] = violation[i]
        unmet = unmet or violation[i] > 0.0
        acted[index[i]] = violation[i] > 0.0 or multipliers[i] > PULLING * strongest
    if not (finite(qdd) and finite(slack)):
        return ASK, steps
    return (RELAXED_ROWS if unmet else DONE), steps
