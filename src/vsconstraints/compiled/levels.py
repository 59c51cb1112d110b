"""Parts of the compiled resolver ``hierarchy``: metric of levels 2 and 3, freedom, and checks."""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array, BoolArray
from ..rows.tolerances import DEPENDENT, MET, MISSED, NEGLIGIBLE, RELAXED, SIGNIFICANT, STRICT
from .compiler import in_place, inner
from .least_distance import MULTIPLIER, NEW, POINT, SCALE
from .least_squares import CERTAIN, pseudoinverse
from .least_violation import GREATEST, LEAST
from .linear import (
    INVERSE,
    ONE,
    QR,
    START,
    add,
    apply,
    away,
    clip,
    constant,
    copy,
    dot,
    length,
    squared_length,
    squares,
)
from .scratch import blank, matrix
from .workspace import Scratch

#: Largest remaining gradient of levels 2 and 3, relative to the size of the cost in the metric of
#: √damping.
CHECKED = 1e-5
ROUNDED = 1e-13  #: Rounding error of the gradient, as a fraction of its terms.
#: Rows of the workspace X (8, n) behind those of :func:`nearest`: J†b, a point, and its offset from
#: J†b; number of rows.
CENTER = constant(5)
ORIGIN = constant(6)
OFFSET = constant(7)
ROWS_OF_X = constant(8)
#: Rows of the pull of the violations on each coordinate: the sum, and that of its magnitudes; their
#: number.
PULL = START
TERMS = ONE
ROWS_OF_PULL = constant(2)


@in_place
def stack(G: Array, damping: float, Z: Array, X: Array, R: Array, B: Array) -> None:
    """Write √damping [Z | offset] to the columns of R and G [Z | offset] / ‖G‖ to those of B.

    B (p + 1, k) stands below R. Rows of both arrays are columns of these matrices, those of
    √damping Z in the basis Z.
    """
    k = G.shape[0]
    n = X.shape[1]
    p = R.shape[1]
    norm = np.sqrt(squares(G, n))
    weight = np.sqrt(damping)
    # an empty Z stands for the identity
    reduced = Z.shape[0] > 0
    for j in range(p + 1):
        for i in range(p):
            R[j, i] = 0.0
    for j in range(p):
        R[j, j] = weight
        if reduced:
            along_basis = dot(Z, j, X, OFFSET, START, n)
            R[p, j] = weight * along_basis
    if not norm > 0.0:
        return
    for i in range(k):
        for j in range(p):
            entry = dot(G, i, Z, j, START, n) if reduced else G[i, j]
            B[j, i] = entry / norm
        of_offset = dot(G, i, X, OFFSET, START, n)
        B[p, i] = of_offset / norm


@inner
def write_metric(
    G: Array, damping: float, Z: Array, X: Array, metric: QR, scratch: Scratch
) -> None:
    """Express the cost of levels 2 and 3 as ½‖R y + r‖² up to a constant.

    The cost is ½‖G (offset + Z y)‖² / ‖G‖² + ½ damping ‖offset + Z y‖². The method is a Householder
    QR of the rows √damping I above those of G Z / ‖G‖. The reflection of column j changes only the
    j-th of the former rows, so that the work grows with the square of the number of columns.

    ``G`` (k, n) or wider is the task, without what counts as its null space. ``Z`` (p, n) is an
    orthonormal basis, or empty for the identity. The ``metric`` receives R, and r as a further
    column behind it (p + 1, p), but no reflections.
    """
    k = G.shape[0]
    R = metric.columns
    p = R.shape[1]
    B = blank(scratch, p + 1, k)
    stack(G, damping, Z, X, R, B)
    for j in range(p):
        # the reflection along (head, B[j]) leads column j to (−size, 0)
        squared_below = squared_length(B, j, START, k)
        size = np.sqrt(R[j, j] * R[j, j] + squared_below)
        head = R[j, j] + size
        for other in range(j + 1, p + 1):
            below = dot(B, j, B, other, START, k)
            product = head * R[other, j] + below
            scale = product / (size * head)
            R[other, j] -= scale * head
            add(B, other, -scale, B, j, START, k)
        R[j, j] = -size
        metric.scalars[INVERSE, j] = -1.0 / size


@inner
def settle(
    walls: Array,
    sides: Array,
    weights: Array,
    box: Array,
    X: Array,
    relaxed: Array,
    violation: Array,
    scratch: Scratch,
) -> Array:
    """Return equalities [A | 0] that all points of least violation share with X[ORIGIN].

    X[ORIGIN] is such a point. The rows ``walls`` (w, n) from m on are those of the box and have no
    ``weights`` (m,). ``relaxed`` (w,) receives sides that the point meets with a little room, since
    the rows may leave a set without interior. ``violation`` (m,) receives the excess over the
    ``sides`` if that is more than rounding.
    """
    w, n = walls.shape
    m = weights.size
    A = blank(scratch, m + n, n + 1)
    pull = blank(scratch, ROWS_OF_PULL, n)
    size = length(X, ORIGIN, n)
    at = 0
    for i in range(w):
        value = dot(walls, i, X, ORIGIN, START, n)
        norm = length(walls, i, n)
        room = norm * size + abs(sides[i])
        excess = value - sides[i]
        relaxed[i] = max(sides[i], value) + RELAXED * room
        if i < m and excess > SIGNIFICANT * room:
            violation[i] = excess
            weight = weights[i]
            for j in range(n):
                force = walls[i, j] * weight * weight * excess
                pull[PULL, j] += force
                pull[TERMS, j] += abs(force)
                A[at, j] = walls[i, j] / norm
            at += 1
    # if the violations pull a coordinate against the box, all points of least violation are at that
    # bound
    for j in range(n):
        x = X[ORIGIN, j]
        is_at_bound = x <= box[LEAST, j] or x >= box[GREATEST, j]
        is_pulled = abs(pull[PULL, j]) > SIGNIFICANT * pull[TERMS, j]
        if is_at_bound and is_pulled:
            A[at, j] = 1.0
            at += 1
    return A[:at]


@in_place
def gradient(G: Array, damping: float, X: Array, point: Array) -> tuple[float, float]:
    """Write the gradient of levels 2 and 3 at a point to X[NEW].

    Return the size of the cost there, and of the terms of the point.
    """
    n = point.shape[1]
    squared_norm = squares(G, n)
    residual_cost = 0.0
    squared_distance = 0.0
    terms = 0.0
    for j in range(n):
        X[NEW, j] = 0.0
    for i in range(G.shape[0]):
        residual = away(G, i, point, START, X, CENTER)
        scaled = residual / squared_norm if squared_norm > 0.0 else 0.0
        residual_cost += scaled * scaled * squared_norm
        add(X, NEW, scaled, G, i, START, n)
    for j in range(n):
        x = point[0, j]
        center = X[CENTER, j]
        distance = x - center
        squared_distance += distance * distance
        X[NEW, j] += damping * distance
        terms += abs(x) + abs(center)
    return np.sqrt(residual_cost + damping * squared_distance), terms


@in_place
def optimal(
    G: Array,
    damping: float,
    Z: Array,
    walls: Array,
    sides: Array,
    rows: Array,
    X: Array,
    point: Array,
) -> bool:
    """True if ``point`` (1, n) minimises levels 2 and 3, by its optimality conditions.

    The conditions are evaluated on the rows as they were given. With the gradient g, the
    multipliers μ and the rows a, the cost exceeds its minimum by at most ‖Zᵀ(g + Σ μ a)‖² / (2
    damping), if the rows with a multiplier are at their bounds. G, damping and Z are those of
    :func:`write_metric`; ``rows`` is the result of :func:`nearest` for the walls.
    """
    n = point.shape[1]
    p = Z.shape[0]
    cost, terms = gradient(G, damping, X, point)
    slackness = 0.0  # Σ μ |a x − c|, 0 at a minimum
    for i in range(walls.shape[0]):
        multiplier_of_unit_row = rows[MULTIPLIER, i]
        scale = rows[SCALE, i]
        if multiplier_of_unit_row > 0.0 and scale > 0.0:
            multiplier = multiplier_of_unit_row * scale
            add(X, NEW, multiplier, walls, i, START, n)
            room = sides[i] - dot(walls, i, point, START, START, n)
            norm = length(walls, i, n)
            terms += multiplier * norm
            rounding = ROUNDED * (norm * terms + abs(sides[i]))
            slackness += multiplier * max(0.0, abs(room) - rounding)
    # squared gradient in the directions that the basis leaves; all of them without a basis
    squared_rest = 0.0
    for d in range(p):
        along_basis = dot(X, NEW, Z, d, START, n)
        squared_rest += along_basis**2
    if p == 0:
        squared_rest = squared_length(X, NEW, START, n)
    allowed = CHECKED * np.sqrt(damping) * cost + ROUNDED * terms
    is_stationary = np.sqrt(squared_rest) <= allowed
    is_complementary = slackness <= CHECKED * cost * cost
    return bool(is_stationary and is_complementary)


@in_place
def damped(G: Array, X: Array, point: Array) -> bool:
    """True if the damping may have increased the residual of level 2 at the point."""
    n = point.shape[1]
    squared_residual = 0.0
    squared_distance = 0.0
    squared_size = 0.0
    for i in range(G.shape[0]):
        residual = away(G, i, point, START, X, CENTER)
        squared_residual += residual * residual
    for j in range(n):
        x = point[0, j]
        distance = x - X[CENTER, j]
        squared_distance += distance**2
        squared_size += x**2
    norm = np.sqrt(squares(G, n))
    rounding = MET * np.sqrt(squared_size)
    tolerated = norm * (STRICT * np.sqrt(squared_distance) + rounding)
    increased: bool = np.sqrt(squared_residual) > tolerated
    return increased


@in_place
def meets(walls: Array, sides: Array, violation: Array, point: Array) -> bool:
    """True if the point meets all rows except the violated ones.

    The check detects rounding errors of a long step. The point must be in the box; only the rows of
    constraints are checked.
    """
    n = point.shape[1]
    size = length(point, START, n)
    for i in range(violation.size):
        norm = length(walls, i, n)
        excess = dot(walls, i, point, START, START, n) - sides[i]
        allowed = MISSED * (norm * size + abs(sides[i])) + NEGLIGIBLE * norm
        if violation[i] == 0.0 and not excess <= allowed:
            return False
    return True


@in_place
def with_room(walls: Array, sides: Array, point: Array) -> None:
    """Relax the sides so that the point meets them, with room for rounding."""
    n = point.shape[1]
    size = length(point, START, n)
    for i in range(walls.shape[0]):
        if sides[i] < math.inf:
            room = MET * (length(walls, i, n) * size + abs(sides[i]))
            value = dot(walls, i, point, START, START, n)
            sides[i] = max(sides[i], value) + room


@inner
def join(E: Array, walls: Array, held: BoolArray, G: Array, scratch: Scratch) -> Array:
    """Return rows of E, held walls and task, of unit norm, as [A | 0]."""
    n = walls.shape[1]
    at = E.shape[0]
    most = at + walls.shape[0] + G.shape[0]
    A = blank(scratch, most, n + 1)
    for i in range(at):
        copy(A, i, E, i, n)
    for i in range(walls.shape[0]):
        if held[i]:
            add(A, at, 1.0 / length(walls, i, n), walls, i, START, n)
            at += 1
    size = np.sqrt(squares(G, n))
    if size > 0.0:
        for i in range(G.shape[0]):
            add(A, at, 1.0 / size, G, i, START, n)
            at += 1
    return A[:at]


@in_place
def start_from(X: Array, point: Array, box: Array, qdd: Array) -> None:
    """Clip the point to the box, and make it the next stage's origin and the current answer."""
    for j in range(qdd.size):
        x = clip(point[0, j], box[LEAST, j], box[GREATEST, j])
        qdd[j] = x
        X[ORIGIN, j] = x
        X[OFFSET, j] = x - X[CENTER, j]


@inner
def columns_of_q(qr: QR, rank: int, first: int, last: int, scratch: Scratch) -> Array:
    """Return columns [first, last) of Q of :func:`.pseudoinverse` as rows.

    The first ``rank`` columns span the rows, the others the null space.
    """
    Q = blank(scratch, last - first, qr.columns.shape[1])
    for d in range(last - first):
        Q[d, first + d] = 1.0
        apply(qr, rank, Q, d)
    return Q


@inner
def find_freedom(equal: Array, X: Array, from_center: bool, scratch: Scratch) -> tuple[Array, int]:
    """Return an orthonormal basis (p, n) of the null space of equalities [A | 0], and p.

    Without equalities the basis is empty and p = n. The center is then taken as the origin if
    ``from_center``.
    """
    n = X.shape[1]
    if equal.shape[0] == 0:
        if from_center:
            for j in range(n):
                X[ORIGIN, j] = X[CENTER, j]
                X[OFFSET, j] = 0.0
        return matrix(scratch, START, n), n
    certain = CERTAIN * DEPENDENT
    qr, rank, _ = pseudoinverse(equal, START, certain, DEPENDENT, equal, X, POINT, scratch)
    basis = columns_of_q(qr, rank, rank, n, scratch)
    return basis, n - rank


@in_place
def place(Z: Array, p: int, box: Array, X: Array, point: Array) -> None:
    """Write origin + Z y, clipped to the box, to the point; y is in X[POINT]."""
    n = X.shape[1]
    if p == n:
        # the basis is the identity
        copy(point, START, X, POINT, n)
    else:
        for j in range(n):
            point[0, j] = 0.0
        for d in range(p):
            add(point, START, X[POINT, d], Z, d, START, n)
    for j in range(n):
        x = X[ORIGIN, j] + point[0, j]
        point[0, j] = clip(x, box[LEAST, j], box[GREATEST, j])
