"""Least squares and task priority, compiled, with decisions about ranks.

If full rank can be proved by the norm of an inverse, the answer is computed by Householder
reflections. Otherwise singular values are computed by Jacobi rotations of as few rows as there are.
This is common: the part of a redundant arm's task that rows leave loses ranks by construction.
"""

from __future__ import annotations

import numpy as np

from ..rows import Array
from . import linear as la
from .compiler import in_place, inner
from .linear import INVERSE, ONE, QR, SCALARS, START, WORK, constant
from .scratch import blank, empty_qr, matrix
from .workspace import Scratch

CERTAIN = 30.0
"""Full rank is certain if the bound of the least singular value exceeds this times the tolerance.

A factor of 1 would suffice for the rank. A larger factor restricts the fast method to matrices for
which it is as accurate as singular values.
"""

#: Least singular value, relative to the norm, for which triangular factors alone are accurate,
#: whatever the tolerance.
WELL = 1e-4
#: Squared norm of the answer, relative to that of J†b, below which :func:`bring` has lost digits.
CANCELLED = 1e-6
SWEEPS = 60  #: Maximum number of Jacobi sweeps; about six are usual.
#: Rows of the two terms of eq. (15): of the rows, and of the task; and their number.
OF_ROWS = START
OF_TASK = ONE
TERMS = constant(2)


@in_place
def rotate(X: Array, p: int, q: int, first: int, last: int, negligible: float) -> bool:
    """Make two rows orthogonal in columns [first, last) by one rotation.

    Return True if a rotation was needed.
    """
    squared_p = la.squared_length(X, p, first, last)
    squared_q = la.squared_length(X, q, first, last)
    product = la.dot(X, p, X, q, first, last)
    # the direction of a row of rounding errors does not matter
    if min(squared_p, squared_q) <= negligible:
        return False
    length_p = np.sqrt(squared_p)
    length_q = np.sqrt(squared_q)
    rounding = 2e-16 * (last - first) * length_p * length_q
    if abs(product) <= rounding:
        return False
    # tangent t and cosine c of the angle: t is the smaller root of t² + 2 z t = 1
    z = (squared_q - squared_p) / (2.0 * product)
    size_of_t = abs(z) + np.sqrt(1.0 + z * z)
    t = np.copysign(1.0, z) / size_of_t
    c = 1.0 / np.sqrt(1.0 + t * t)
    for i in range(first, X.shape[1]):
        x_p = X[p, i]
        x_q = X[q, i]
        X[p, i] = c * (x_p - t * x_q)
        X[q, i] = c * (t * x_p + x_q)
    return True


@in_place
def orthogonalise(X: Array, rows: int, first: int, last: int) -> float:
    """Make the first rows of X orthogonal in columns [first, last), and return the largest length.

    All columns from ``first`` on are transformed alike, by an orthogonal matrix from the left. The
    lengths of the rows within these columns are then the singular values of that part of X. The
    method is one-sided Jacobi rotations.
    """
    total = 0.0
    for i in range(rows):
        total += la.squared_length(X, i, first, last)
    negligible = 1e-30 * total
    for _ in range(SWEEPS):
        turned = False
        for p in range(rows - 1):
            for q in range(p + 1, rows):
                turned |= rotate(X, p, q, first, last, negligible)
        if not turned:
            break
    largest = 0.0
    for i in range(rows):
        largest = max(largest, la.squared_length(X, i, first, last))
    norm: float = np.sqrt(largest)
    return norm


@in_place
def add_gram_matrix(A: Array, scale: float, X: Array) -> None:
    """Set X ← X + AᵀA / scale² (n, n), with the first n columns of A."""
    n = X.shape[0]
    for i in range(A.shape[0]):
        for row in range(n):
            by_row = A[i, row] / scale
            for column in range(n):
                by_column = A[i, column] / scale
                X[row, column] += by_row * by_column


@inner
def largest_of_whole(
    W: Array, rows: int, first: int, tolerance: float, whole: Array, scale: float, X: Array
) -> float:
    """Return the largest singular value of ``whole`` over scale, or its norm if that suffices.

    X (n, n) must contain zeros.
    """
    n = W.shape[1] - 1
    size = 0.0
    for i in range(whole.shape[0]):
        for j in range(n):
            entry = whole[i, j] / scale
            size += entry**2
    for i in range(rows):
        # the squared largest singular value is between ‖whole‖_F² / n and ‖whole‖_F²; its value
        # matters only if the squared limit of a row is in that range
        limit = la.squared_length(W, i, first, n) / (tolerance * tolerance)
        if 0.99 * size <= n * limit and limit <= 1.01 * size:
            # it is the largest singular value of wholeᵀ whole, which this matrix represents with
            # all digits
            add_gram_matrix(whole, scale, X)
            norm: float = np.sqrt(orthogonalise(X, n, START, n))
            return norm
    bound: float = np.sqrt(size)
    return bound


@inner
def shorten(
    W: Array, rows: int, first: int, tolerance: float, whole: Array, scratch: Scratch
) -> int:
    """Make the first rows of :func:`pseudoinverse` orthogonal and drop those that are too short.

    Return the number of rows left.
    """
    n = W.shape[1] - 1
    # squares of very small numbers would underflow
    scale = 0.0
    for i in range(whole.shape[0]):
        for j in range(n):
            scale = max(scale, abs(whole[i, j]))
    if not scale > 0.0:
        scale = 1.0
    for i in range(rows):
        for j in range(first, n + 1):
            W[i, j] /= scale
    largest = orthogonalise(W, rows, first, n)
    if first > 0:
        zeros = blank(scratch, n, n)
        largest = largest_of_whole(W, rows, first, tolerance, whole, scale, zeros)
    left = 0
    for i in range(rows):
        size = np.sqrt(la.squared_length(W, i, first, n))
        kept = size > tolerance * largest
        for j in range(first, n + 1):
            value = W[i, j] if kept else 0.0
            W[i, j] = 0.0
            W[left, j] = value
        left += kept
    return left


@in_place
def triangular(W: Array, first: int, qr: QR) -> None:
    """Set [M | b] ← [R | Qᵀb] from the QR of M, with Qᵀb in its free row."""
    R = qr.columns
    scalars = qr.scalars
    p = R.shape[0]
    for i in range(W.shape[0]):
        for j in range(p):
            W[i, first + j] = R[j, i] if i < j else 0.0
        if i < p:
            W[i, first + i] = 1.0 / scalars[INVERSE, i]
            W[i, first + p] = scalars[WORK, i]


@inner
def factorise(
    W: Array, rows: int, first: int, by_columns: bool, scalars: Array, scratch: Scratch
) -> tuple[QR, float]:
    """Return the QR of M, or of Mᵀ, and a lower bound of the least singular value of M.

    M and b are the first rows of [· | M | b] in W, as in :func:`pseudoinverse`. The QR is that of M
    and scalars[WORK] becomes Qᵀb if ``by_columns``; otherwise they are that of Mᵀ, and b. The QR
    uses the ``scalars``.
    """
    n = W.shape[1] - 1
    p = n - first
    count = p if by_columns else rows
    length = rows if by_columns else p
    columns = matrix(scratch, count, length)
    qr = QR(columns, scalars)
    for j in range(count):
        for i in range(length):
            columns[j, i] = W[i, first + j] if by_columns else W[j, first + i]
    least = la.factor(qr)
    for i in range(p):
        scalars[WORK, i] = 0.0
    for i in range(rows):
        scalars[WORK, i] = W[i, n]
    if by_columns:
        la.apply_transposed(qr, p, scalars, WORK)
    return qr, least


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
) -> tuple[QR, int, float]:
    """Solve y ← M† b for W = [· | M | b] (k, n + 1), and write y to Y[row, first:].

    M begins with the column ``first``. The method is a QR of M (k, p), or of Mᵀ if it has more
    columns than rows. Unless that proves full rank, the rows of [M | b], or of [R | Qᵀb] if k ≥ p,
    are rotated until those of M are orthogonal. Rows that are too short are dropped, i.e. set to
    zero. The others have full rank, and the same M† b.

    W is overwritten. M remains if its rank is full for certain, i.e. if its least singular value
    exceeds ``certain`` times ‖whole‖_F. Otherwise it is replaced by a matrix with the same MᵀM up
    to a factor, apart from singular values below the ``tolerance`` times the largest one of
    ``whole`` (k', n), which is W if ``first`` is 0.

    Return a QR, the rank and a bound. The QR is that of M if M surely has full column rank, else it
    is that of the transpose of the rows that are left, so that the first columns of Q, as many as
    the rank, span the rows of M; the bound is then negative. Its magnitude is a lower bound of the
    least singular value that counts.
    """
    k = W.shape[0]
    n = W.shape[1] - 1
    p = n - first
    size = np.sqrt(la.squares(whole, n))
    scalars = matrix(scratch, SCALARS, max(k, p))
    is_tall = k >= p
    rank = min(k, p)
    qr, least = factorise(W, k, first, is_tall, scalars, scratch)
    is_certain = least > certain * size
    if not is_certain:
        if is_tall:
            triangular(W, first, qr)
        rank = shorten(W, rank, first, tolerance, whole, scratch)
        qr, least = factorise(W, rank, first, False, scalars, scratch)
    has_full_column_rank = is_tall and is_certain
    if has_full_column_rank:
        la.solve_upper(qr, p, scalars, WORK)
    else:
        la.solve_lower(qr, rank, scalars, WORK)
        la.apply(qr, rank, scalars, WORK)
    for j in range(p):
        Y[row, first + j] = scalars[WORK, j]
    return qr, rank, least if has_full_column_rank else -least


@in_place
def subtract_product(A: Array, x: Array) -> None:
    """Set b ← b − A x in [A | b] (k, n + 1), with x (n,), or (0,) for zero."""
    n = A.shape[1] - 1
    for i in range(A.shape[0]):
        for j in range(x.size):
            A[i, n] -= A[i, j] * x[j]


@inner
def resolve(
    A1: Array, A2: Array, b2: Array, tolerance: float, rest: Array, qdd: Array, scratch: Scratch
) -> tuple[int, QR, float]:
    """Set q̈ ← A₁†b₁ + (A₂(I − A₁†A₁))†(b₂ − A₂A₁†b₁), eq. (15).

    With q̈₀, the equation holds for q̈ − q̈₀, b₁ − A₁q̈₀ and b₂ − A₂q̈₀.

    The method is a rotation of the joint space. The QR of A₁ᵀ gives an orthogonal Q whose first
    ``rank`` columns span the rows of A₁ and whose others span its null space. In the coordinates
    z = Qᵀq̈ the projector I − A₁†A₁ sets the first ``rank`` entries to zero. Therefore the second
    term is Q (0, M†(b₂ − A₂A₁†b₁)) with A₂Q = [· | M], i.e. M begins with the column ``rank``.

    ``A1`` (b, n + 1) is [A₁ | b₁], b ≥ 0, and is overwritten. ``A2`` and ``b2`` are (k, n) and
    (k,); ``rest`` is q̈₀ (n,) or (0,). Singular values below the tolerance times the largest one
    count as zero. Return the rank of A₁; and the QR and the bound of :func:`pseudoinverse` for M,
    which is A₂ itself without A₁.
    """
    n = qdd.size
    k = A2.shape[0]
    certain = CERTAIN * tolerance
    terms = blank(scratch, TERMS, n)
    rotated: Array = matrix(scratch, k, n + 1)  # [A₂Q | b₂ − A₂A₁†b₁]
    qr_of_rows = QR(rotated, rotated)  # unused without A₁
    qr_of_task = qr_of_rows
    rank = START
    least = 0.0
    if A1.shape[0] > 0:
        subtract_product(A1, rest)
        qr_of_rows, rank, _ = pseudoinverse(
            A1, START, certain, tolerance, A1, terms, OF_ROWS, scratch
        )
    if rank < n:
        for i in range(k):
            left = b2[i]
            for j in range(n):
                rotated[i, j] = A2[i, j]
                left -= A2[i, j] * terms[OF_ROWS, j]
            for j in range(rest.size):
                left -= A2[i, j] * rest[j]
            rotated[i, n] = left
            if rank > 0:
                la.apply_transposed(qr_of_rows, rank, rotated, i)
        whole = A2 if rank > 0 else rotated
        qr_of_task, _, least = pseudoinverse(
            rotated, rank, certain, tolerance, whole, terms, OF_TASK, scratch
        )
        la.apply(qr_of_rows, rank, terms, OF_TASK)
    for j in range(n):
        qdd[j] = terms[OF_ROWS, j] + terms[OF_TASK, j]
    for j in range(rest.size):
        qdd[j] += rest[j]
    return rank, qr_of_task, least


@inner
def bring(task: QR, least: float, A: Array, tolerance: float, qdd: Array, scratch: Scratch) -> bool:
    """Change x = J†b so that A x = d, with the least change of ‖J x − b‖.

    x ← x + R⁻¹ (A R⁻¹)† (d − A x), with J = Q R. If J has full column rank, :func:`resolve` with A
    before J gives the same result. ``task`` and ``least`` are the QR of J and its bound from
    :func:`resolve`; ``A`` (b, n + 1) is [A | d].

    Return False, without any change, unless J and A have full rank for certain, A has fewer rows
    than columns, and J†b is not much larger than the answer.
    """
    n = qdd.size
    b = A.shape[0]
    if b >= n or least <= 0.0:
        return False
    rows = empty_qr(scratch, b, n)  # of (A R⁻¹)ᵀ
    squared_size = 0.0
    for i in range(b):
        la.copy(rows.columns, i, A, i, n)
        for j in range(n):
            entry = A[i, j]
            squared_size += entry * entry
        la.solve_lower(task, n, rows.columns, i)
    bound = la.factor(rows) * least
    needed = max(CERTAIN * tolerance, WELL)
    if not bound > needed * np.sqrt(squared_size):
        return False
    # the change of x, in the free row of the QR
    change = rows.scalars
    for i in range(n):
        change[WORK, i] = 0.0
    for i in range(b):
        missing = A[i, n]
        for j in range(n):
            missing -= A[i, j] * qdd[j]
        change[WORK, i] = missing
    la.solve_lower(rows, b, change, WORK)
    la.apply(rows, b, change, WORK)
    la.solve_upper(task, n, change, WORK)
    squared_before = 0.0
    squared_after = 0.0
    for j in range(n):
        changed = qdd[j] + change[WORK, j]
        squared_before += qdd[j] * qdd[j]
        squared_after += changed * changed
    # cancellation leaves rounding errors
    if squared_after < CANCELLED * squared_before:
        return False
    for j in range(n):
        qdd[j] += change[WORK, j]
    return True
