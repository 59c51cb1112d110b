"""Scratch of compiled functions: matrices that are parts of one array, since making them takes as long as their use."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..rows import Array
from .compiler import inner, numba
from .structures import LawArrays, Scratch


@numba.extending.intrinsic  # type: ignore[untyped-decorator]
def _part(typing_context: Any, numbers: Any, at: Any, rows: Any, columns: Any) -> Any:
    """The matrix of that shape which begins with entry ``at`` of a vector; nobody counts references to it."""
    kind, arrays = numba.types.Array(numbers.dtype, 2, "C"), numba.np.arrayobj

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        begin = builder.gep(arrays.make_array(numbers)(context, builder, values[0]).data, [values[1]])
        each = context.get_constant(numba.types.intp, context.get_abi_sizeof(context.get_data_type(numbers.dtype)))
        part = arrays.make_array(kind)(context, builder)
        strides = builder.mul(values[3], each), each
        arrays.populate_array(part, begin, shape=values[2:], strides=strides, itemsize=each, meminfo=None)
        return part._getvalue()

    return kind(numbers, *[numba.types.intp] * 3), generate


@inner
def matrix(scratch: Scratch, rows: int, columns: int) -> Array:
    """Take a matrix that holds anything; where there is no room left, make one."""
    at = scratch.taken[0]
    if at + rows * columns > scratch.numbers.size:
        return np.empty((rows, columns))
    scratch.taken[0] = at + rows * columns
    part: Array = _part(scratch.numbers, at, rows, columns)
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
    """Take a vector that holds anything."""
    part: Array = matrix(scratch, 1, size)[0]
    return part


@inner
def emptied(law: LawArrays) -> Scratch:
    """The scratch of a law, of which nothing is taken."""
    law.scratch.taken[0] = 0
    return Scratch(law.scratch.numbers, law.scratch.taken)


@inner
def no_scratch() -> Scratch:
    """Scratch without room, for what is seldom done: everything is made."""
    return Scratch(np.empty(0), np.zeros(1, np.int64))
