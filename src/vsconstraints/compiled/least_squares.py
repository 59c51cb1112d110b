"""Least squares and task priority, compiled, with decisions about ranks.

Where full rank can be proved, by the norm of an inverse, the answer is by Householder reflections.
Elsewhere singular values are computed, by Jacobi rotations of as few rows as there are: what rows
leave of the task of a redundant arm loses ranks by construction.
"""

from __future__ import annotations

import math

from ..rows import Array
from . import linear as la
from .compiler import in_place, inner
from .linear import ONE, S_ROWS, START, WORK
from .scratch import blank, matrix
from .workspace import Scratch

CERTAIN = 30.0
"""Full rank is certain if the bound of the least singular value exceeds the tolerance by this
factor.

1 would do for the rank. More keeps the fast way to matrices for which it is as accurate as singular
values are.
"""

#: Least singular value, over the norm, with which triangular factors alone are accurate, whatever
#: the tolerance.
WELL = 1e-4
#: Square of the answer over that of J†b below which :func:`bring` has lost digits.
CANCELLED = 1e-6
SWEEPS = 60  #: Jacobi sweeps at most; some six are usual.


@in_place
def rotate(X: Array, p: int, q: int, first: int, last: int, negligible: float) -> bool:
    """Make two rows orthogonal in the columns from ``first`` to ``last`` by one rotation; whether
    there was need.
    """
    a = la.dot(X, p, X, p, first, last)
    b = la.dot(X, q, X, q, first, last)
    d = la.dot(X, p, X, q, first, last)
    # a row of rounding alone has no direction to get right
    if min(a, b) <= negligible or abs(d) <= 2e-16 * (last - first) * math.sqrt(a) * math.sqrt(b):
        return False
    z = (b - a) / (2.0 * d)
    t = math.copysign(1.0, z) / (abs(z) + math.sqrt(1.0 + z * z))
    c = 1.0 / math.sqrt(1.0 + t * t)
    for i in range(first, X.shape[1]):
        u = X[p, i]
        X[p, i] = c * (u - t * X[q, i])
        X[q, i] = c * (t * u + X[q, i])
    return True


@in_place
def orthogonalise(X: Array, rows: int, first: int, last: int) -> float:
    """Turn the first rows of X, by an orthogonal matrix from the left, into ones orthogonal in
    columns [first, last).

    All columns from ``first`` on are turned alike. The lengths of the rows within these columns are
    then the singular values of that part of X; returns the largest. One-sided Jacobi rotations.
    """
    total = largest = 0.0
    for i in range(rows):
        total += la.dot(X, i, X, i, first, last)
    for _ in range(SWEEPS):
        turned = False
        for p in range(rows - 1):
            for q in range(p + 1, rows):
                turned |= rotate(X, p, q, first, last, 1e-30 * total)
        if not turned:
            break
    for i in range(rows):
        largest = max(largest, la.dot(X, i, X, i, first, last))
    return math.sqrt(largest)


@inner
def largest_of_whole(
    W: Array, rows: int, first: int, tolerance: float, whole: Array, scale: float, X: Array
) -> float:
    """The greatest singular value of ``whole`` over scale, or its norm where that serves as well; X
    (n, n) is blank.
    """
    n = W.shape[1] - 1
    size = 0.0
    for i in range(whole.shape[0]):
        for j in range(n):
            size += (whole[i, j] / scale) ** 2
    for i in range(rows):
        # the square of the greatest singular value is between ‖whole‖_F² / n and that: which one
        # seldom matters
        gain = la.dot(W, i, W, i, first, n) / (tolerance * tolerance)
        if 0.99 * size <= n * gain and gain <= 1.01 * size:
            # it is the greatest singular value of wholeᵀ whole, of which this matrix keeps all
            # digits
            for a in range(whole.shape[0]):
                for b in range(n):
                    for j in range(n):
                        X[b, j] += (whole[a, b] / scale) * (whole[a, j] / scale)
            return math.sqrt(orthogonalise(X, n, START, n))
    return math.sqrt(size)


@inner
def shorten(
    W: Array, rows: int, first: int, tolerance: float, whole: Array, scratch: Scratch
) -> int:
    """Make the first rows of :func:`pseudoinverse` orthogonal and drop those too short; how many
    are left.
    """
    n = W.shape[1] - 1
    scale = 0.0
    left = 0
    # the squares of very small numbers would vanish
    for i in range(whole.shape[0]):
        for j in range(n):
            scale = max(scale, abs(whole[i, j]))
    scale = scale if scale > 0.0 else 1.0
    for i in range(rows):
        for j in range(first, n + 1):
            W[i, j] /= scale
    largest = orthogonalise(W, rows, first, n)
    if first > 0:
        largest = largest_of_whole(W, rows, first, tolerance, whole, scale, blank(scratch, n, n))
    for i in range(rows):
        kept = math.sqrt(la.dot(W, i, W, i, first, n)) > tolerance * largest
        for j in range(first, n + 1):
            value = W[i, j] if kept else 0.0
            W[i, j] = 0.0
            W[left, j] = value
        left += kept
    return left


@in_place
def triangular(W: Array, first: int, F: Array, S: Array) -> None:
    """[M | b] ← [R | Qᵀb] of the QR in F and S, with Qᵀb in S[WORK]."""
    p = F.shape[0]
    for i in range(W.shape[0]):
        for j in range(p):
            W[i, first + j] = F[j, i] if i < j else 0.0
        if i < p:
            W[i, first + i] = 1.0 / S[0, i]
            W[i, first + p] = S[WORK, i]


@inner
def pseudoinverse(
    W: Array,
    first: int,
    certain: float,
    tolerance: float,
    whole: Array,
    Y: Array,
    row: int,
    scratch: Scratch,
) -> tuple[Array, Array, int, float]:
    """Solve y ← M† b for W = [· | M | b] (k, n + 1), M beginning with the column ``first``; y is
    Y[row, first:].

    QR of M (k, p), or of Mᵀ where it has more columns than rows. Unless that proves full rank, the
    rows of [M | b], or of [R | Qᵀb] where k ≥ p, are turned until those of M are orthogonal. Those
    that are too short are dropped: they are left zero. The others have full rank, and the same M†
    b.

    W is used up: M stays if its rank is full for certain, its least singular value above
    ``certain`` times ‖whole‖_F, and is otherwise replaced by a matrix with the same MᵀM up to a
    factor, apart from singular values below the ``tolerance`` times the largest one of ``whole``
    (k', n), which is W where ``first`` is 0.

    Returns F, S and the rank; where this is less than p, its number of columns of Q of
    :func:`factor` span the rows of M. Then a lower bound of its least singular value above that,
    negative where F and S are not the QR of M itself.
    """
    k = W.shape[0]
    n = W.shape[1] - 1
    p = n - first
    rows = k
    tall = k >= n - first
    size = math.sqrt(la.squares(whole, n))
    S = matrix(scratch, S_ROWS, k if tall else p)
    for again in range(2):
        c = p if tall else rows
        F = matrix(scratch, c, k if tall else p)
        for j in range(c):
            for i in range(F.shape[1]):
                F[j, i] = W[i, first + j] if tall else W[j, first + i]
        least = la.factor(F, S)
        for i in range(p):
            S[WORK, i] = 0.0
        for i in range(rows):
            S[WORK, i] = W[i, n]
        if tall:
            la.apply_transposed(F, S, p, S, WORK)
        if again == 1 or least > certain * size:
            break
        if tall:
            triangular(W, first, F, S)
        rows = shorten(W, c, first, tolerance, whole, scratch)
        tall = False
    if tall:
        la.solve_upper(F, S, p, S, WORK)
    else:
        la.solve_lower(F, S, rows, S, WORK)
        la.apply(F, S, rows, S, WORK)
    for j in range(p):
        Y[row, first + j] = S[WORK, j]
    return F, S, c, least if tall else -least


@inner
def resolve(
    A1: Array, A2: Array, b2: Array, tolerance: float, rest: Array, qdd: Array, scratch: Scratch
) -> tuple[int, Array, Array, float]:
    """q̈ ← A₁†b₁ + (A₂(I − A₁†A₁))†(b₂ − A₂A₁†b₁), eq. (15); with q̈₀ all of it for q̈ − q̈₀, b₁ −
    A₁q̈₀ and b₂ − A₂q̈₀.

    ``A1`` (b, n + 1) is [A₁ | b₁], b ≥ 0, and used up; ``A2``, ``b2`` are (k, n) and (k,); ``rest``
    is q̈₀ (n,) or (0,). Singular values below the tolerance times the largest one count as zero.
    Returns the rank of A₁; and F, S and the bound of :func:`pseudoinverse` for what it leaves of
    A₂: all, without A₁.
    """
    n = qdd.size
    k = A2.shape[0]
    W: Array = matrix(scratch, k, n + 1)
    Y = blank(scratch, WORK, n)
    F = W
    S = W
    rank = START
    G = W
    T = W
    least = 0.0
    for i in range(A1.shape[0] if rest.size > 0 else 0):
        for j in range(n):
            A1[i, n] -= A1[i, j] * rest[j]
    if A1.shape[0] > 0:
        F, S, rank, _ = pseudoinverse(
            A1, START, CERTAIN * tolerance, tolerance, A1, Y, START, scratch
        )
    if rank < n:
        for i in range(k):
            W[i, n] = b2[i]
            for j in range(n):
                W[i, j] = A2[i, j]
                W[i, n] -= A2[i, j] * Y[0, j]
            for j in range(rest.size):
                W[i, n] -= A2[i, j] * rest[j]
            if rank > 0:
                la.apply_transposed(F, S, rank, W, i)
        whole = A2 if rank > 0 else W
        G, T, _, least = pseudoinverse(
            W, rank, CERTAIN * tolerance, tolerance, whole, Y, ONE, scratch
        )
        la.apply(F, S, rank, Y, ONE)
    for j in range(n):
        qdd[j] = Y[0, j] + Y[1, j]
    for j in range(rest.size):
        qdd[j] += rest[j]
    return rank, G, T, least


@inner
def bring(
    F: Array, S: Array, least: float, A: Array, tolerance: float, qdd: Array, scratch: Scratch
) -> bool:
    """Bring x = J†b to A x = d with the least change of ‖J x − b‖: x ← x + R⁻¹ (A R⁻¹)† (d − A x),
    with J = Q R.

    Where J has full column rank, :func:`resolve` of A before J comes to the same. F, S and
    ``least`` are those of J of :func:`resolve`; ``A`` (b, n + 1) is [A | d]. Returns False, with
    nothing done, unless J and A have full rank for certain, A fewer rows than columns, and J†b is
    not much larger than the answer.
    """
    n = qdd.size
    b = A.shape[0]
    if b >= n or least <= 0.0:
        return False
    L = matrix(scratch, b, n)
    T = matrix(scratch, S_ROWS, n)
    size = 0.0
    for i in range(b):
        la.copy(L, i, A, i, n)
        for j in range(n):
            size += A[i, j] * A[i, j]
        la.solve_lower(F, S, n, L, i)
    if not la.factor(L, T) * least > max(CERTAIN * tolerance, WELL) * math.sqrt(size):
        return False
    for i in range(n):
        T[WORK, i] = 0.0
    for i in range(b):
        T[WORK, i] = A[i, n]
        for j in range(n):
            T[WORK, i] -= A[i, j] * qdd[j]
    la.solve_lower(L, T, b, T, WORK)
    la.apply(L, T, b, T, WORK)
    la.solve_upper(F, S, n, T, WORK)
    before = after = 0.0
    for j in range(n):
        T[WORK, j] += qdd[j]
        before += qdd[j] * qdd[j]
        after += T[WORK, j] * T[WORK, j]
    # what cancels leaves its rounding
    if after < CANCELLED * before:
        return False
    for j in range(n):
        qdd[j] = T[WORK, j]
    return True
