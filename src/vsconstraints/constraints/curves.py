"""Implicit closed curves in the image around an obstacle.

Their value is positive inside, 0 on the curve and negative outside. A shape is defined about its
origin; :class:`Curve` shifts and rotates it. Positive angles turn u towards v, which is clockwise
in an image whose v points down. :class:`Occlusion` is the constraint to stay outside a curve
(section 4.3.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..errors import ConfigurationError, InvalidInput
from ..formulas import curves as formulas
from ..robots.geometry import Vector2, vector
from .base import require_positive
from .by_formula import ByFormula, Formula, require_own_curvature
from .image_constraint import ImageConstraint


class Shape(ByFormula):
    """Implicit curve about its origin, with a name for labels and files and a radius [px].

    Coordinates are in pixels.
    """

    name: ClassVar[str]
    radius: float
    coordinates = 2

    def __post_init__(self) -> None:
        vars(self).update(
            {
                name: require_positive(value, f"{name} of a shape")
                for name, value in vars(self).items()
            }
        )
        self.parameters = tuple(vars(self).values())


@dataclass(eq=False)
class Circle(Shape):
    """Circle 1 − ‖p‖²/r²."""

    name = "circle"
    formula = staticmethod(formulas.circle)
    curvature_formula = staticmethod(formulas.circle_curvature)
    radius: float


@dataclass(eq=False)
class Hyperellipse(Shape):
    """Hyperellipse 1 − |u/a|ⁿ − |v/b|ⁿ: the forbidden area of experiment 2."""

    name = "hyperellipse"
    formula = staticmethod(formulas.hyperellipse)
    curvature_formula = staticmethod(formulas.hyperellipse_curvature)
    a: float
    b: float
    n: float = 4.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.n < 2.0:
            raise InvalidInput(
                f"n of a hyperellipse must be 2 or more for a smooth boundary, not {self.n}"
            )
        self.radius = min(self.a, self.b)


@dataclass(eq=False)
class Bowl(Shape):
    """Narrow U of eq. (45), 1 − r⁻² (w² u² + (v − u²)²); r = 45, w = 0.7.

    Its parabola is in raw pixels.
    """

    name = "bowl"
    formula = staticmethod(formulas.bowl)
    curvature_formula = staticmethod(formulas.bowl_curvature)
    radius: float = 45.0
    width: float = 0.7


@dataclass(eq=False)
class Heart(Shape):
    """Heart of eq. (46), 1 − r⁻² (w² u² + (v − |u|)²); r = 35, w = 0.8.

    It is not differentiable at u = 0: its boundary has a concave corner at (0, r) and a convex one
    at (0, −r). There the gradient is the mean of both sides.
    """

    name = "heart"
    formula = staticmethod(formulas.heart)
    curvature_formula = staticmethod(formulas.heart_curvature)
    radius: float = 35.0
    width: float = 0.8


#: Shapes by their name in scenario files.
SHAPES: dict[str, type[Shape]] = {
    shape.name: shape for shape in (Circle, Hyperellipse, Bowl, Heart)
}


class Curve(ByFormula):
    """A shape at a place in the image.

    ``centre_px`` (2,) is the position of its origin from the image's centre [px]; ``rotation`` is
    the rotation about this origin, from u towards v [rad].
    """

    coordinates = 2

    def __init__(
        self, shape: Shape, centre_px: Vector2 = (0.0, 0.0), rotation: float = 0.0
    ) -> None:
        require_own_curvature(type(shape))
        self.shape = shape
        self.centre = vector(centre_px, 2, f"centre of {shape.name}")
        if not np.isfinite(rotation):
            raise InvalidInput(f"rotation of {shape.name} must be finite")
        self.rotation = float(rotation)
        c = np.cos(rotation)
        s = np.sin(rotation)
        self.frame = np.array([[c, -s], [s, c]]), self.centre
        self.formula = shape.formula
        self.curvature_formula = shape.curvature_formula
        self.parameters = shape.parameters


class Occlusion(ImageConstraint):
    """Constraint that keeps markers outside an implicit curve in the image.

    σ is the value of the ``curve``, positive inside, plus ``margin``. A bare shape is placed at the
    image's centre. K is the approach time constant [s] and ``switching_gain`` is u⁺ [1/s]. The
    obstacle's ``name`` in labels is the shape's if empty. ``markers`` are the numbers of the
    markers concerned, counted from 1, all if None.
    """

    kind = "occlusion"
    formula: Formula | None = None
    """Formula of the curve."""

    def __init__(
        self,
        curve: Curve | Shape,
        *,
        K: float,
        switching_gain: float,
        margin: float = 0.0,
        name: str = "",
        markers: Sequence[int] | None = None,
    ) -> None:
        self.curve = curve if isinstance(curve, Curve) else Curve(curve)
        if not np.isfinite(margin):
            raise ConfigurationError(f"margin of {self.kind} must be finite, not {margin}")
        self.margin = float(margin)
        self.formula = self.curve.formula
        self.curvature_formula = self.curve.curvature_formula
        self.parameters = self.curve.parameters
        self.frame = self.curve.frame
        self.name = name or self.curve.shape.name
        super().__init__(
            K=K, switching_gain=switching_gain, length=self.curve.shape.radius, markers=markers
        )

    def marker_label(self, number: int) -> str:
        """Return a label such as ``occlusion[bowl, marker 1]``."""
        return f"{self.kind}[{self.name}, marker {number}]"
