"""Small linear algebra, compiled: rows of matrices, and Householder reflections.

A function is compiled anew for every type of its arguments, and all functions that it calls are
optimised again together with it. Therefore vectors are rows of matrices, all of one type, and calls
have few levels.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, cast

import numpy as np

from ..rows import Array
from .compiler import in_place


def constant(value: int) -> int:
    """Return a constant that can be passed to compiled functions.

    Numba would compile them anew for every plain constant.
    """
    return cast("int", np.int64(value))


@in_place
def clip(x: float, least: float, greatest: float) -> float:
    """Return the number nearest to x within the bounds."""
    return min(max(x, least), greatest)


@in_place
def largest_magnitude(x: Array) -> float:
    """Return the largest |xⱼ| of a vector, 0 if it is empty."""
    greatest = 0.0
    for j in range(x.size):
        greatest = max(greatest, abs(x[j]))
    return greatest


START = constant(0)  #: The first column or row.
ONE = constant(1)  #: The second one.
#: Rows of the scalars of a :class:`QR`, and their number.
INVERSE = constant(0)
BETA = constant(1)
WORK = constant(2)
SCALARS = constant(3)
LARGE = 1e280  #: Compiled laws do not accept squares beyond this.


@in_place
def finite(x: Array) -> bool:
    """True if every number of a vector is finite."""
    # without branches, so that the processor handles several numbers at once
    wrong = 0
    for i in range(x.size):
        wrong |= not abs(x[i]) < math.inf
    return wrong == 0


@in_place
def out_of_range(squared: float) -> bool:
    """True if a square is nonzero, and not finite or near the limits of floating point."""
    # both are false for NaN
    is_below_maximum = squared < LARGE
    is_zero_or_above_minimum = (squared > 1.0 / LARGE) | (squared == 0.0)
    return not (is_below_maximum & is_zero_or_above_minimum)


@in_place
def in_range(X: Array) -> bool:
    """True if the squared norm of every row of X is zero or well within floating point."""
    wrong = 0
    for i in range(X.shape[0]):
        squared = squared_length(X, i, START, X.shape[1])
        wrong |= out_of_range(squared)
    return wrong == 0


@in_place
def dot(X: Array, i: int, Y: Array, j: int, first: int, last: int) -> float:
    """Return Σ x y of the rows X[i] and Y[j], from entry ``first`` up to ``last``."""
    total = 0.0
    for a in range(first, last):
        total += X[i, a] * Y[j, a]
    return total


@in_place
def squared_length(X: Array, i: int, first: int, last: int) -> float:
    """Return ‖X[i]‖² from entry ``first`` up to ``last``."""
    return dot(X, i, X, i, first, last)


@in_place
def length(X: Array, i: int, last: int) -> float:
    """Return ‖X[i]‖ up to entry ``last``."""
    norm: float = np.sqrt(squared_length(X, i, START, last))
    return norm


@in_place
def squares(X: Array, last: int) -> float:
    """Return ‖X‖² (Frobenius) of the columns up to ``last``."""
    total = 0.0
    for i in range(X.shape[0]):
        total += squared_length(X, i, START, last)
    return total


@in_place
def away(G: Array, i: int, X: Array, row: int, C: Array, center: int) -> float:
    """Return Σ Gᵢ (x − c) of the rows X[row] and C[center], over as many entries as X has."""
    total = 0.0
    for j in range(X.shape[1]):
        total += G[i, j] * (X[row, j] - C[center, j])
    return total


@in_place
def add(X: Array, i: int, scale: float, Y: Array, j: int, first: int, last: int) -> None:
    """Set X[i] ← X[i] + scale Y[j], from entry ``first`` up to ``last``."""
    for a in range(first, last):
        X[i, a] += scale * Y[j, a]


@in_place
def copy(X: Array, i: int, Y: Array, j: int, last: int) -> None:
    """Set X[i] ← Y[j] up to entry ``last``."""
    for a in range(last):
        X[i, a] = Y[j, a]


@in_place
def copy_vector(x: Array, y: Array) -> None:
    """Set x ← y."""
    for j in range(x.size):
        x[j] = y[j]


class QR(NamedTuple):
    """Householder QR of a matrix (r, c), c ≤ r, in place of its columns; see :func:`factor`.

    The rows of ``columns`` (c, r) are the columns of the matrix. Entry i < j of row j becomes
    R[i, j], and the rest the vector v of the reflection I − beta v vᵀ. ``scalars`` (3, r) are the
    inverses of the diagonal of R, then beta; its last row, ``WORK``, is free.

    The basis of the QR consists of the columns of Q, which is the product of the reflections.
    """

    columns: Annotated[Array, "c r"]
    scalars: Annotated[Array, "3 r"]


@in_place
def reflect(qr: QR, j: int, X: Array, row: int) -> None:
    """Apply the j-th reflection to a row of X."""
    v = qr.columns
    r = v.shape[1]
    scale = dot(v, j, X, row, j, r) * qr.scalars[BETA, j]
    for i in range(j, r):
        X[row, i] -= scale * v[j, i]


@in_place
def make_reflection(qr: QR, j: int) -> None:
    """Turn the j-th column into that of R and its reflection.

    The previous reflections must have been applied to the column.
    """
    v = qr.columns
    r = v.shape[1]
    size = np.sqrt(squared_length(v, j, j, r))
    # the sign without cancellation
    outward = np.copysign(size, v[j, j])
    v[j, j] += outward
    if size > 0.0:
        beta = 1.0 / (outward * v[j, j])
        # R[j, j] is −outward; 1 / outward equals beta v[j, j] and saves another division
        inverse = -beta * v[j, j]
    else:
        beta = 0.0
        inverse = math.inf
    qr.scalars[INVERSE, j] = inverse
    qr.scalars[BETA, j] = beta


@in_place
def apply_transposed(qr: QR, c: int, X: Array, row: int) -> None:
    """Set x ← Qᵀ x, with the first c reflections as Q and a row of X as x."""
    for j in range(c):
        reflect(qr, j, X, row)


@in_place
def apply(qr: QR, c: int, X: Array, row: int) -> None:
    """Set x ← Q x, with the first c reflections as Q and a row of X as x."""
    for j in range(c - 1, -1, -1):
        reflect(qr, j, X, row)


@in_place
def solve_upper(qr: QR, c: int, X: Array, row: int) -> None:
    """Set x ← R⁻¹ x with the first c columns of R; x is the beginning of a row of X."""
    R = qr.columns
    for j in range(c - 1, -1, -1):
        X[row, j] *= qr.scalars[INVERSE, j]
        for i in range(j):
            X[row, i] -= R[j, i] * X[row, j]


@in_place
def solve_lower(qr: QR, c: int, X: Array, row: int) -> None:
    """Set x ← R⁻ᵀ x with the first c columns of R; x is the beginning of a row of X."""
    R = qr.columns
    for j in range(c):
        total = X[row, j]
        for i in range(j):
            total -= R[j, i] * X[row, i]
        X[row, j] = total * qr.scalars[INVERSE, j]


@in_place
def squared_norm_of_inverse(qr: QR) -> float:
    """Return ‖R⁻¹‖_F² by the columns of R⁻ᵀ, each of which solves Rᵀ x = e_k.

    The entries that are changed together are independent: the processor overlaps them.
    """
    R = qr.columns
    scalars = qr.scalars
    c = R.shape[0]
    total = 0.0
    for k in range(c):
        for j in range(k, c):
            scalars[WORK, j] = 1.0 if j == k else 0.0
        for j in range(k, c):
            entry = scalars[WORK, j] * scalars[INVERSE, j]
            total += entry * entry
            for i in range(j + 1, c):
                scalars[WORK, i] -= R[i, j] * entry
    return total


@in_place
def factor(qr: QR) -> float:
    """Compute the QR of the columns in place; return 1/‖R⁻¹‖_F.

    This is a lower bound of the least singular value.
    """
    F = qr.columns
    c, r = F.shape
    # columns to the right are independent: the processor overlaps them
    for j in range(c):
        make_reflection(qr, j)
        beta = qr.scalars[BETA, j]
        for other in range(j + 1, c):
            scale = dot(F, j, F, other, j, r) * beta
            for i in range(j, r):
                F[other, i] -= scale * F[j, i]
    bound: float = 1.0 / np.sqrt(squared_norm_of_inverse(qr))
    return bound
