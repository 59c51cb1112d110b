"""Formulas, each once, for NumPy and for compiled code: elementwise.

A formula takes numbers or arrays, coordinates one by one, and returns the same shape, several as a
tuple. It uses arithmetic and elementwise functions of NumPy. No ``if`` depends on a coordinate,
since arrays have no truth value: ``np.where`` chooses, or a comparison counts as 1 or 0 and a
divisor that is zero gets 1 added. Parameters are numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

__all__ = ["FORMULAS", "formula"]

F = TypeVar("F", bound=Callable[..., Any])

#: Every marked function, in the order of their definitions.
FORMULAS: list[Callable[..., Any]] = []


def formula(function: F) -> F:
    """Mark a function that compiled code may call, also from other formulas; the function itself
    stays as it is.
    """
    FORMULAS.append(function)
    return function
