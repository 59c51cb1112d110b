"""Scratch matrices of compiled functions, which are parts of one array.

Allocating them would take as long as their use.
"""

from __future__ import annotations

import numpy as np

from ..rows import Array, BoolArray, IntArray
from .compiler import inner
from .linear import QR, SCALARS
from .parts import matrix_at
from .workspace import LawArrays, Scratch


@inner
def matrix(scratch: Scratch, rows: int, columns: int) -> Array:
    """Take an uninitialised matrix; allocate one if there is no room left."""
    at = scratch.taken[0]
    if at + rows * columns > scratch.numbers.size:
        return np.empty((rows, columns))
    scratch.taken[0] = at + rows * columns
    part: Array = matrix_at(scratch.numbers, at, rows, columns)
    return part


@inner
def blank(scratch: Scratch, rows: int, columns: int) -> Array:
    """Take a matrix of zeros."""
    part = matrix(scratch, rows, columns)
    for i in range(rows):
        for j in range(columns):
            part[i, j] = 0.0
    return part


@inner
def vector(scratch: Scratch, size: int) -> Array:
    """Take an uninitialised vector."""
    part: Array = matrix(scratch, 1, size)[0]
    return part


@inner
def filled(scratch: Scratch, size: int, value: float) -> Array:
    """Take a vector whose entries all have one value."""
    part = vector(scratch, size)
    for i in range(size):
        part[i] = value
    return part


@inner
def integers(scratch: Scratch, size: int) -> IntArray:
    """Take an uninitialised vector of integers."""
    part: IntArray = vector(scratch, size).view(np.int64)
    return part


@inner
def flags(scratch: Scratch, size: int) -> BoolArray:
    """Take a vector of flags that are False."""
    part: BoolArray = filled(scratch, size, 0.0).view(np.bool_)[:size]
    return part


@inner
def empty_qr(scratch: Scratch, columns: int, length: int) -> QR:
    """Take uninitialised memory for the QR of columns of the given number and length."""
    return QR(matrix(scratch, columns, length), matrix(scratch, SCALARS, length))


@inner
def emptied(law: LawArrays) -> Scratch:
    """Return the scratch of a law with nothing taken."""
    law.scratch.taken[0] = 0
    return law.scratch


@inner
def no_scratch() -> Scratch:
    """Return scratch without room, for rare calls: every array is allocated."""
    return Scratch(np.empty(0), np.zeros(1, np.int64))
