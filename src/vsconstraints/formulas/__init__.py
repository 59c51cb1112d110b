"""Formulas, each once, for NumPy and for compiled code: elementwise but for the loops of :mod:`.plans`.

An elementwise formula serves arrays of points in NumPy and single ones in compiled code. It takes numbers or arrays,
coordinates one by one, and returns numbers or arrays of the same shape, several as a tuple. It uses arithmetic and
functions of NumPy that work elementwise. No ``if`` depends on a coordinate, since arrays have no truth value:
``np.where`` chooses, or a comparison counts as 1 or 0 and a divisor that is zero gets 1 added. Parameters, which are
numbers in both forms, may decide what is computed.

:func:`formula` marks what compiled code may call: a formula may call others that are marked.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

__all__ = ["FORMULAS", "formula"]

F = TypeVar("F", bound=Callable[..., Any])

FORMULAS: list[Callable[..., Any]] = []
"""Every marked function, in the order of their definitions."""


def formula(function: F) -> F:
    """Mark an elementwise function, so that compiled code can call it; the function itself stays as it is."""
    FORMULAS.append(function)
    return function
