"""Elementwise formulas in local frames, for arrays of coordinates and for the compiled step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import ConfigurationError
from ..formulas.frames import (
    TINY,
    differences_in_image,
    differences_in_space,
    rotate_in_image,
    rotate_inverse_in_image,
)
from ..formulas.vectors import rotate, rotate_inverse
from ..rows import Array, IntArray
from ..vision.motion import Motion

if TYPE_CHECKING:
    from ..compiled.constraint_rows import RowTemplate

Formula = Callable[..., Any]
Frame = tuple[Array, Array]  #: R (d, d), whose columns are the axes, and origin t (d,).


class FrameFormulas(NamedTuple):
    """Formulas R x and Rᵀ x of a frame, and curvature by differences of a gradient."""

    rotate: Formula
    rotate_inverse: Formula
    curvature: Formula


#: Formulas by the number of coordinates.
IN_FRAME = {
    2: FrameFormulas(rotate_in_image, rotate_inverse_in_image, differences_in_image),
    3: FrameFormulas(rotate, rotate_inverse, differences_in_space),
}


class CompiledRowSpec(NamedTuple):
    """Description of a constraint from which the compiled step computes its rows.

    The ``template`` makes the function that writes the rows. ``which`` (r,) are the numbers of the
    markers or of the scene's robot points, counted from 0. ``gradients`` (r, n) and ``offsets``
    (r,) are those of linear rows. ``middles`` (r,) are the middles of the ranges of continuous
    joints, NaN for other rows. For the other fields see :class:`ByFormula`.
    """

    template: RowTemplate
    formulas: tuple[Formula | None, ...] = ()
    parameters: tuple[float, ...] = ()
    which: Sequence[int] | IntArray | int = 0
    frame: Frame | None = None
    margin: float = 0.0
    motion: Motion | None = None
    gradients: Array | float = 0.0
    offsets: Array | float = 0.0
    middles: Array | float = np.nan


@dataclass(frozen=True, slots=True)
class Keyed:
    """Object that is compared by its key, as an argument of cached functions."""

    key: tuple[Any, ...]
    of: Any = field(compare=False)


class ByFormula:
    """Function of d coordinates y by an elementwise formula: see :mod:`vsconstraints.formulas`."""

    coordinates: int  #: d: 2 in the image, 3 in space.
    #: Value and its d derivatives, as a function of d coordinates and the parameters.
    formula: Formula | None = None
    #: ẏᵀ H ẏ, as a function of the same and d velocities; by differences if None.
    curvature_formula: Formula | None = None
    parameters: tuple[float, ...] = ()
    frame: Frame | None = None  #: Frame of the formula; None if it is the frame of y.

    def value(self, y: Array) -> Array:
        """Return the value (...) at y (..., d)."""
        value, *_ = self.evaluated(*_coordinates(y))
        return np.broadcast_to(value, y.shape[:-1])

    def gradient(self, y: Array) -> Array:
        """Return ∂value/∂y (..., d) at y (..., d)."""
        _, *slope = self.evaluated(*_coordinates(y))
        if self.frame is not None:
            R, _ = self.frame
            slope = IN_FRAME[self.coordinates].rotate(R, slope)
        entries = [np.broadcast_to(entry, y.shape[:-1]) for entry in slope]
        return np.stack(entries, axis=-1)

    def curvature(self, y: Array, velocity: Array) -> Array:
        """Return ẏᵀ H ẏ (...) at y (..., d) with velocities (..., d)."""
        x = self._local(_coordinates(y))
        x_dot = self._turned_back(_coordinates(velocity))
        if self.curvature_formula is None:
            by_differences = IN_FRAME[self.coordinates].curvature
            curvature = by_differences(self.formula, self.parameters, x, x_dot)
        else:
            curvature = self.curvature_formula(*x, *self.parameters, *x_dot)
        return np.broadcast_to(curvature, y.shape[:-1])

    def evaluated(self, *y: Array) -> tuple[Any, ...]:
        """Return value and derivatives along the axes of the frame.

        The d coordinates have shapes that can be broadcast together.
        """
        assert self.formula is not None
        values: tuple[Any, ...] = self.formula(*self._local(y), *self.parameters)
        return values

    def _local(self, y: Sequence[Array]) -> tuple[Array, ...]:
        """Return coordinates of points in the frame of the formula."""
        if self.frame is None:
            return tuple(y)
        _, origin = self.frame
        relative = [coordinate - start for coordinate, start in zip(y, origin, strict=True)]
        return self._turned_back(relative)

    def _turned_back(self, x: Sequence[Array]) -> tuple[Array, ...]:
        """Return the coordinates of a direction in the frame of the formula."""
        if self.frame is None:
            return tuple(x)
        R, _ = self.frame
        turned: tuple[Array, ...] = IN_FRAME[self.coordinates].rotate_inverse(R, x)
        return turned


def _coordinates(y: Array) -> tuple[Array, ...]:
    """Return the d coordinates (...) of points (..., d)."""
    return tuple(np.moveaxis(y, -1, 0))


def _defining_class(kind: type, name: str) -> type:
    """Return the class from which a class inherits an attribute; object if none defines it."""
    for parent in kind.__mro__:
        if name in vars(parent):
            return parent
    return object


def require_own_curvature(kind: type) -> None:
    """Raise ConfigurationError if a class has a formula but inherits another one's curvature."""
    own = _defining_class(kind, "formula")
    inherited = _defining_class(kind, "curvature_formula")
    is_outdated = own is not inherited and issubclass(own, inherited)
    if is_outdated and vars(inherited).get("curvature_formula") is not None:
        raise ConfigurationError(
            f"{own.__name__} defines formula, but inherits curvature_formula from "
            f"{inherited.__name__}: define curvature_formula too, or set it to None"
        )


def curvature_by_differences(
    gradient: Callable[[Array], Array], y: Array, velocity: Array
) -> Array:
    """Return ẏᵀ H ẏ (...) if only a gradient (..., d) is known, as a function of y (..., d)."""

    def formula(*x: Array) -> tuple[Array, ...]:
        unused_value = np.empty(0)
        slope = gradient(np.stack(x, axis=-1))
        return unused_value, *_coordinates(slope)

    by_differences = IN_FRAME[y.shape[-1]].curvature
    curvature: Array = by_differences(formula, (), _coordinates(y), _coordinates(velocity))
    return curvature


def differences_along(
    gradient: Callable[[Array], Array], q: Array, qd: Array, length: float
) -> Array:
    """Return q̇ᵀ (∂²σ/∂q²) q̇ (r,) by central differences of a gradient (r, n).

    ``length`` is the step along q̇ (n,) [rad or m].
    """
    speed = float(np.sqrt(qd @ qd))
    step = length / max(speed, TINY)
    ahead = gradient(q + step * qd)
    behind = gradient(q - step * qd)
    curvature: Array = (ahead - behind) @ qd / (2.0 * step)
    return curvature
