"""Constraints on marker positions in the image, and their boundary curves.

The curves serve for scores and figures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import contourpy
import numpy as np

from ..compiled import load
from ..errors import ConfigurationError
from ..formulas.polylines import TINY, prepared
from ..rows import Array, BoolArray, IntArray
from ..vision.scene import PointMotion, Scene, State
from .base import PositionConstraint, RowBlock, Trace, require_numbers, require_positive
from .by_formula import CompiledRowSpec, Keyed

#: Spacing of the grid on which a curve is searched for [px]; narrower parts may be missed.
STEP = 1.0
#: Total number of grid points, 0.1 GB of σ; enough for 3840 × 2160 px, with a coarser grid beyond.
MAX_POINTS = 13_000_000
#: Maximum number of grid points per side; the grid is coarser for curves that come from farther
#: away.
MAX_GRID_POINTS = 8000
#: Largest distance between the vertices of a polyline, and between a polyline and its curve [px].
SPACING = 0.25
ACCURACY = 1e-3
AROUND = 1.25  #: Size of the area in which a curve is searched for, relative to the image.

OfPoints = Callable[[Array], Array]


class ImageConstraint(PositionConstraint):
    """Constraint on the pixel coordinates y = (u, v) of every marker, from the image's centre.

    A custom constraint defines ``kind``, :meth:`sigma` and :meth:`gradient`. ``length`` [px] is its
    characteristic length. ``markers`` are the numbers of the markers concerned, counted from 1, all
    if None.
    """

    unit = "px"
    coordinates = 2

    def __init__(
        self,
        *,
        K: float,
        switching_gain: float,
        length: float,
        markers: Sequence[int] | None = None,
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        self.length = require_positive(length, f"length of {self.kind}")
        self.markers: tuple[int, ...] | None = None
        self._selection: slice | IntArray = slice(None)  # indices of the markers concerned
        if markers is not None:
            self.markers = require_numbers(markers, f"markers of {self.kind}")
            self._selection = np.array(self.markers) - 1

    def of_markers(self, pixels: Array) -> Array:
        """Return the pixels (r, 2) of the markers concerned, from those of all markers (m, 2)."""
        selected: Array = pixels[self._selection]
        return selected

    def marker_label(self, number: int) -> str:
        """Return the label of the row for the marker of that number."""
        return f"{self.kind}[marker {number}]"

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """Return the labels, one per marker."""
        count = len(scene.markers)
        numbers = self.markers or range(1, count + 1)
        largest = max(numbers)
        if largest > count:
            raise ConfigurationError(
                f"{self.kind}: there is no marker {largest}; the scene has {count}"
            )
        return tuple(self.marker_label(i) for i in numbers)

    def rows(self, state: State, points: slice) -> RowBlock:
        """Return the rows by the chain rule from pixels to joints (eqs. 21 and 22)."""
        image = state.pixels
        selection = self._selection
        motion = PointMotion(
            image.position[selection],
            image.J[selection],
            image.velocity[selection],
            image.drift[selection],
        )
        relative_motion = self.relative(motion, state)
        return self.chain_rule(relative_motion)

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return the compiled form of the formula for the markers concerned."""
        from ..compiled.constraint_rows import image_rows

        all_markers = np.arange(len(scene.markers))
        return self.formula_form(image_rows, all_markers[self._selection])

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return the distance to the curve σ = 0 in the image [px], with the sign of −σ."""
        pixels = self.displaced(trace.pixels[:, self._selection], trace.t)
        curve = self._curve(trace.image_size, trace.t)
        distance = curve.distance(pixels)
        return np.where(self.sigma(pixels) > 0.0, -distance, distance)

    def boundary(self, image_size: tuple[float, float], t: Array | None = None) -> list[Array]:
        """Return the curve σ = 0 at t = 0, as polylines (p, 2) [px].

        It is searched for in and around the image (W, H) [px]. If it moves, it is searched for
        wherever it is in the image at times t.
        """
        return list(self._curve(image_size, t).lines)

    def _curve(self, image_size: tuple[float, float], t: Array | None = None) -> Polylines:
        """Return the curve; it is cached unless the dependencies of σ are unknown."""
        displacements = None
        if self.motion is not None and t is not None and len(t):
            displacements = self.motion.displacement(t)
        if not self._formula_gives_sigma:
            return self.search_curve(image_size, displacements)
        extremes = _extremes(displacements, image_size)
        frame: tuple[float, ...] = ()
        if self.frame is not None:
            R, origin = self.frame
            frame = (*R.ravel().tolist(), *origin.tolist())
        dependencies = self.formula, self.parameters, self.margin, frame
        key = (tuple(image_size), extremes, *dependencies)
        return _cached_curve(Keyed(key, self))

    def search_curve(
        self, image_size: tuple[float, float], displacements: Array | None
    ) -> Polylines:
        """Return the curve wherever these displacements (k, 2) place it in the image."""
        lines = zero_lines(self.sigma, self.gradient, self._on_grid, image_size, displacements)
        return Polylines(lines)

    @property
    def _formula_gives_sigma(self) -> bool:
        return self.formula is not None and self.declares("formula", ("sigma", "gradient"))

    def _on_grid(self, u: Array, v: Array) -> Array:
        """Return σ (b, a) on a grid of u (a,) and v (b,).

        Parts that depend on only one of them are computed once per row or column.
        """
        if not self._formula_gives_sigma:
            points = np.stack(np.meshgrid(u, v), axis=-1)
            return self.sigma(points)
        value = self.evaluated(u[None, :], v[:, None])[0]
        shape = len(v), len(u)
        return np.broadcast_to(value, shape) + self.margin


def _extremes(
    displacements: Array | None, image_size: tuple[float, float]
) -> tuple[tuple[float, ...], ...]:
    """Return the least and the greatest displacement (2,); nothing of a curve that stands still.

    They are rounded outwards to halves of the image, so that similar times share an entry of the
    cache.
    """
    if displacements is None:
        return ()
    half = 0.5 * np.asarray(image_size)
    least = displacements.min(axis=0)
    greatest = displacements.max(axis=0)
    low = np.floor(least / half) * half
    high = np.ceil(greatest / half) * half
    return tuple(low.tolist()), tuple(high.tolist())


@lru_cache(maxsize=32)
def _cached_curve(curve: Keyed) -> Polylines:
    """Return the curve of a constraint.

    It is cached, because finding one takes as long as a thousand control steps.
    """
    constraint: ImageConstraint = curve.of
    image_size, extremes, *_ = curve.key
    displacements = np.array(extremes) if extremes else None
    return constraint.search_curve(image_size, displacements)


def zero_lines(
    sigma: OfPoints,
    gradient: OfPoints,
    grid: Callable[[Array, Array], Array],
    image_size: tuple[float, float],
    displacements: Array | None = None,
) -> list[Array]:
    """Return polylines (p, 2) along σ = 0 in and around the image (W, H) [px].

    Their vertices are moved onto the curve. σ (...) and ∂σ/∂(u, v) (..., 2) are functions of pixels
    (..., 2) from the image's centre; ``grid`` gives σ (b, a) on u (a,) and v (b,). A moving curve
    is searched for wherever its ``displacements`` (k, 2) [px] bring it into the image; the lines
    are those without displacement.
    """
    u, v = _search_grid(image_size, displacements)
    values = grid(u, v)
    outside: BoolArray = values > 0.0
    if outside.any():
        # a smaller part is faster to follow
        columns = _range_with_neighbours(np.any(outside, axis=0))
        rows = _range_with_neighbours(np.any(outside, axis=1))
        u = u[columns]
        v = v[rows]
        values = values[rows, columns]
    lines = []
    contours = contourpy.contour_generator(u, v, values)
    for line in contours.lines(0.0):
        on_curve = _onto_curve(np.asarray(line), sigma, gradient)
        lines.append(_refined(on_curve, sigma, gradient))
    return lines


def _search_grid(
    image_size: tuple[float, float], displacements: Array | None
) -> tuple[Array, Array]:
    """Return u (a,) and v (b,) of the grid on which a curve is searched for."""
    half = 0.5 * AROUND * np.asarray(image_size)
    low = -half
    high = half
    if displacements is not None:
        # a curve displaced by d is in the image where the one at rest is in the image less d
        low = -half - displacements.max(axis=0)
        high = half - displacements.min(axis=0)
    steps = np.ceil((high - low) / STEP)
    steps = np.minimum(steps, MAX_GRID_POINTS)
    counts = steps.astype(int) + 1
    excess = float(counts.prod()) / MAX_POINTS
    if excess > 1.0:
        fewer = counts / math.sqrt(excess)
        counts = fewer.astype(int)
    u = np.linspace(low[0], high[0], counts[0])
    v = np.linspace(low[1], high[1], counts[1])
    return u, v


def _range_with_neighbours(selected: BoolArray) -> slice:
    """Return the range from one before the first to one behind the last that is true."""
    numbers = np.flatnonzero(selected)
    first = numbers[0]
    last = numbers[-1]
    return slice(max(first - 1, 0), last + 2)


def _refined(line: Array, sigma: OfPoints, gradient: OfPoints) -> Array:
    """Return the line with segments halved whose middle is off the curve.

    Segments are halved until all are within :data:`ACCURACY` of the curve, or that short. On
    straight parts, points are added so that the nearest vertex is next to the nearest point.
    """
    most_halvings = int(np.ceil(np.log2(STEP / ACCURACY)))
    for _ in range(most_halvings):
        middle = 0.5 * (line[1:] + line[:-1])
        on_curve = _onto_curve(middle, sigma, gradient)
        distance = np.linalg.norm(on_curve - middle, axis=1)
        off = np.flatnonzero(distance > ACCURACY)
        if not len(off):
            break
        line = np.insert(line, off + 1, on_curve[off], axis=0)
    segments = np.diff(line, axis=0)
    lengths = np.linalg.norm(segments, axis=1)
    # arc lengths of the vertices, and of those with points in between
    arc = np.concatenate(([0.0], np.cumsum(lengths)))
    every_spacing = np.arange(0.0, arc[-1], SPACING)
    dense = np.union1d(arc, every_spacing)
    u = np.interp(dense, arc, line[:, 0])
    v = np.interp(dense, arc, line[:, 1])
    return np.column_stack((u, v))


def _onto_curve(line: Array, sigma: OfPoints, gradient: OfPoints) -> Array:
    """Return the line after three Newton steps along the gradient.

    No step is longer than half the grid spacing, so that corners stay in place.
    """
    longest = 0.5 * STEP
    for _ in range(3):
        g = gradient(line)
        squared = np.maximum((g * g).sum(axis=1), TINY)
        newton_factor = -(sigma(line) / squared)
        step = newton_factor[:, None] * g
        squared_length = (step * step).sum(axis=1, keepdims=True)
        length = np.sqrt(squared_length)
        shortening = np.minimum(1.0, longest / np.maximum(length, TINY))
        line = line + step * shortening
    return line


class Polylines:
    """Polylines of vertices (p, 2) [px], and the distance of points to them."""

    def __init__(self, lines: Sequence[Array]) -> None:
        self.lines = tuple(lines)
        self._prepared = tuple(prepared(lines)) if lines else None

    def distance(self, points: Array) -> Array:
        """Return the distance (...) of points (..., 2) to the nearest polyline [px].

        It is infinite if there is none.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        flat = points.reshape(-1, 2)
        distances = np.full(len(flat), np.inf)
        if self._prepared is not None:
            nearest = np.empty(len(flat), dtype=np.int64)
            # a marker's nearest vertex is near that of its previous sample
            stride = points.shape[-2] if points.ndim > 2 else 1
            load("polylines").search(flat, self._prepared, stride, nearest, distances)
        return distances.reshape(points.shape[:-1])
