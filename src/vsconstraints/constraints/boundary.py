"""Where an implicit curve in the image lies, and how far points are from it: for scores and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import contourpy
import numpy as np

from ..compiled import load
from ..formulas.polylines import prepared
from ..rows import Array

STEP = 1.0  #: Distance between the grid points on which a curve is looked for [px]; narrower parts of it may be missed.
MAX_GRID_POINTS = 8000  #: Grid points a side at most; the grid is coarser for curves that come from farther away.
#: Greatest distance between the vertices of a polyline, and of it from the curve between them [px].
SPACING, ACCURACY = 0.25, 1e-3
AROUND = 1.25  #: How far around the image a curve is looked for, relative to the image's half size.

OfPoints = Callable[[Array], Array]


def zero_lines(
    sigma: OfPoints,
    gradient: OfPoints,
    grid: Callable[[Array, Array], Array],
    image_size: tuple[float, float],
    displacements: Array | None = None,
) -> list[Array]:
    """Polylines (p, 2) along σ = 0 in and around the image (W, H), their vertices moved onto the curve [px].

    σ (...) and ∂σ/∂(u, v) (..., 2) are those at pixels (..., 2) from the image's centre, ``grid`` σ (b, a) on u (a,)
    and v (b,). A curve that moves is looked for wherever its ``displacements`` (k, 2) [px] bring it into the image; the
    lines are where it is without them.
    """
    half = 0.5 * AROUND * np.asarray(image_size)
    moved = np.zeros((1, 2)) if displacements is None else displacements
    low, high = -half - moved.max(axis=0), half - moved.min(axis=0)
    counts = np.minimum(np.ceil((high - low) / STEP), MAX_GRID_POINTS).astype(int) + 1
    u, v = (np.linspace(a, b, count) for a, b, count in zip(low, high, counts, strict=True))
    values = grid(u, v)
    # the part in which σ = 0 is, all cells with a corner where σ > 0: less is faster to follow
    columns, rows = (np.flatnonzero((values > 0.0).any(axis=axis)) for axis in (0, 1))
    if len(columns):
        across, down = (slice(max(at[0] - 1, 0), at[-1] + 2) for at in (columns, rows))
        u, v, values = u[across], v[down], values[down, across]
    lines = contourpy.contour_generator(u, v, values).lines(0.0)
    return [_refined(_onto_curve(np.asarray(line), sigma, gradient), sigma, gradient) for line in lines]


def _refined(line: Array, sigma: OfPoints, gradient: OfPoints) -> Array:
    """Halve segments whose middle is off the curve, until none is or they are as short as :data:`ACCURACY`.

    Where the curve is straight, points are added so that the nearest vertex is next to the nearest point.
    """
    for _ in range(int(np.ceil(np.log2(STEP / ACCURACY)))):
        middle = 0.5 * (line[1:] + line[:-1])
        moved = _onto_curve(middle, sigma, gradient)
        off = np.flatnonzero(np.sqrt(((moved - middle) ** 2).sum(axis=1)) > ACCURACY)
        if not len(off):
            break
        line = np.insert(line, off + 1, moved[off], axis=0)
    along = np.concatenate(([0.0], np.cumsum(np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1)))))
    dense = np.union1d(along, np.arange(0.0, along[-1], SPACING))
    return np.stack([np.interp(dense, along, line[:, i]) for i in (0, 1)], axis=1)


def _onto_curve(line: Array, sigma: OfPoints, gradient: OfPoints) -> Array:
    """Three Newton steps along the gradient; none longer than half the grid's, so that corners stay in place."""
    for _ in range(3):
        g = gradient(line)
        squared = np.maximum((g * g).sum(axis=1), 1e-300)
        step = -(sigma(line) / squared)[:, None] * g
        length = np.sqrt((step * step).sum(axis=1, keepdims=True))
        line = line + step * np.minimum(1.0, 0.5 * STEP / np.maximum(length, 1e-300))
    return line


class Polylines:
    """Polylines of vertices (p, 2) [px], and the distance of points to them."""

    def __init__(self, lines: Sequence[Array]) -> None:
        self.lines = tuple(lines)
        self._prepared = prepared(lines) if lines else None

    def distance(self, points: Array) -> Array:
        """(...) distance of points (..., 2) to the nearest polyline [px]; infinite if there is none."""
        flat = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 2)
        nearest, found = np.empty(len(flat), dtype=np.int64), np.full(len(flat), np.inf)
        if self._prepared is not None:
            load("polylines").search(flat, self._prepared, points.shape[-2] if points.ndim > 2 else 1, nearest, found)
        return found.reshape(points.shape[:-1])
