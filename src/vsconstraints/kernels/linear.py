"""Exact small linear algebra, compiled: least squares and task priority with the rank decisions of the definition.

Matrices are stored by columns: row j of an array ``F`` is column j of the matrix. Where full rank can be proved, by the
norm of an inverse, an answer by Householder reflections is that of the definition by singular values; elsewhere
singular values are computed, by one-sided Jacobi rotations.
"""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array
from .compiler import inner

DONE = 0
"""The outputs hold the answer."""

ASK = 1
"""Not for this function: ask the definition."""

CERTAIN = 30.0
"""Full rank is certain if the bound of the least singular value exceeds the tolerance by this factor.

1 would do for the rank. More keeps the fast way to matrices for which it is as accurate as singular values are.
"""

SWEEPS = 60
"""Jacobi sweeps at most; some six are usual."""


@inner
def finite(x: Array) -> bool:
    """Whether every number of a contiguous array is finite."""
    flat = x.reshape(x.size)
    wrong = 0
    for i in range(flat.size):
        wrong |= not abs(flat[i]) < math.inf
    return wrong == 0


@inner
def positive(x: Array) -> bool:
    """Whether every number of a vector is positive and finite."""
    wrong = 0
    for i in range(x.size):
        wrong |= not (0.0 < x[i] < math.inf)
    return wrong == 0


@inner
def dot(x: Array, y: Array, first: int, last: int) -> float:
    """Σ x y from entry ``first`` up to ``last``."""
    total = 0.0
    for i in range(first, last):
        total += x[i] * y[i]
    return total


@inner
def norm(x: Array) -> float:
    """‖x‖₂, or the Frobenius norm of a contiguous matrix."""
    flat = x.reshape(x.size)
    return math.sqrt(dot(flat, flat, 0, flat.size))


@inner
def factor(F: Array, S: Array) -> None:
    """Householder QR in place of the (r, c) matrix with the columns F (c, r), c ≤ r.

    Entry i < j of F[j] is R[i, j]; the rest of F[j] is the vector v of the reflection I − beta v vᵀ. S (2, c) gets
    the inverses of the diagonal of R, and beta.
    """
    for j in range(F.shape[0]):
        make_reflection(F, S, j)
        for other in range(j + 1, F.shape[0]):
            reflect(F, j, S[1, j], F, other)


@inner
def make_reflection(F: Array, S: Array, j: int) -> None:
    """Turn F[j], which the reflections before have been applied to, into the j-th column of R and its reflection."""
    squared = 0.0
    for i in range(j, F.shape[1]):
        squared += F[j, i] * F[j, i]
    size = math.sqrt(squared)
    head = F[j, j]
    beta = 1.0 / (size * (size + abs(head)))
    if size == 0.0:
        S[0, j] = math.inf
        beta = 0.0
    elif head > 0.0:
        F[j, j] = head + size
        S[0, j] = -beta * (size + head)
    else:
        F[j, j] = head - size
        S[0, j] = beta * (size - head)
    S[1, j] = beta


@inner
def reflect(F: Array, j: int, beta: float, X: Array, row: int) -> None:
    """Reflect a row of X by the j-th reflection of :func:`factor`."""
    last = F.shape[1]
    scale = 0.0
    for i in range(j, last):
        scale += F[j, i] * X[row, i]
    scale *= beta
    for i in range(j, last):
        X[row, i] -= scale * F[j, i]


@inner
def apply_transposed(F: Array, S: Array, X: Array, row: int) -> None:
    """Apply x ← Qᵀ x of :func:`factor`, x being a row of X."""
    for j in range(F.shape[0]):
        reflect(F, j, S[1, j], X, row)


@inner
def apply(F: Array, S: Array, X: Array, row: int) -> None:
    """Apply x ← Q x of :func:`factor`, x being a row of X."""
    for j in range(F.shape[0] - 1, -1, -1):
        reflect(F, j, S[1, j], X, row)


@inner
def solve_upper(F: Array, S: Array, X: Array, row: int) -> None:
    """Solve x[:c] ← R⁻¹ x[:c] of :func:`factor`, x being a row of X."""
    for j in range(F.shape[0] - 1, -1, -1):
        X[row, j] *= S[0, j]
        for i in range(j):
            X[row, i] -= F[j, i] * X[row, j]


@inner
def solve_lower(F: Array, S: Array, X: Array, row: int) -> None:
    """Solve x[:c] ← R⁻ᵀ x[:c] of :func:`factor`, x being a row of X."""
    for j in range(F.shape[0]):
        total = X[row, j]
        for i in range(j):
            total -= F[j, i] * X[row, i]
        X[row, j] = total * S[0, j]


@inner
def least_gain(F: Array, S: Array) -> float:
    """A lower bound, 1/‖R⁻¹‖_F, of the least singular value of the matrix of :func:`factor`; uses up S[2]."""
    c = F.shape[0]
    total = 0.0
    for k in range(c):
        for i in range(k):
            S[2, i] = 0.0
        S[2, k] = 1.0
        for j in range(k, -1, -1):
            S[2, j] *= S[0, j]
            for i in range(j):
                S[2, i] -= F[j, i] * S[2, j]
            total += S[2, j] * S[2, j]
    return 1.0 / math.sqrt(total)


@inner
def full_rank_solution(W: Array, first: int, b: Array, floor: float, Y: Array) -> bool:
    """y[first:] ← M† (b − W[:, :first] y[:first]) for M = W[:, first:], y being the first row of Y.

    Returns False, and leaves Y alone, unless the least singular value of M is certainly above the floor.
    """
    k, p = W.shape[0], W.shape[1] - first
    c, r = min(k, p), max(k, p)
    F, S = np.empty((c, r)), np.empty((3, max(2, r)))
    if k >= p:
        for j in range(p):
            for i in range(k):
                F[j, i] = W[i, first + j]
    else:
        for i in range(k):
            for j in range(p):
                F[i, j] = W[i, first + j]
    factor(F, S)
    if not least_gain(F, S) > floor:
        return False
    for i in range(k):
        rest = b[i]
        for j in range(first):
            rest -= W[i, j] * Y[0, j]
        S[2, i] = rest
    if k >= p:
        apply_transposed(F, S, S, 2)
        solve_upper(F, S, S, 2)
    else:
        for i in range(k, p):
            S[2, i] = 0.0
        solve_lower(F, S, S, 2)
        apply(F, S, S, 2)
    for j in range(p):
        Y[0, first + j] = S[2, j]
    return True


@inner
def rotate(X: Array, p: int, q: int, c: float, s: float) -> None:
    """Turn the columns p and q of X."""
    for i in range(X.shape[1]):
        u, w = X[p, i], X[q, i]
        X[p, i] = c * u - s * w
        X[q, i] = s * u + c * w


@inner
def decompose(M: Array) -> tuple[Array, Array, Array]:
    """Singular values of M (k, n), decreasing, with M V by columns (n, max(k, n)) and V by columns (n, n).

    One-sided Jacobi rotations. V is orthogonal whatever the rank.
    """
    k, n = M.shape
    r = max(k, n)
    W, V, gains = np.zeros((n, r)), np.zeros((n, n)), np.zeros(n)
    largest = 0.0
    for i in range(k):
        for j in range(n):
            largest = max(largest, abs(M[i, j]))
    for j in range(n):
        V[j, j] = 1.0
        if largest > 0.0:
            for i in range(k):
                W[j, i] = M[i, j] / largest
    negligible = 1e-32 * norm(W) ** 2
    for _ in range(SWEEPS):
        rotated = False
        for p in range(n - 1):
            for q in range(p + 1, n):
                a, b, d = dot(W[p], W[p], 0, r), dot(W[q], W[q], 0, r), dot(W[p], W[q], 0, r)
                if min(a, b) <= negligible or abs(d) <= 4e-16 * math.sqrt(a * b):
                    continue
                rotated = True
                z = (b - a) / (2.0 * d)
                t = math.copysign(1.0, z) / (abs(z) + math.sqrt(1.0 + z * z))
                c = 1.0 / math.sqrt(1.0 + t * t)
                rotate(W, p, q, c, c * t)
                rotate(V, p, q, c, c * t)
        if not rotated:
            break
    for j in range(n):
        gains[j] = largest * norm(W[j])
        for i in range(r):
            W[j, i] *= largest
    for j in range(n):
        best = j
        for i in range(j + 1, n):
            if gains[i] > gains[best]:
                best = i
        if best != j:
            gains[j], gains[best] = gains[best], gains[j]
            rotate(W, j, best, 0.0, -1.0)
            rotate(V, j, best, 0.0, -1.0)
    return gains, W, V


@inner
def add_solution(gains: Array, W: Array, V: Array, rhs: Array, floor: float, y: Array) -> int:
    """Y ← y + M† rhs of :func:`decompose`, by the singular values above the floor; their number."""
    rank = 0
    for j in range(gains.size):
        if not gains[j] > floor:
            break
        rank += 1
        amount = dot(W[j], rhs, 0, rhs.size) / gains[j] / gains[j]
        for i in range(y.size):
            y[i] += amount * V[j, i]
    return rank


@inner
def resolve(A1: Array, b1: Array, A2: Array, b2: Array, tolerance: float, qdd: Array) -> int:
    """q̈ ← A₁†b₁ + (A₂(I − A₁†A₁))†(b₂ − A₂A₁†b₁), as :func:`vsconstraints.controllers.task_priority.resolve`.

    Parameters
    ----------
    A1, b1
        (b, n) and (b,), b ≥ 0; without rows this is :func:`vsconstraints.controllers.tracking.least_norm`.
    A2, b2
        (k, n) and (k,), k ≥ 0.
    tolerance
        Singular values below this fraction of the largest one count as zero.
    qdd
        (n,) output.

    Returns
    -------
    int
        The rank of A₁.
    """
    b, n = A1.shape
    k = A2.shape[0]
    Y = np.zeros((1, n))
    floor = CERTAIN * tolerance * norm(A2)
    F, S, W = A1.copy(), np.empty((3, b)), A2
    certain = b <= n
    if 0 < b <= n:
        factor(F, S)
        certain = least_gain(F, S) > CERTAIN * tolerance * norm(A1)
        for j in range(b):
            Y[0, j] = b1[j]
        solve_lower(F, S, Y, 0)
        W = A2.copy()
        for i in range(k):
            apply_transposed(F, S, W, i)
    if not certain or (b < n and not full_rank_solution(W, b, b2, floor, Y)):
        return resolve_by_gains(A1, b1, A2, b2, tolerance, qdd)
    apply(F, S, Y, 0)
    for j in range(n):
        qdd[j] = Y[0, j]
    return int(b)


@inner
def resolve_by_gains(A1: Array, b1: Array, A2: Array, b2: Array, tolerance: float, qdd: Array) -> int:
    """As :func:`resolve`, by singular values."""
    n = A1.shape[1]
    k = A2.shape[0]
    for j in range(n):
        qdd[j] = 0.0
    gains, W, V = decompose(A1)
    rank = add_solution(gains, W, V, b1, tolerance * gains[0], qdd)
    M, rest, y = np.empty((k, n - rank)), np.empty(k), np.zeros(n - rank)
    for i in range(k):
        for j in range(n - rank):
            M[i, j] = dot(A2[i], V[rank + j], 0, n)
        rest[i] = b2[i] - dot(A2[i], qdd, 0, n)
    floor = tolerance * decompose(A2)[0][0]
    gains, W, turned = decompose(M)
    add_solution(gains, W, turned, rest, floor, y)
    for j in range(n - rank):
        for i in range(n):
            qdd[i] += y[j] * V[rank + j, i]
    return rank


@inner
def rank_of(A: Array, tolerance: float) -> int:
    """The number of singular values above the tolerance times the largest."""
    gains = decompose(A)[0]
    rank = 0
    while rank < gains.size and gains[rank] > tolerance * gains[0]:
        rank += 1
    return rank
