"""Constraints on where markers are in the image."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ..errors import ConfigurationError
from ..rows import Array
from ..vision.scene import PointMotion, Scene, State
from .base import PositionConstraint, RowBlock, Trace, demand_numbers, demand_positive
from .boundary import Polylines, zero_lines
from .by_formula import Form, Keyed


class ImageConstraint(PositionConstraint):
    """A constraint on every marker's pixel coordinates y = (u, v), from the image's centre.

    An own one gives ``kind``, :meth:`sigma` and :meth:`gradient`. ``length`` [px] is the characteristic one;
    ``markers`` are the numbers of those concerned, counted from 1, all if None.
    """

    unit = "px"
    coordinates = 2

    def __init__(self, *, K: float, switching_gain: float, length: float, markers: Sequence[int] | None = None) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        self.length = demand_positive(length, f"length of {self.kind}")
        self.markers = None if markers is None else demand_numbers(markers, f"markers of {self.kind}")
        self._at: slice | Array = slice(None) if self.markers is None else np.array(self.markers) - 1

    def of_markers(self, pixels: Array) -> Array:
        """(r, 2) pixels of the markers concerned, of those of all markers (m, 2)."""
        chosen: Array = pixels[self._at]
        return chosen

    def marker_label(self, number: int) -> str:
        """Label of the row for the marker of that number."""
        return f"{self.kind}[marker {number}]"

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """One row per marker."""
        count = len(scene.markers)
        numbers = self.markers or range(1, count + 1)
        if max(numbers) > count:
            raise ConfigurationError(f"{self.kind}: there is no marker {max(numbers)}; the scene has {count}")
        return tuple(self.marker_label(i) for i in numbers)

    def rows(self, state: State, points: slice) -> RowBlock:
        """Chain rule from pixels to joints (eqs. 21 and 22)."""
        image, at = state.pixels, self._at
        motion = PointMotion(image.position[at], image.J[at], image.velocity[at], image.drift[at])
        return self.chain_rule(self.relative(motion, state))

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """Rows of the formula for the markers concerned."""
        return self.formula_form("image_rows", np.arange(len(scene.markers))[self._at])

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Distance to the curve σ = 0 in the image [px], with the sign of −σ."""
        pixels = self.displaced(trace.pixels[:, self._at], trace.t)
        distance = self._lines(trace.image_size, trace.t).distance(pixels)
        return np.where(self.sigma(pixels) > 0.0, -distance, distance)

    def boundary(self, image_size: tuple[float, float], t: Array | None = None) -> list[Array]:
        """The curve σ = 0 as it is at t = 0, as polylines (p, 2) [px].

        It is looked for in and around the image (W, H) [px] and, if it moves, wherever it is in the image at times t.
        """
        return list(self._lines(image_size, t).lines)

    def _lines(self, image_size: tuple[float, float], t: Array | None = None) -> Polylines:
        """The curve: found anew each time where nobody knows what σ depends on."""
        moved = None if self.motion is None or t is None or not len(t) else self.motion.displacement(t)
        if not self._known:
            return self.found(image_size, moved)
        corners: tuple[tuple[float, ...], ...] = ()
        if moved is not None:  # in halves of the image outwards: the same for nearly the same times
            half = 0.5 * np.asarray(image_size)
            ends = np.floor(moved.min(axis=0) / half) * half, np.ceil(moved.max(axis=0) / half) * half
            corners = tuple(tuple(end.tolist()) for end in ends)
        place = None if self.frame is None else tuple(tuple(part.ravel().tolist()) for part in self.frame)
        said = self.formula, self.parameters, self.margin, place
        return _outline(Keyed((tuple(image_size), corners, *said), self))

    def found(self, image_size: tuple[float, float], moved: Array | None) -> Polylines:
        """The curve wherever it is in the image with these displacements (k, 2)."""
        return Polylines(zero_lines(self.sigma, self.gradient, self._on_grid, image_size, moved))

    @property
    def _known(self) -> bool:
        return self.formula is not None and self.says("formula", ("sigma", "gradient"))

    def _on_grid(self, u: Array, v: Array) -> Array:
        """(b, a) σ on a grid of u (a,) and v (b,): what depends on one of them only is computed as often."""
        if not self._known:
            return self.sigma(np.stack(np.meshgrid(u, v), axis=-1))
        return np.broadcast_to(self.evaluated(u[None, :], v[:, None])[0], (len(v), len(u))) + self.margin


@lru_cache(maxsize=32)
def _outline(curve: Keyed) -> Polylines:
    """The curve of a constraint, which is kept: finding one takes as long as a thousand control steps."""
    constraint: ImageConstraint = curve.of
    image_size, corners = curve.key[:2]
    return constraint.found(image_size, np.array(corners) if corners else None)
