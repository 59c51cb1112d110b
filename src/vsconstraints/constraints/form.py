"""How a constraint describes itself to the compiled step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..rows import Array, IntArray
from ..vision.motion import Motion
from .by_formula import Frame


class Form(NamedTuple):
    """What the compiled step needs to know of a constraint.

    Attributes
    ----------
    rows
        Which function of :mod:`vsconstraints.compiled.constraint_rows` makes such rows.
    formulas
        Elementwise functions that it makes them of.
    parameters
        Of the formulas.
    which
        (r,) for each row the number of the marker, or of the robot point in the scene, counted from 0.
    frame, margin, motion
        See :class:`vsconstraints.constraints.base.PositionConstraint`.
    gradients, offsets
        Of linear rows: (r, n) and (r,).
    """

    rows: str
    formulas: tuple[Callable[..., Any] | None, ...] = ()
    parameters: tuple[float, ...] = ()
    which: Sequence[int] | IntArray | int = 0
    frame: Frame | None = None
    margin: float = 0.0
    motion: Motion | None = None
    gradients: Array | float = 0.0
    offsets: Array | float = 0.0
