"""Distances of many points to polylines, by loops that are about 100 times slower uncompiled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..rows import Array, IntArray
from . import formula

BLOCK = 8  #: Number of vertices in a block, of blocks in a group, and of groups in a region.
SLACK = 1.0 + 1e-9  #: Margin for the rounding of bounds.


def prepared(
    lines: Sequence[Array],
) -> tuple[Array, Array, Array, Array, IntArray, IntArray, Array]:
    """Arrays that :func:`search` needs for polylines (p, 2).

    All vertices; chords of blocks, groups and regions of them; the vertices before and after each
    vertex, or itself at an end; and a quarter of the squared length of the longest segment (1,).
    """
    vertices = np.ascontiguousarray(np.concatenate(lines), dtype=np.float64)
    ends = np.cumsum([len(line) for line in lines])
    after = np.arange(1, len(vertices) + 1)
    before = np.arange(-1, len(vertices) - 1)
    after[ends - 1] = ends - 1
    starts = np.concatenate(([0], ends[:-1]))
    before[starts] = starts
    chords = [_chords(vertices, BLOCK**level) for level in (1, 2, 3)]
    longest = 0.25 * ((vertices[after] - vertices) ** 2).sum(axis=1).max(initial=0.0, keepdims=True)
    return vertices, chords[0], chords[1], chords[2], before, after, longest


def _chords(vertices: Array, size: int) -> Array:
    """Chords (b, 6) of blocks of the given size.

    Columns: first vertex, vector to the last vertex, 1/length² of the chord, and greatest distance
    of the block's vertices from the chord.
    """
    starts = np.arange(0, len(vertices), size)
    first = vertices[starts]
    last = vertices[np.minimum(starts + size, len(vertices)) - 1]
    block = np.arange(len(vertices)) // size
    a = first[block]
    along = (last - first)[block]
    inverse = 1.0 / np.maximum(((last - first) ** 2).sum(axis=1), 1e-300)
    share = ((vertices - a) * along).sum(axis=1) * inverse[block]
    away = np.sqrt(((vertices - a - np.clip(share, 0.0, 1.0)[:, None] * along) ** 2).sum(axis=1))
    return np.column_stack((first, last - first, inverse, np.maximum.reduceat(away, starts)))


@formula
def to_segment(u: float, v: float, a: float, b: float, c: float, d: float) -> float:
    """Squared distance of (u, v) to the segment from (a, b) to (c, d)."""
    x = c - a
    y = d - b
    s = ((u - a) * x + (v - b) * y) / max(x * x + y * y, 1e-300)
    s = min(max(s, 0.0), 1.0)
    x = u - a - s * x
    y = v - b - s * y
    return x * x + y * y


@formula
def may_hold(chords: Array, i: int, u: float, v: float, bound: float) -> bool:
    """True if a block may contain a vertex within the bound."""
    limit = (bound + chords[i, 5]) * SLACK
    x = u - chords[i, 0]
    y = v - chords[i, 1]
    dx = chords[i, 2]
    dy = chords[i, 3]
    s = min(max((x * dx + y * dy) * chords[i, 4], 0.0), 1.0)
    x = x - s * dx
    y = y - s * dy
    return bool(x * x + y * y <= limit * limit)


@formula
def to_neighbours(
    vertices: Array, before: IntArray, after: IntArray, k: int, u: float, v: float
) -> float:
    """Squared distance of (u, v) to the two segments at a vertex."""
    x = vertices[k, 0]
    y = vertices[k, 1]
    i = before[k]
    j = after[k]
    squared = to_segment(u, v, x, y, vertices[i, 0], vertices[i, 1])
    return min(squared, to_segment(u, v, x, y, vertices[j, 0], vertices[j, 1]))


@formula
def search(
    points: Array, lines: tuple[Any, ...], stride: int, nearest: IntArray, found: Array
) -> None:
    """Write the distances of points (k, 2) to the lines of :func:`prepared` to ``found`` (k,).

    A vertex of the closest segment is written to ``nearest``. The segment nearest to a
    point has one end no farther than √(distance² + (length/2)²). With the length of the longest
    segment, only vertices up to there matter, with the segments at them. Consecutive vertices form
    blocks along chords, and only blocks that may contain such a vertex are searched. The search
    starts at the vertex found ``stride`` points before, which belongs to the same marker.
    """
    vertices, blocks, groups, regions, before, after, longest = lines
    beyond = longest[0]
    count = len(vertices)
    for i in range(len(points)):
        u = points[i, 0]
        v = points[i, 1]
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
                            least = squared
                            at = k
                            reach = (least + beyond) * SLACK
                            bound = np.sqrt(reach)
        nearest[i] = at
        found[i] = np.sqrt(least)
