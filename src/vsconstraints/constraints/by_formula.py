"""Elementwise formulas in frames of their own: for arrays of coordinates, and for the compiled step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..errors import ConfigurationError
from ..formulas.frames import TINY, differences_in_image, differences_in_space, turned_back_in_image, turned_in_image
from ..formulas.vectors import turned, turned_back
from ..rows import Array, IntArray
from ..vision.motion import Motion

Formula = Callable[..., Any]
Frame = tuple[Array, Array]
"""R (d, d), whose columns are the axes, and origin t (d,)."""

TURNED: dict[int, Formula] = {2: turned_in_image, 3: turned}
TURNED_BACK: dict[int, Formula] = {2: turned_back_in_image, 3: turned_back}
DIFFERENCES: dict[int, Formula] = {2: differences_in_image, 3: differences_in_space}
"""By the number of coordinates."""


class ByFormula(Protocol):
    """Says all about a function of d coordinates; see :mod:`vsconstraints.formulas` for what formulas may contain.

    Attributes
    ----------
    coordinates
        d: 2 in the image, 3 in space.
    formula
        Elementwise: value and its d derivatives, from the d coordinates in the frame, then the parameters.
    curvature_formula
        Elementwise: ẏᵀ H ẏ, from coordinates, parameters and d velocities; if None it is taken by differences.
    parameters
        Floats.
    frame
        In which the formula is written; None if that is the one of the coordinates.
    """

    coordinates: int
    formula: Formula | None
    curvature_formula: Formula | None
    parameters: tuple[float, ...]
    frame: Frame | None


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


def demand_own_curvature(kind: type) -> None:
    """Raise ConfigurationError if a class gives a formula of its own but inherits another one's curvature."""
    giver = {
        name: next((c for c in kind.__mro__ if name in vars(c)), object) for name in ("formula", "curvature_formula")
    }
    own, inherited = giver["formula"], giver["curvature_formula"]
    if own is not inherited and issubclass(own, inherited) and vars(inherited).get("curvature_formula") is not None:
        raise ConfigurationError(
            f"{own.__name__} has a formula of its own, but the curvature_formula of {inherited.__name__}: give its own "
            "too, or None"
        )


def value(part: ByFormula, y: Array) -> Array:
    """(...) value at coordinates y (..., d)."""
    return np.broadcast_to(evaluated(part, *np.moveaxis(y, -1, 0))[0], y.shape[:-1])


def gradient(part: ByFormula, y: Array) -> Array:
    """(..., d) ∂value/∂y at coordinates y (..., d)."""
    slope = evaluated(part, *np.moveaxis(y, -1, 0))[1:]
    if part.frame is not None:
        slope = TURNED[part.coordinates](part.frame[0], slope)
    return np.stack([np.broadcast_to(entry, y.shape[:-1]) for entry in slope], axis=-1)


def curvature(part: ByFormula, y: Array, velocity: Array) -> Array:
    """(...) ẏᵀ H ẏ at coordinates y (..., d) with velocities (..., d)."""
    x, v = _local(part, tuple(np.moveaxis(y, -1, 0))), _turned_back(part, tuple(np.moveaxis(velocity, -1, 0)))
    if part.curvature_formula is None:
        bent = DIFFERENCES[part.coordinates](part.formula, part.parameters, x, v)
    else:
        bent = part.curvature_formula(*x, *part.parameters, *v)
    return np.broadcast_to(bent, y.shape[:-1])


def curvature_by_differences(gradient: Callable[[Array], Array], y: Array, velocity: Array) -> Array:
    """(...) ẏᵀ H ẏ where only a gradient (..., d) is known, as a function of coordinates y (..., d)."""

    def function(*x: Array) -> tuple[Array, ...]:
        return np.empty(0), *np.moveaxis(gradient(np.stack(x, axis=-1)), -1, 0)

    d = y.shape[-1]
    bent: Array = DIFFERENCES[d](function, (), np.moveaxis(y, -1, 0), np.moveaxis(velocity, -1, 0))
    return bent


def differences_along(gradient: Callable[[Array], Array], q: Array, qd: Array, length: float) -> Array:
    """(r,) q̇ᵀ (∂²σ/∂q²) q̇ by central differences of a gradient (r, n), that far along q̇ (n,) [rad or m]."""
    step = length / max(float(np.sqrt(qd @ qd)), TINY)
    change: Array = (gradient(q + step * qd) - gradient(q - step * qd)) @ qd / (2.0 * step)
    return change


def evaluated(part: ByFormula, *y: Array) -> tuple[Any, ...]:
    """Value and derivatives along the axes of the frame, at d coordinates of shapes that go together."""
    assert part.formula is not None
    found: tuple[Any, ...] = part.formula(*_local(part, y), *part.parameters)
    return found


def _local(part: ByFormula, y: Sequence[Array]) -> tuple[Array, ...]:
    """Coordinates in the frame."""
    if part.frame is None:
        return tuple(y)
    return _turned_back(part, [along - origin for along, origin in zip(y, part.frame[1], strict=True)])


def _turned_back(part: ByFormula, x: Sequence[Array]) -> tuple[Array, ...]:
    """Coordinates of vectors along the axes of the frame."""
    return tuple(x) if part.frame is None else TURNED_BACK[part.coordinates](part.frame[0], x)
