"""Elementwise formulas shared by NumPy and by compiled code, each written once.

A formula takes numbers or arrays, coordinate by coordinate, and returns the same shape; several
results form a tuple. It uses arithmetic and elementwise functions of NumPy. No ``if`` depends on a
coordinate, because arrays have no truth value: :func:`where` chooses, or a comparison counts as 1
or 0. A divisor that is zero gets 1 added. Parameters are numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

__all__ = ["FORMULAS", "formula", "where"]

F = TypeVar("F", bound=Callable[..., Any])

#: All marked functions, in order of definition.
FORMULAS: list[Callable[..., Any]] = []


def formula(function: F) -> F:
    """Mark a function as callable from compiled code, also from other formulas.

    The function itself is returned unchanged.
    """
    FORMULAS.append(function)
    return function


def where(condition, x, y) -> Any:
    """Return x where the condition holds, y elsewhere, like ``np.where``.

    If all three are numbers, compiled code makes no array of the result, as it would for
    ``np.where``.
    """
    return np.where(condition, x, y)
