"""Where an implicit curve in the image lies, and how far points are from it: for scores and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import contourpy
import numpy as np
from scipy.spatial import cKDTree

from ..kernels import load
from ..rows import Array, IntArray

STEP = 1.0
"""Distance between the grid points on which a curve is looked for [px]; narrower parts of it may be missed."""

MOST = 8000
"""Grid points a side at most; the grid is coarser for curves that come from farther away."""

SPACING = 0.25
"""Greatest distance between the vertices of a polyline [px]."""

ACCURACY = 1e-3
"""How far a polyline may be from the curve between its vertices [px]."""

AROUND = 1.25
"""How far around the image a curve is looked for, relative to the image's half size."""


def zero_lines(
    sigma: Callable[[Array], Array],
    gradient: Callable[[Array], Array],
    image_size: tuple[float, float],
    displacements: Array | None = None,
) -> list[Array]:
    """Polylines (p, 2) along σ = 0 in and around the image, their vertices moved onto the curve [px].

    A curve that moves is looked for wherever it gets into the image.

    Parameters
    ----------
    sigma, gradient
        σ (...) and ∂σ/∂(u, v) (..., 2) at pixels (..., 2) from the image's centre.
    image_size
        (W, H) [px].
    displacements
        (k, 2) of the curve [px]; none if it stands still. The lines are where it is without them.
    """
    half = 0.5 * AROUND * np.asarray(image_size)
    moved = np.zeros((1, 2)) if displacements is None else displacements
    low, high = -half - moved.max(axis=0), half - moved.min(axis=0)
    counts = np.minimum(np.ceil((high - low) / STEP), MOST).astype(int) + 1
    u, v = (np.linspace(a, b, count) for a, b, count in zip(low, high, counts, strict=True))
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    lines = contourpy.contour_generator(u, v, sigma(grid)).lines(0.0)
    return [_refined(_onto_curve(np.asarray(line), sigma, gradient), sigma, gradient) for line in lines]


def _refined(line: Array, sigma: Callable[[Array], Array], gradient: Callable[[Array], Array]) -> Array:
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


def _onto_curve(line: Array, sigma: Callable[[Array], Array], gradient: Callable[[Array], Array]) -> Array:
    """Three Newton steps along the gradient; none longer than half the grid's, so that corners stay in place."""
    for _ in range(3):
        g = gradient(line)
        squared = np.maximum((g * g).sum(axis=1), 1e-300)
        step = -(sigma(line) / squared)[:, None] * g
        length = np.sqrt((step * step).sum(axis=1, keepdims=True))
        line = line + step * np.minimum(1.0, 0.5 * STEP / np.maximum(length, 1e-300))
    return line


def distance_to_lines(points: Array, lines: Sequence[Array]) -> Array:
    """(...) distance of points (..., 2) to the nearest of some polylines [px]; infinite if there is none.

    All segments near a point count, not only those at the nearest vertex: in a concave corner another may be nearer.
    """
    if not lines or not points.size:
        return np.full(points.shape[:-1], np.inf)
    flat = points.reshape(-1, 2)
    compiled = load("polylines")
    if compiled is not None:
        stride = points.shape[-2] if points.ndim > 2 else 1
        found: Array = compiled.distances(flat, _prepared(lines), stride)
        return found.reshape(points.shape[:-1])
    vertices, before, after = _neighbours(lines)
    tree = cKDTree(vertices)
    # one end of the nearest segment is no farther than √(distance² + (length/2)²)
    longest = np.sqrt(((vertices[after] - vertices) ** 2).sum(axis=1).max())
    reach = np.hypot(tree.query(flat)[0], 0.5 * longest) * (1.0 + 1e-9)
    close = tree.query_ball_point(flat, reach)
    at, k = np.repeat(np.arange(len(flat)), [len(ends) for ends in close]), np.concatenate(close).astype(np.int64)
    distance = np.full(len(flat), np.inf)
    for other in (after, before):
        np.minimum.at(distance, at, _distance_to_segments(flat[at], vertices[k], vertices[other[k]]))
    return distance.reshape(points.shape[:-1])


REMEMBERED = 64
"""Curves of which what the search needs is kept."""

_kept: dict[tuple[int, ...], tuple[Sequence[Array], Any]] = {}


def _prepared(lines: Sequence[Array]) -> Any:
    """What the compiled search needs of some polylines; kept if they cannot change."""
    key = tuple(id(line) for line in lines)
    if key in _kept:
        return _kept[key][1]
    prepared = load("polylines").prepare(*_neighbours(lines))
    if not any(line.flags.writeable for line in lines):
        if len(_kept) >= REMEMBERED:
            _kept.pop(next(iter(_kept)))
        # with the lines themselves, so that no others get their identities
        _kept[key] = tuple(lines), prepared
    return prepared


def _neighbours(lines: Sequence[Array]) -> tuple[Array, IntArray, IntArray]:
    """(p, 2) all vertices, and (p,) the ones before and after each."""
    vertices = np.concatenate(lines)
    ends = np.cumsum([len(line) for line in lines])
    after = np.arange(1, len(vertices) + 1)
    before = np.arange(-1, len(vertices) - 1)
    # a polyline's ends have one neighbour only: the missing one is the vertex itself
    after[ends - 1] = ends - 1
    starts = np.concatenate(([0], ends[:-1]))
    before[starts] = starts
    return vertices, before, after


def _distance_to_segments(p: Array, a: Array, b: Array) -> Array:
    along = b - a
    length = np.maximum((along * along).sum(axis=1), 1e-300)
    s = np.clip(((p - a) * along).sum(axis=1) / length, 0.0, 1.0)
    away = p - a - s[:, None] * along
    distance: Array = np.sqrt((away * away).sum(axis=1))
    return distance
