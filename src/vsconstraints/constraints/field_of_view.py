"""Markers stay in the image: section 4.3.2."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..camera import Camera
from ..errors import ConfigurationError
from ..formulas import curves as formulas
from ..rows import Array
from .base import demand_positive
from .image_constraint import ImageConstraint


class FieldOfView(ImageConstraint):
    """Markers stay inside a hyperellipse in the image.

    Keeps markers inside a hyperellipse |u/a|ⁿ + |v/b|ⁿ = 1 in the image (eqs. 20 to 24).

    Parameters
    ----------
    camera
        Whose image.
    K, switching_gain
        Approach time constant [s] and u⁺ [1/s].
    margin
        Safety margin as a fraction of the image: a = W/2 (1 − margin), b = H/2 (1 − margin).
    margin_px
        Safety margin in pixels instead: a = W/2 − margin_px, b = H/2 − margin_px.
    n
        Smoothing: 2 is an ellipse, large values come close to the rectangle.
    markers
        Numbers of the markers concerned, counted from 1; all if None.
    """

    kind = "fov"
    formula = staticmethod(formulas.superellipse)
    curvature_formula = staticmethod(formulas.superellipse_curvature)

    def __init__(
        self,
        camera: Camera,
        *,
        K: float,
        switching_gain: float,
        margin: float | None = None,
        margin_px: float | None = None,
        n: float = 16.0,
        markers: Sequence[int] | None = None,
    ) -> None:
        if margin is not None and margin_px is not None:
            raise ConfigurationError("fov takes a margin as a fraction (margin) or in pixels (margin_px), not both")
        half = 0.5 * np.asarray(camera.size, dtype=np.float64)
        self.half_size: Array = half - margin_px if margin_px is not None else half * (1.0 - (margin or 0.0))
        if not ((self.half_size > 0.0) & (self.half_size <= half)).all():
            raise ConfigurationError(
                f"the fov margin must leave a part of the image: 0 ≤ margin < 1, or 0 ≤ margin_px < {half.min():g}"
            )
        demand_positive(n, "n of fov")
        if n < 2.0:
            raise ConfigurationError(f"n of fov must be 2 or more for a smooth boundary, not {n}")
        self.n = float(n)
        self.parameters = (*self.half_size.tolist(), self.n)
        super().__init__(K=K, switching_gain=switching_gain, length=float(self.half_size.min()), markers=markers)
