"""Vectors as tuples of three numbers or arrays, matrices as three rows of three.

With arrays, they stand for many bodies at once. Compiled code turns arrays into tuples first
(:func:`vector`, :func:`matrix`), because a formula is compiled separately for each type.
"""

from __future__ import annotations

from typing import Any

from . import formula

Vector = tuple[Any, Any, Any]
Matrix = Any  #: A tuple of three rows, or an array (3, 3).


@formula
def vector(x) -> Vector:
    """Coordinates of an array (3, ...), as a tuple."""
    return x[0], x[1], x[2]


@formula
def matrix(A) -> Matrix:
    """Rows of an array (3, 3), as tuples."""
    return (
        (A[0, 0], A[0, 1], A[0, 2]),
        (A[1, 0], A[1, 1], A[1, 2]),
        (A[2, 0], A[2, 1], A[2, 2]),
    )


@formula
def plus(a, b) -> Vector:
    """Return a + b."""
    return (
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
    )


@formula
def minus(a, b) -> Vector:
    """Return a − b."""
    return (
        a[0] - b[0],
        a[1] - b[1],
        a[2] - b[2],
    )


@formula
def times(scale, a) -> Vector:
    """Return scale a."""
    return (
        scale * a[0],
        scale * a[1],
        scale * a[2],
    )


@formula
def add_scaled(a, scale, b) -> Vector:
    """Return a + scale b."""
    return (
        a[0] + scale * b[0],
        a[1] + scale * b[1],
        a[2] + scale * b[2],
    )


@formula
def cross(a, b) -> Vector:
    """Return a × b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@formula
def dot(a, b) -> Any:
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@formula
def rotate(A: Matrix, x) -> Vector:
    """Return A x."""
    return (
        dot(A[0], x),
        dot(A[1], x),
        dot(A[2], x),
    )


@formula
def transpose(A: Matrix) -> Matrix:
    """Return Aᵀ."""
    return (
        (A[0][0], A[1][0], A[2][0]),
        (A[0][1], A[1][1], A[2][1]),
        (A[0][2], A[1][2], A[2][2]),
    )


@formula
def rotate_inverse(A: Matrix, x) -> Vector:
    """Return Aᵀ x."""
    return rotate(transpose(A), x)


@formula
def product(A: Matrix, B: Matrix) -> Matrix:
    """Return A B."""
    columns = transpose(B)
    return (
        rotate(columns, A[0]),
        rotate(columns, A[1]),
        rotate(columns, A[2]),
    )


@formula
def outer(a, b) -> Matrix:
    """Return a bᵀ."""
    return (
        times(a[0], b),
        times(a[1], b),
        times(a[2], b),
    )


@formula
def add_to_diagonal(A: Matrix, x) -> Matrix:
    """Return A + x I."""
    xx, xy, xz = A[0]
    yx, yy, yz = A[1]
    zx, zy, zz = A[2]
    return (
        (xx + x, xy, xz),
        (yx, yy + x, yz),
        (zx, zy, zz + x),
    )


@formula
def transposed_product(A: Matrix, B: Matrix) -> Matrix:
    """Return Aᵀ B."""
    return product(transpose(A), B)
