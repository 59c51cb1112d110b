"""Parts of the resolver ``hierarchy``, compiled: metric of lower levels, what level 1 leaves them, and the check."""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array, BoolArray
from ..rows.tolerances import MET, MISSED, NEGLIGIBLE, RELAXED, SIGNIFICANT, STRICT
from .compiler import inner
from .least_distance import MULTIPLIER, NEW, SCALE
from .least_violation import GREATEST, LEAST
from .linear import S_ROWS, START, add, constant, copy, dot
from .scratch import blank
from .structures import Scratch

CHECKED = 1e-5
"""Largest rest of the gradient of levels 2 and 3, as a fraction of the size of the cost in the metric of √damping."""

ROUNDED = 1e-13
"""What rounding leaves of the gradient, as a fraction of its terms."""

CENTER, ORIGIN, OFFSET, ROWS_OF_X = constant(5), constant(6), constant(7), constant(8)
"""Rows of the work space behind those of :func:`nearest`: J†b, a point, and the way to it; and how many there are."""


@inner
def metric(G: Array, damping: float, Z: Array, X: Array, R: Array, S: Array, scratch: Scratch) -> None:
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
    scratch
        For use here.
    """
    k, n, p = G.shape[0], X.shape[1], R.shape[1]
    reduced = Z.shape[0] > 0
    B = blank(scratch, p + 1, k)
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
def settle(walls: Array, sides: Array, weights: Array, box: Array, X: Array, relaxed: Array, violation: Array) -> Array:
    """What every point that violates least has in common with a given one: rows A of equalities, as [A | 0].

    Parameters
    ----------
    walls, sides
        (w, n) and (w,).
    weights
        (m,) of level 1; the rows of the box, from m on, have none.
    box
        (2, n) least and greatest x.
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
        pinned = X[ORIGIN, j] <= box[LEAST, j] or X[ORIGIN, j] >= box[GREATEST, j]
        if pinned and abs(pull[0, j]) > SIGNIFICANT * pull[1, j]:
            A[at, j] = 1.0
            at += 1
    return A[:at]


@inner
def optimal(
    G: Array, damping: float, Z: Array, walls: Array, sides: Array, rows: Array, X: Array, point: Array
) -> bool:
    """Whether this is the minimiser of levels 2 and 3, by its optimality conditions, on the rows as they were given.

    With the gradient g, the multipliers μ and the rows a, its cost exceeds the least one by no more than
    ‖Z ᵀ(g + Σ μ a)‖² / (2 damping), if the rows with a multiplier are at their bounds.

    Parameters
    ----------
    G, damping, Z
        As for :func:`metric`.
    walls, sides, rows
        (w, n), (w,), and what :func:`nearest` made of them.
    X
        (8, n), with the row ``CENTER``; its row ``NEW`` is for use here.
    point
        (1, n) the answer.
    """
    k, n, w, p = G.shape[0], point.shape[1], walls.shape[0], Z.shape[0]
    size = cost = away = 0.0
    for j in range(n):
        X[NEW, j] = 0.0
    for i in range(k):
        size += dot(G, i, G, i, START, n)
    for i in range(k):
        along = 0.0
        for j in range(n):
            along += G[i, j] * (point[0, j] - X[CENTER, j])
        along = along / size if size > 0.0 else 0.0
        cost += along * along * size
        add(X, NEW, along, G, i, START, n)
    for j in range(n):
        way = point[0, j] - X[CENTER, j]
        away += way * way
        X[NEW, j] += damping * way
    cost = math.sqrt(cost + damping * away)
    terms = 0.0
    for j in range(n):
        terms += abs(point[0, j]) + abs(X[CENTER, j])
    loose = 0.0
    for i in range(w):
        if rows[MULTIPLIER, i] > 0.0 and rows[SCALE, i] > 0.0:
            force = rows[MULTIPLIER, i] * rows[SCALE, i]
            add(X, NEW, force, walls, i, START, n)
            room = sides[i] - dot(walls, i, point, START, START, n)
            length = math.sqrt(dot(walls, i, walls, i, START, n))
            terms += force * length
            loose += force * max(0.0, abs(room) - ROUNDED * (length * terms + abs(sides[i])))
    rest = 0.0
    if p > 0:
        for d in range(p):
            rest += dot(X, NEW, Z, d, START, n) ** 2
    else:
        rest = dot(X, NEW, X, NEW, START, n)
    return math.sqrt(rest) <= CHECKED * math.sqrt(damping) * cost + ROUNDED * terms and loose <= CHECKED * cost * cost


@inner
def damped(G: Array, X: Array, point: Array) -> bool:
    """Whether the damping may have cost the point a residual that level 2 by itself does not have."""
    n = point.shape[1]
    size = residual = away = length = 0.0
    for i in range(G.shape[0]):
        along = 0.0
        for j in range(n):
            along += G[i, j] * (point[0, j] - X[CENTER, j])
        residual += along * along
        size += dot(G, i, G, i, START, n)
    for j in range(n):
        away += (point[0, j] - X[CENTER, j]) ** 2
        length += point[0, j] ** 2
    return math.sqrt(residual) > math.sqrt(size) * (STRICT * math.sqrt(away) + MET * math.sqrt(length))


@inner
def meets(walls: Array, sides: Array, violation: Array, point: Array) -> bool:
    """Whether the point meets all rows but the violated ones, and the box: whatever rounding did on a long way."""
    n = point.shape[1]
    length = math.sqrt(dot(point, START, point, START, START, n))
    for i in range(violation.size):
        size = math.sqrt(dot(walls, i, walls, i, START, n))
        excess = dot(walls, i, point, START, START, n) - sides[i]
        if violation[i] == 0.0 and not excess <= MISSED * (size * length + abs(sides[i])) + NEGLIGIBLE * size:
            return False
    return True


@inner
def with_room(walls: Array, sides: Array, point: Array) -> None:
    """Make the sides some that the point meets, with room for rounding."""
    n = point.shape[1]
    length = math.sqrt(dot(point, START, point, START, START, n))
    for i in range(walls.shape[0]):
        if sides[i] < math.inf:
            size = math.sqrt(dot(walls, i, walls, i, START, n))
            sides[i] = max(sides[i], dot(walls, i, point, START, START, n)) + MET * (size * length + abs(sides[i]))


@inner
def join(E: Array, walls: Array, held: BoolArray, G: Array) -> Array:
    """Rows of E, the walls that are held, and the task, of unit norm, as [A | 0]."""
    n = walls.shape[1]
    A = np.zeros((E.shape[0] + walls.shape[0] + G.shape[0], n + 1))
    at, size = E.shape[0], 0.0
    for i in range(at):
        copy(A, i, E, i, n)
    for i in range(walls.shape[0]):
        if held[i]:
            add(A, at, 1.0 / math.sqrt(dot(walls, i, walls, i, START, n)), walls, i, START, n)
            at += 1
    for i in range(G.shape[0]):
        size += dot(G, i, G, i, START, n)
    for i in range(G.shape[0]):
        if size > 0.0:
            add(A, at, 1.0 / math.sqrt(size), G, i, START, n)
            at += 1
    return A[:at]
