"""Field of view: markers stay in the image (section 4.3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from ..errors import ConfigurationError
from ..formulas import curves as formulas
from ..formulas.lenses import MODELS
from ..rows import Array
from ..vision.camera import Camera
from .base import Trace, require_positive
from .by_formula import Formula
from .image_constraint import ImageConstraint


class FieldOfView(ImageConstraint):
    """Constraint that keeps markers inside a hyperellipse in the image.

    The boundary is |u/a|ⁿ + |v/b|ⁿ = 1 (eqs. 20 to 24). If the lens has distortion, this is a curve
    on the sensor, which is bent in ideal pixels; clearances are then distances on the sensor.

    ``margin`` is a fraction of the image, a = W/2 (1 − margin). ``margin_px`` is the alternative in
    pixels, a = W/2 − margin_px; the same holds for b. n controls smoothness: 2 is an ellipse, large
    values approximate the rectangle. K is the approach time constant [s] and ``switching_gain`` is
    u⁺ [1/s]. ``markers`` are the numbers of the markers concerned, counted from 1, all if None.
    Raises ConfigurationError if the margin leaves no image, or leaves a part in which the lens
    cannot be inverted.

    Whoever changes the formula gives this class another one, and leaves ``superellipse`` as it is:
    ``hyperellipse``, the formula of an obstacle, calls it. These change with it:

    - ``formula`` and ``curvature_formula``, in :mod:`vsconstraints.formulas.curves`, and
      ``parameters`` below;
    - ``superellipse_on_sensor`` in :mod:`vsconstraints.formulas.lenses`, the formula through each
      lens, which calls that one;
    - ``_can_invert_lens``, which finds the boundary from the value on a rectangle;
    - :mod:`vsconstraints.simulation.start`, for which a field of view is convex and inside the
      image, and the areas ``AROUND`` there and in :mod:`.image_constraint`, which are searched;
    - adapters of stacks, which keep markers in the rectangle ``half_size``
      (:mod:`vsconstraints.stacks.description`).
    """

    kind = "fov"
    formula = staticmethod(formulas.superellipse)
    curvature_formula: Formula | None = staticmethod(formulas.superellipse_curvature)

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
            raise ConfigurationError(
                "fov takes a margin as a fraction (margin) or in pixels (margin_px), not both"
            )
        half = 0.5 * np.asarray(camera.size, dtype=np.float64)
        self.half_size: Array = half * (1.0 - (margin or 0.0))
        if margin_px is not None:
            self.half_size = half - margin_px
        is_part = (self.half_size > 0.0) & (self.half_size <= half)
        if not is_part.all():
            raise ConfigurationError(
                f"the fov margin must leave a part of the image: 0 ≤ margin < 1, or 0 ≤ margin_px "
                f"< {half.min():g}"
            )
        self.n = require_positive(n, "n of fov")
        if n < 2.0:
            raise ConfigurationError(f"n of fov must be 2 or more for a smooth boundary, not {n}")
        self.parameters = (*self.half_size.tolist(), self.n)
        length = float(self.half_size.min())
        super().__init__(K=K, switching_gain=switching_gain, length=length, markers=markers)
        self._camera = camera
        self._on_sensor: FieldOfView | None = None
        if camera.distortion is not None:
            self._require_invertible_lens(half)
            self._on_sensor = copy(self)
            self.formula = MODELS[camera.distortion.model].superellipse
            self.curvature_formula = None
            self.parameters = (*self.parameters, *camera.eye)

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return the distance to the hyperellipse [px], on the sensor."""
        if self._on_sensor is None:
            return super().clearance(trace, points)
        on_sensor = replace(trace, pixels=self._camera.distort(trace.pixels))
        return self._on_sensor.clearance(on_sensor, points)

    def boundary(self, image_size: tuple[float, float], t: Array | None = None) -> list[Array]:
        """Return the hyperellipse as polylines (p, 2) of ideal pixels."""
        if self._on_sensor is None:
            return super().boundary(image_size, t)
        lines = self._on_sensor.boundary(self._camera.size_px, t)
        return [self._camera.undistort(line) for line in lines]

    def _require_invertible_lens(self, half: Array) -> None:
        """Raise ConfigurationError, with a margin that is enough, if the lens cannot be inverted.

        ``half`` (2,) is half the size of the image [px].
        """
        if self._can_invert_lens(self.half_size):
            return
        remedy = "no margin is enough"
        for margin_px in np.arange(1.0, half.min()):
            if self._can_invert_lens(half - margin_px):
                remedy = f"margin_px = {margin_px:g} is enough"
                break
        raise ConfigurationError(
            f"the lens cannot be inverted in all of the image that fov leaves, only up to "
            f"{self._camera.reach_px:.0f} px from the principal point: {remedy}"
        )

    def _can_invert_lens(self, half: Array) -> bool:
        """True if the lens can be inverted on the hyperellipse of half axes (2,) [px]."""
        assert self._camera.distortion is not None
        turn = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
        direction = np.stack((np.cos(turn), np.sin(turn)), axis=-1)
        # on the rectangle |u/a|ⁿ + |v/b|ⁿ is between 1 and 2, so that no n makes it vanish, and it
        # falls with the n-th power of the distance from the centre
        relative = np.abs(direction / half)
        on_rectangle = direction / relative.max(axis=-1, keepdims=True)
        u, v = on_rectangle.T
        a, b = half
        value, _, _ = formulas.superellipse(u, v, a, b, self.n)
        share = (1.0 + value) ** (-1.0 / self.n)
        boundary = on_rectangle * share[:, None]
        normalised = self._camera.normalised(boundary)
        _, certain = self._camera.distortion.remove(normalised)
        return bool(certain.all())
