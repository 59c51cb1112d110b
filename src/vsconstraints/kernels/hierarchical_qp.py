"""The hierarchical quadratic program, compiled: rows, task and least acceleration with strict priorities."""

from __future__ import annotations

import math

import numpy as np

from ..qp.lexicographic import DEPENDENT, MET, MISSED, NEGLIGIBLE, PULLING, RELAXED, SIGNIFICANT, ZERO_GRADIENT
from ..rows import Array, BoolArray
from .compiler import compiled, inner
from .least_distance import FAILED, INCOMPATIBLE, MULTIPLIER, POINT, SIDE, nearest
from .least_squares import CERTAIN, pseudoinverse
from .least_violation import least_violation
from .linear import ASK, DONE, S_ROWS, START, add, apply, constant, copy, dot, finite
from .task_priority import OUTPUT_SIGNATURE, ROWS_SIGNATURE, TASK_SIGNATURE, valid

RELAXED_ROWS = 4
"""The outputs hold the answer; some demands are unmet."""


CENTER, ORIGIN, OFFSET, ROWS_OF_X = constant(5), constant(6), constant(7), constant(8)
"""Rows of the work space behind those of :func:`nearest`: J†b, a point, and the way to it; and how many there are."""


@inner
def metric(G: Array, damping: float, Z: Array, X: Array, R: Array, S: Array) -> None:
    """Levels 2 and 3, ½‖G (offset + Z y)‖² / ‖G‖² + ½ damping ‖offset + Z y‖², as ½‖R y + r‖² up to a constant.

    Householder QR of the rows √damping I above those of G Z / ‖G‖: the reflection of column j leaves all of the former
    but the j-th alone, so that the work grows with the square of the number of columns.

    Parameters
    ----------
    G
        (k, n) or more columns: the task, without what counts as its null space.
    Z
        (p, n): an orthonormal basis by columns, or none: the identity.
    X
        (8, n), with the row ``OFFSET``.
    R, S
        (p + 1, p) and (3, p) outputs: R by columns with r as the last one, and the inverses of the diagonal.
    """
    k, n, p = G.shape[0], X.shape[1], R.shape[1]
    reduced = Z.shape[0] > 0
    B = np.zeros((p + 1, k))
    size = 0.0
    for i in range(k):
        size += dot(G, i, G, i, START, n)
    for j in range(p + 1):
        for i in range(p):
            R[j, i] = 0.0
        if j < p:
            R[j, j] = math.sqrt(damping)
        elif reduced:
            for i in range(p):
                R[p, i] = math.sqrt(damping) * dot(Z, i, X, OFFSET, START, n)
        if size > 0.0:
            for i in range(k):
                if j < p:
                    B[j, i] = (dot(G, i, Z, j, START, n) if reduced else G[i, j]) / math.sqrt(size)
                else:
                    B[j, i] = dot(G, i, X, OFFSET, START, n) / math.sqrt(size)
    for j in range(p):
        length = math.sqrt(R[j, j] * R[j, j] + dot(B, j, B, j, START, k))
        head = R[j, j] + length
        for other in range(j + 1, p + 1):
            scale = (head * R[other, j] + dot(B, j, B, other, START, k)) / (length * head)
            R[other, j] -= scale * head
            add(B, other, -scale, B, j, START, k)
        R[j, j] = -length
        S[0, j] = -1.0 / length


@inner
def settle(
    walls: Array, sides: Array, weights: Array, bound: float, X: Array, relaxed: Array, violation: Array
) -> Array:
    """What every point that violates least has in common with a given one: rows A of equalities, as [A | 0].

    Parameters
    ----------
    walls, sides
        (w, n) and (w,).
    weights
        (m,) of level 1; the rows of the box, from m on, have none.
    bound
        Half the width of the box.
    X
        (8, n): its row ``ORIGIN`` is a point that violates least.
    relaxed, violation
        (w,) and (m,) outputs: sides that the point meets, with a little room, since the rows may leave a set without
        interior; and what it exceeds the given ones by, where that is more than rounding.
    """
    w, n = walls.shape
    m = weights.size
    A, pull = np.zeros((m + n, n + 1)), np.zeros((S_ROWS, n))
    length = math.sqrt(dot(X, ORIGIN, X, ORIGIN, START, n))
    at = 0
    for i in range(w):
        value = dot(walls, i, X, ORIGIN, START, n)
        size = math.sqrt(dot(walls, i, walls, i, START, n))
        room = size * length + abs(sides[i])
        relaxed[i] = max(sides[i], value) + RELAXED * room
        if i < m and value - sides[i] > SIGNIFICANT * room:
            violation[i] = value - sides[i]
            for j in range(n):
                force = walls[i, j] * weights[i] * weights[i] * violation[i]
                pull[0, j] += force
                pull[1, j] += abs(force)
                A[at, j] = walls[i, j] / size
            at += 1
    # where the violations pull a coordinate against the box, every point that violates least has it at that bound
    for j in range(n):
        if abs(pull[0, j]) > SIGNIFICANT * pull[1, j] and abs(X[ORIGIN, j]) >= bound:
            A[at, j] = 1.0
            at += 1
    return A[:at]


INPUT_SIGNATURE = f"{ROWS_SIGNATURE}, {TASK_SIGNATURE}, float64, boolean, float64, float64[::1], float64, float64"
"""Signature of the tolerance, the form of the rows, α, weights, box and damping."""


@compiled(f"UniTuple(int64, 2)({INPUT_SIGNATURE}, float64[::1], {OUTPUT_SIGNATURE})")
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
    k = J.shape[0]
    G, X = np.empty((k, n + 1)), np.zeros((ROWS_OF_X, n))
    for i in range(k):
        copy(G, i, J, i, n)
        G[i, n] = b[i]
    pseudoinverse(G, START, CERTAIN * tolerance, tolerance, G, X, CENTER)
    # demands A q̈ ≤ c of the rows that have any
    c, fixed = np.empty(m), np.zeros(m, np.bool_)
    below = within = tracks = True
    for j in range(n):
        qdd[j] = X[ORIGIN, j] = X[CENTER, j]
        within = within and abs(qdd[j]) <= bound
    length = math.sqrt(dot(X, CENTER, X, CENTER, START, n))
    free = 0
    for i in range(m):
        acted[i] = barrier or phi[i] >= 0.0
        slack[i] = 0.0
        if acted[i]:
            c[i] = -alpha * phi[i] - Lf[i] if barrier else -gain[i]
            size = math.sqrt(dot(Lg, i, Lg, i, START, n))
            excess = dot(Lg, i, X, CENTER, START, n) - c[i]
            fixed[i] = size <= ZERO_GRADIENT * scale[i]
            below = below and excess <= 0.0
            tracks = tracks and (c[i] >= 0.0 if fixed[i] else excess <= MET * (size * length + abs(c[i])))
            free += not fixed[i]
    if within and (below or tracks):
        for i in range(m):
            acted[i] = False
        return (DONE if finite(qdd) else ASK), 0

    w = free + (2 * n if bound < math.inf else 0)
    walls, sides, W, index = np.zeros((w, n)), np.empty(w), np.empty(free), np.empty(free, np.int64)
    relaxed, violation, rows = np.empty(w), np.empty(free), np.empty((S_ROWS, w))
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
                copy(walls, at, Lg, i, n)
                at += 1
    for i in range(free, w):
        j = i - free
        walls[i, j % n] = 1.0 if j < n else -1.0
        sides[i] = bound

    # x = origin + Z y, in all directions first, and if that is in vain in those which the least violations leave
    Z, p, steps = np.empty((START, n)), n, 0
    for relaxing in range(2):
        if relaxing == 1:
            code = least_violation(walls[:free], sides[:free], W, bound, qdd)
            if code != DONE:
                return code, steps
            for j in range(n):
                X[ORIGIN, j] = qdd[j]
                X[OFFSET, j] = qdd[j] - X[CENTER, j]
            A = settle(walls, sides, W, bound, X, relaxed, violation)
            if A.shape[0] == 0:
                for j in range(n):
                    X[ORIGIN, j], X[OFFSET, j] = X[CENTER, j], 0.0
            else:
                F, T, rank, _ = pseudoinverse(A, START, CERTAIN * DEPENDENT, DEPENDENT, A, X, POINT)
                p = n - rank
                if p == 0:
                    steps = 0
                    break
                Z = np.zeros((p, n))
                for d in range(p):
                    Z[d, rank + d] = 1.0
                    apply(F, T, rank, Z, d)
        H, R, T = np.empty((p, w)), np.empty((p + 1, p)), np.empty((S_ROWS, p))
        for i in range(w):
            outside = 0.0
            for d in range(p):
                H[d, i] = walls[i, d] if p == n else dot(walls, i, Z, d, START, n)
                outside += H[d, i] * H[d, i]
            side = (relaxed[i] if relaxing == 1 else sides[i]) - dot(walls, i, X, ORIGIN, START, n)
            if not abs(side) < math.inf:
                return FAILED, 0
            if p < n:
                # rows within the span of the violated ones are settled
                settled = outside <= DEPENDENT * DEPENDENT * dot(walls, i, walls, i, START, n)
                if settled or (i < free and violation[i] > 0.0):
                    side = math.inf
            rows[SIDE, i] = side
        metric(G, damping, Z, X, R, T)
        code, steps = nearest(H, rows, R, T, X)
        if code != INCOMPATIBLE:
            break
    if code != DONE:
        return (FAILED if code == INCOMPATIBLE else code), steps
    for j in range(n):
        value = X[POINT, j] if p == n else 0.0
        if p < n:
            for d in range(p):
                value += X[POINT, d] * Z[d, j]
        qdd[j] = min(max(X[ORIGIN, j] + value, -bound), bound)
    strongest = length = 0.0
    for i in range(w):
        strongest = max(strongest, rows[MULTIPLIER, i])
    for j in range(n):
        length += qdd[j] * qdd[j]
    length = math.sqrt(length)
    for i in range(free):
        at = index[i]
        excess = -sides[i]
        for j in range(n):
            excess += walls[i, j] * qdd[j]
        if violation[i] > 0.0:
            violation[i] = max(0.0, excess)
        elif excess > 0.0:
            # what was checked is relative to the way from the minimiser without rows, which may be very long
            size = math.sqrt(dot(walls, i, walls, i, START, n))
            if excess > MISSED * (size * length + abs(sides[i])) + NEGLIGIBLE * size:
                return FAILED, steps
        slack[at] = violation[i]
        unmet = unmet or violation[i] > 0.0
        acted[at] = violation[i] > 0.0 or rows[MULTIPLIER, i] > PULLING * strongest
    if not (finite(qdd) and finite(slack)):
        return ASK, steps
    return (RELAXED_ROWS if unmet else DONE), steps
