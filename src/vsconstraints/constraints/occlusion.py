"""Markers stay out of an area of the image where an obstacle hides them: section 4.3.3."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from .by_formula import Formula
from .curves import Curve, Shape
from .image_constraint import ImageConstraint


class Occlusion(ImageConstraint):
    """Markers stay outside an implicit curve in the image.

    Keeps markers outside an implicit curve: σ is the curve's value, positive inside.

    Parameters
    ----------
    curve
        The curve, or a shape that stands at the image's centre.
    K, switching_gain
        Approach time constant [s] and u⁺ [1/s].
    margin
        σ at which the boundary is drawn instead: the constraint is value + margin ≤ 0.
    name
        Name of the obstacle in labels; the shape's if empty.
    markers
        Numbers of the markers concerned, counted from 1; all if None.
    """

    kind = "occlusion"
    formula: Formula | None = None
    """Of its curve."""

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
        self.formula, self.curvature_formula = self.curve.formula, self.curve.curvature_formula
        self.parameters, self.frame = self.curve.parameters, self.curve.frame
        self.name = name or self.curve.shape.name
        super().__init__(K=K, switching_gain=switching_gain, length=self.curve.shape.radius, markers=markers)

    def marker_label(self, number: int) -> str:
        """For example ``occlusion[bowl, marker 1]``."""
        return f"{self.kind}[{self.name}, marker {number}]"
