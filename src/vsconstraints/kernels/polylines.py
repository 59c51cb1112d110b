"""Distances of many points to polylines, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..rows import Array, IntArray
from .compiler import IN_PLACE, compiled, in_place

BLOCK = 24
"""Vertices that are looked at together, blocks of them, and groups of those likewise."""

SLACK = 1.0 + 1e-9
"""For the rounding of bounds."""


def prepare(vertices: Array, before: IntArray, after: IntArray) -> tuple[Any, ...]:
    """What :func:`distances` needs of polylines.

    Parameters
    ----------
    vertices
        (p, 2) of all of them.
    before, after
        (p,) the vertices at the other ends of each vertex's segments.
    """
    vertices = np.ascontiguousarray(vertices)
    chords = (_chords(vertices, BLOCK**level) for level in (1, 2, 3))
    longest = ((vertices[after] - vertices) ** 2).sum(axis=1).max(initial=0.0)
    return vertices, *chords, before.astype(np.int64), after.astype(np.int64), 0.25 * longest


def distances(points: Array, prepared: tuple[Any, ...], stride: int) -> Array:
    """(k,) distance of points (k, 2) to polylines.

    A segment that is nearest to a point has one of its ends no farther than √(distance² + (length/2)²), so that with
    the longest segment only vertices up to there matter, with the segments at them. Consecutive vertices form blocks,
    each along a chord and not far from it; only blocks that may hold such a vertex are looked at one by one.

    Parameters
    ----------
    points
        Where from.
    prepared
        The polylines, by :func:`prepare`.
    stride
        The vertex found for the point that many before is where the search for a point starts: that of the same
        marker, where the points are those of several markers over time.
    """
    nearest, found = np.empty(len(points), dtype=np.int64), np.empty(len(points))
    vertices, blocks, groups, regions, before, after, beyond = prepared
    points = np.ascontiguousarray(points)
    _search(points, vertices, blocks, groups, regions, before, after, beyond, stride, nearest, found)
    return found


def _chords(vertices: Array, size: int) -> Array:
    """(b, 6) of each block of that size: its first vertex, the way to its last, and how far from that chord it gets.

    The last but one is 1/length² of the chord.
    """
    starts = np.arange(0, len(vertices), size)
    first, last = vertices[starts], vertices[np.minimum(starts + size, len(vertices)) - 1]
    block = np.arange(len(vertices)) // size
    a, along = first[block], (last - first)[block]
    inverse = 1.0 / np.maximum(((last - first) ** 2).sum(axis=1), 1e-300)
    share = ((vertices - a) * along).sum(axis=1) * inverse[block]
    away = np.sqrt(((vertices - a - np.clip(share, 0.0, 1.0)[:, None] * along) ** 2).sum(axis=1))
    return np.column_stack((first, last - first, inverse, np.maximum.reduceat(away, starts)))


@in_place
def to_segment(u: float, v: float, a: float, b: float, c: float, d: float) -> float:
    """Squared distance of (u, v) to the segment from (a, b) to (c, d)."""
    x, y = c - a, d - b
    s = ((u - a) * x + (v - b) * y) / max(x * x + y * y, 1e-300)
    s = min(max(s, 0.0), 1.0)
    x, y = u - a - s * x, v - b - s * y
    return x * x + y * y


@in_place
def may_hold(chords: Array, i: int, u: float, v: float, bound: float) -> bool:
    """Whether a block may hold a vertex within the bound."""
    limit = (bound + chords[i, 5]) * SLACK
    x, y, dx, dy = u - chords[i, 0], v - chords[i, 1], chords[i, 2], chords[i, 3]
    s = min(max((x * dx + y * dy) * chords[i, 4], 0.0), 1.0)
    x, y = x - s * dx, y - s * dy
    return bool(x * x + y * y <= limit * limit)


@in_place
def to_neighbours(vertices: Array, before: IntArray, after: IntArray, k: int, u: float, v: float) -> float:
    """Squared distance of (u, v) to the two segments at a vertex."""
    x, y, i, j = vertices[k, 0], vertices[k, 1], before[k], after[k]
    squared = to_segment(u, v, x, y, vertices[i, 0], vertices[i, 1])
    return min(squared, to_segment(u, v, x, y, vertices[j, 0], vertices[j, 1]))


@compiled(
    "void(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], "
    "int64[::1], int64[::1], float64, int64, int64[::1], float64[::1])",
    IN_PLACE,
)
def _search(
    points: Array,
    vertices: Array,
    blocks: Array,
    groups: Array,
    regions: Array,
    before: IntArray,
    after: IntArray,
    beyond: float,
    stride: int,
    nearest: IntArray,
    found: Array,
) -> None:
    count = len(vertices)
    for i in range(len(points)):
        u, v = points[i, 0], points[i, 1]
        at = nearest[i - stride] if i >= stride else 0
        least = to_neighbours(vertices, before, after, at, u, v)
        reach = (least + beyond) * SLACK
        bound = np.sqrt(reach)
        for r in range(len(regions)):
            if not may_hold(regions, r, u, v, bound):
                continue
            for g in range(r * BLOCK, min((r + 1) * BLOCK, len(groups))):
                if not may_hold(groups, g, u, v, bound):
                    continue
                for b in range(g * BLOCK, min((g + 1) * BLOCK, len(blocks))):
                    if not may_hold(blocks, b, u, v, bound):
                        continue
                    for k in range(b * BLOCK, min((b + 1) * BLOCK, count)):
                        if (vertices[k, 0] - u) ** 2 + (vertices[k, 1] - v) ** 2 > reach:
                            continue
                        squared = to_neighbours(vertices, before, after, k, u, v)
                        if squared < least:
                            least, at = squared, k
                            reach = (least + beyond) * SLACK
                            bound = np.sqrt(reach)
        nearest[i] = at
        found[i] = np.sqrt(least)
