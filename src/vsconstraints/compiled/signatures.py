"""Declared types of the arguments and results of compiled functions."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any, NamedTuple

import numpy as np


@dataclass(frozen=True)
class Number:
    """Number, by the name of its type in numba."""

    name: str

    def accepts(self, argument: object) -> bool:
        """Return True if compiled functions take the argument."""
        return isinstance(argument, (Real, np.bool_))


@dataclass(frozen=True)
class ArrayType:
    """C-contiguous array, by the name of its dtype in numba and its number of dimensions.

    A ``readonly`` array may be read-only.
    """

    dtype: str
    ndim: int
    readonly: bool = False

    def accepts(self, argument: object) -> bool:
        """Return True if compiled functions take the argument."""
        return (
            isinstance(argument, np.ndarray)
            and argument.dtype == np.dtype(self.dtype.replace("boolean", "bool"))
            and argument.ndim == self.ndim
            and argument.flags.c_contiguous
        )


@dataclass(frozen=True, eq=False)
class Reference:
    """Structure at an address, with fields of the same types as those of an example."""

    example: Any


class Signature(NamedTuple):
    """Types of the result and of the arguments; a tuple of types stands for a tuple."""

    result: Any
    arguments: tuple[Any, ...]


VOID = Number("void")
INT = Number("int64")
FLOAT = Number("float64")
FLAG = Number("boolean")
VECTOR = ArrayType("float64", 1)
#: Vector that may be read-only, like those of a set of constraints.
CONSTANT = ArrayType("float64", 1, readonly=True)
MATRIX = ArrayType("float64", 2)
STACK = ArrayType("float64", 3)  #: Matrices of the same shape.
INTEGERS = ArrayType("int64", 1)
FLAGS = ArrayType("boolean", 1)


def signature(result: Any, *arguments: Any) -> Signature:
    """Return the signature of a function with these types."""
    return Signature(result, arguments)


def flatten(values: tuple[Any, ...]) -> list[Any]:
    """Return the values, and those inside of tuples, in order."""
    flat: list[Any] = []
    for value in values:
        if isinstance(value, tuple):
            flat += flatten(value)
        else:
            flat.append(value)
    return flat
