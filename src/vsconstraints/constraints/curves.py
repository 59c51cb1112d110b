"""Implicit closed curves in the image that enclose an obstacle: value > 0 inside, 0 on the curve, < 0 outside.

A shape is defined about its own origin; :class:`Curve` shifts and rotates it. Angles turn u towards v: seen on an
image whose v points down, positive is clockwise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..errors import InvalidInput, unknown_name
from ..formulas import curves as formulas
from ..geometry import vector
from ..rows import Array


class Shape(ABC):
    """An implicit curve about its own origin, in pixels.

    Attributes
    ----------
    name
        For labels and scenario files.
    radius
        Characteristic length [px].
    """

    name: ClassVar[str]
    radius: float

    @abstractmethod
    def evaluate(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """Value and its derivatives by u and v (...) at pixels from the shape's origin."""

    @abstractmethod
    def bending(self, u: Array, v: Array, u_dot: Array, v_dot: Array) -> Array:
        """Second derivative of the value along (u̇, v̇), times its square: (u̇, v̇) H (u̇, v̇)ᵀ."""

    def value(self, p: Array) -> Array:
        """(...) value at pixels p (..., 2) from the shape's origin."""
        return self.evaluate(p[..., 0], p[..., 1])[0]

    def gradient(self, p: Array) -> Array:
        """(..., 2) ∂value/∂p."""
        return np.stack(self.evaluate(p[..., 0], p[..., 1])[1:], axis=-1)


class Circle(Shape):
    """1 − ‖p‖²/r²."""

    name = "circle"

    def __init__(self, radius: float) -> None:
        self.radius = _positive(radius, "radius")

    def evaluate(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """See :func:`vsconstraints.formulas.curves.circle`."""
        return formulas.circle(u, v, self.radius)

    def bending(self, u: Array, v: Array, u_dot: Array, v_dot: Array) -> Array:
        """See :func:`vsconstraints.formulas.curves.circle_curvature`."""
        bending: Array = formulas.circle_curvature(u, v, self.radius, u_dot, v_dot)
        return bending


class Hyperellipse(Shape):
    """1 − |u/a|ⁿ − |v/b|ⁿ: the forbidden area of experiment 2."""

    name = "hyperellipse"

    def __init__(self, a: float, b: float, n: float = 4.0) -> None:
        self.half_size = np.array([_positive(a, "a"), _positive(b, "b")])
        self.n = _positive(n, "n")
        if n < 2.0:
            raise InvalidInput(f"n of a hyperellipse must be 2 or more for a smooth boundary, not {n}")
        self.ellipse = (float(a), float(b), self.n)
        self.radius = float(self.half_size.min())

    def evaluate(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """Minus :func:`vsconstraints.formulas.curves.superellipse`."""
        value, du, dv = formulas.superellipse(u, v, *self.ellipse)
        return -value, -du, -dv

    def bending(self, u: Array, v: Array, u_dot: Array, v_dot: Array) -> Array:
        """Minus :func:`vsconstraints.formulas.curves.superellipse_curvature`."""
        bending: Array = -formulas.superellipse_curvature(u, v, *self.ellipse, u_dot, v_dot)
        return bending


class Bowl(Shape):
    """1 − r⁻² (w² u² + (v − u²)²): the narrow U of eq. (45), whose parabola is in raw pixels; r = 45, w = 0.7."""

    name = "bowl"

    def __init__(self, radius: float = 45.0, width: float = 0.7) -> None:
        self.radius, self.width = _positive(radius, "radius"), _positive(width, "width")

    def evaluate(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """See :func:`vsconstraints.formulas.curves.bowl`."""
        return formulas.bowl(u, v, self.radius, self.width)

    def bending(self, u: Array, v: Array, u_dot: Array, v_dot: Array) -> Array:
        """See :func:`vsconstraints.formulas.curves.bowl_curvature`."""
        bending: Array = formulas.bowl_curvature(u, v, self.radius, self.width, u_dot, v_dot)
        return bending


class Heart(Shape):
    """1 − r⁻² (w² u² + (v − |u|)²): eq. (46); r = 35, w = 0.8.

    Not differentiable at u = 0: its boundary has a concave corner at (0, r) and a convex one at (0, −r). There the
    gradient is the mean of both sides.
    """

    name = "heart"

    def __init__(self, radius: float = 35.0, width: float = 0.8) -> None:
        self.radius, self.width = _positive(radius, "radius"), _positive(width, "width")

    def evaluate(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """See :func:`vsconstraints.formulas.curves.heart`."""
        return formulas.heart(u, v, self.radius, self.width)

    def bending(self, u: Array, v: Array, u_dot: Array, v_dot: Array) -> Array:
        """See :func:`vsconstraints.formulas.curves.heart_curvature`."""
        bending: Array = formulas.heart_curvature(u, v, self.radius, self.width, u_dot, v_dot)
        return bending


SHAPES: dict[str, type[Shape]] = {shape.name: shape for shape in (Circle, Hyperellipse, Bowl, Heart)}
"""Shapes by the name scenario files use."""


def shape(name: str, **parameters: float) -> Shape:
    """The shape of that name; raises ConfigurationError that names the candidates."""
    if name not in SHAPES:
        raise unknown_name("shape", name, SHAPES)
    return SHAPES[name](**parameters)


class Curve:
    """A shape put somewhere in the image.

    Parameters
    ----------
    shape
        What.
    centre
        (2,) where its origin is, from the image's centre [px].
    rotation
        By how much it is turned about its origin, u towards v [rad].
    """

    def __init__(self, shape: Shape, centre: Sequence[float] = (0.0, 0.0), rotation: float = 0.0) -> None:
        self.shape, self.centre = shape, vector(centre, 2, f"centre of {shape.name}")
        if not np.isfinite(rotation):
            raise InvalidInput(f"rotation of {shape.name} must be finite")
        self.rotation = float(rotation)
        c, s = np.cos(rotation), np.sin(rotation)
        self._R = np.array([[c, -s], [s, c]])

    def value(self, pixels: Array) -> Array:
        """(...) value at pixels (..., 2) from the image's centre."""
        return self.shape.value((pixels - self.centre) @ self._R)

    def gradient(self, pixels: Array) -> Array:
        """(..., 2) ∂value/∂(u, v)."""
        gradient: Array = self.shape.gradient((pixels - self.centre) @ self._R) @ self._R.T
        return gradient

    def curvature(self, pixels: Array, velocity: Array) -> Array:
        """(...) ẏᵀ H ẏ at pixels y (..., 2) from the image's centre that move with ẏ (..., 2)."""
        local, moving = (pixels - self.centre) @ self._R, velocity @ self._R
        return self.shape.bending(local[..., 0], local[..., 1], moving[..., 0], moving[..., 1])


def _positive(value: float, what: str) -> float:
    if not (np.isfinite(value) and value > 0.0):
        raise InvalidInput(f"{what} of a shape must be positive, not {value}")
    return float(value)
