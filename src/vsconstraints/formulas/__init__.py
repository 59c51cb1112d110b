"""Elementwise formulas shared by NumPy and by compiled code, each written once.

A formula takes numbers or arrays, coordinate by coordinate, and returns the same shape; several
results form a tuple. It uses arithmetic and elementwise functions of NumPy. No ``if`` depends on a
coordinate, because arrays have no truth value: ``np.where`` chooses, or a comparison counts as 1 or
0. A divisor that is zero gets 1 added. Parameters are numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

__all__ = ["FORMULAS", "formula"]

F = TypeVar("F", bound=Callable[..., Any])

#: All marked functions, in order of definition.
FORMULAS: list[Callable[..., Any]] = []


def formula(function: F) -> F:
    """Mark a function as callable from compiled code, also from other formulas.

    The function itself is returned unchanged.
    """
    FORMULAS.append(function)
    return function
