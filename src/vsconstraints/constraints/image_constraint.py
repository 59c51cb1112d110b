"""Constraints on where markers are in the image."""

from __future__ import annotations

import pickle
from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..rows import Array
from ..scene import PointMotion, Scene, State
from .base import PositionConstraint, RowBlock, Trace, demand_numbers, demand_positive
from .boundary import distance_to_lines, zero_lines
from .form import Form

REMEMBERED = 64
"""Curves that stand still, of which the polylines are kept: finding one takes as long as a thousand control steps."""

_lines: dict[tuple[type, bytes, tuple[float, ...]], list[Array]] = {}


class ImageConstraint(PositionConstraint):
    """A constraint on every marker's pixel coordinates y = (u, v), from the image's centre.

    An own one gives ``kind``, :meth:`sigma` and :meth:`gradient`, and if it knows better than the defaults
    ``length``, :meth:`curvature`, :meth:`clearance` and :meth:`marker_label`.

    Parameters
    ----------
    length
        Characteristic length [px]: an obstacle's radius, or half an allowed range.
    markers
        Numbers of the markers concerned, counted from 1; all if None.
    """

    unit = "px"
    coordinates = 2

    def __init__(self, *, K: float, switching_gain: float, length: float, markers: Sequence[int] | None = None) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        demand_positive(length, f"length of {self.kind}")
        self.length = float(length)
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
        image = state.pixels
        if self.markers is not None:
            at = self._at
            image = PointMotion(image.position[at], image.J[at], image.velocity[at], image.drift[at])
        motion = self.relative(image, state)
        y = motion.position
        return self.chain_rule(self.sigma(y), self.gradient(y), self.curvature(y, motion.velocity), motion)

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """Rows of the formula for the markers concerned."""
        return self.formula_form("image_rows", np.arange(len(scene.markers))[self._at])

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Distance to the curve σ = 0 in the image [px], with the sign of −σ."""
        pixels = self.displaced(trace.pixels[:, self._at], trace.t)
        distance = distance_to_lines(pixels, self.boundary(trace.image_size, trace.t))
        return np.where(self.sigma(pixels) > 0.0, -distance, distance)

    def boundary(self, image_size: tuple[float, float], t: Array | None = None) -> list[Array]:
        """The curve σ = 0 as it is at t = 0, as polylines (p, 2) [px].

        It is looked for in and around the image (W, H) [px] and, if it moves, wherever it is in the image at times t.
        """
        moved = None if self.motion is None or t is None or not len(t) else self.motion.displacement(t)
        if moved is not None:
            return zero_lines(self.sigma, self.gradient, image_size, moved)
        try:
            key = (type(self), pickle.dumps(vars(self)), tuple(image_size))
        except Exception:  # own constraints may hold anything
            return zero_lines(self.sigma, self.gradient, image_size)
        if key not in _lines:
            if len(_lines) >= REMEMBERED:
                _lines.pop(next(iter(_lines)))
            _lines[key] = zero_lines(self.sigma, self.gradient, image_size)
            for line in _lines[key]:
                line.setflags(write=False)
        return list(_lines[key])

    def characteristic_length(self, scene: Scene) -> Array:
        """The same length for every marker."""
        return np.full(len(self.labels(scene)), self.length)
