"""Distances of many points to polylines, by loops that are about 100 times slower uncompiled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..rows import Array, IntArray
from . import formula

BLOCK = 8  #: Number of vertices in a block, of blocks in a group, and of groups in a region.
SLACK = 1.0 + 1e-9  #: Margin for the rounding of bounds.
TINY = 1e-300  #: Least divisor, for segments without length.

#: Columns of the chords of blocks: first vertex, vector to the last vertex, 1/length², and greatest
#: distance of the block's vertices from the chord.
FIRST_U, FIRST_V, ALONG_U, ALONG_V, INVERSE, SPREAD = range(6)


def prepared(
    lines: Sequence[Array],
) -> tuple[Array, Array, Array, Array, IntArray, IntArray, Array]:
    """Arrays that :func:`search` needs for polylines (p, 2).

    All vertices; chords of blocks, groups and regions of them; the vertices before and after each
    vertex, or itself at an end; and the squared half length of the longest segment (1,).
    """
    vertices = np.ascontiguousarray(np.concatenate(lines), dtype=np.float64)
    ends = np.cumsum([len(line) for line in lines])
    after = np.arange(1, len(vertices) + 1)
    before = np.arange(-1, len(vertices) - 1)
    after[ends - 1] = ends - 1
    starts = np.concatenate(([0], ends[:-1]))
    before[starts] = starts
    blocks = _chords(vertices, BLOCK)
    groups = _chords(vertices, BLOCK**2)
    regions = _chords(vertices, BLOCK**3)
    segments = vertices[after] - vertices
    squared_lengths = (segments**2).sum(axis=1)
    half_length_squared = 0.25 * squared_lengths.max(initial=0.0, keepdims=True)
    return vertices, blocks, groups, regions, before, after, half_length_squared


def _chords(vertices: Array, size: int) -> Array:
    """Chords (b, 6) of blocks of the given size, with the columns ``FIRST_U`` to ``SPREAD``."""
    starts = np.arange(0, len(vertices), size)
    ends = np.minimum(starts + size, len(vertices))
    first = vertices[starts]
    last = vertices[ends - 1]
    chord = last - first
    squared_length = (chord**2).sum(axis=1)
    inverse = 1.0 / np.maximum(squared_length, TINY)
    # distance of each vertex from the chord of its block
    block = np.arange(len(vertices)) // size
    along = chord[block]
    relative = vertices - first[block]
    projection = (relative * along).sum(axis=1)
    share_of_chord = np.clip(projection * inverse[block], 0.0, 1.0)
    nearest = share_of_chord[:, None] * along
    away = relative - nearest
    distance = np.sqrt((away**2).sum(axis=1))
    spread = np.maximum.reduceat(distance, starts)
    return np.column_stack((first, chord, inverse, spread))


@formula
def to_segment(u: float, v: float, a: float, b: float, c: float, d: float) -> float:
    """Squared distance of (u, v) to the segment from (a, b) to (c, d)."""
    along_u = c - a
    along_v = d - b
    squared_length = along_u * along_u + along_v * along_v
    from_u = u - a
    from_v = v - b
    projection = from_u * along_u + from_v * along_v
    s = projection / max(squared_length, TINY)
    s = min(max(s, 0.0), 1.0)
    away_u = from_u - s * along_u
    away_v = from_v - s * along_v
    return away_u * away_u + away_v * away_v


@formula
def may_hold(chords: Array, i: int, u: float, v: float, bound: float) -> bool:
    """True if a block may contain a vertex within the bound."""
    limit = (bound + chords[i, SPREAD]) * SLACK
    x = u - chords[i, FIRST_U]
    y = v - chords[i, FIRST_V]
    along_u = chords[i, ALONG_U]
    along_v = chords[i, ALONG_V]
    projection = x * along_u + y * along_v
    s = projection * chords[i, INVERSE]
    s = min(max(s, 0.0), 1.0)
    x = x - s * along_u
    y = y - s * along_v
    squared_distance = x * x + y * y
    return bool(squared_distance <= limit * limit)


@formula
def to_neighbours(
    vertices: Array, before: IntArray, after: IntArray, k: int, u: float, v: float
) -> float:
    """Squared distance of (u, v) to the two segments at vertex k."""
    x = vertices[k, 0]
    y = vertices[k, 1]
    x_before = vertices[before[k], 0]
    y_before = vertices[before[k], 1]
    x_after = vertices[after[k], 0]
    y_after = vertices[after[k], 1]
    to_previous = to_segment(u, v, x, y, x_before, y_before)
    to_next = to_segment(u, v, x, y, x_after, y_after)
    return min(to_previous, to_next)


@formula
def squared_reach(least: float, half_length_squared: Array) -> float:
    """Squared distance of the vertices that matter, if the nearest line is at √``least``.

    The end of a segment is no farther than √(least + (length/2)²); see :func:`search`.
    """
    farthest: float = least + half_length_squared[0]
    return farthest * SLACK


@formula
def search_block(
    lines: tuple[Any, ...], block: int, u: float, v: float, nearest: int, least: float
) -> tuple[int, float]:
    """Return the nearest vertex so far and its squared distance, after a search of this block."""
    vertices, _, _, _, before, after, half_length_squared = lines
    reach = squared_reach(least, half_length_squared)
    end = min((block + 1) * BLOCK, len(vertices))
    for k in range(block * BLOCK, end):
        du = vertices[k, 0] - u
        dv = vertices[k, 1] - v
        if du**2 + dv**2 > reach:
            continue
        squared = to_neighbours(vertices, before, after, k, u, v)
        if squared < least:
            nearest = k
            least = squared
            reach = squared_reach(least, half_length_squared)
    return nearest, least


@formula
def search_group(
    lines: tuple[Any, ...], group: int, u: float, v: float, nearest: int, least: float
) -> tuple[int, float]:
    """Return the same as :func:`search_block`, after a search of this group of blocks."""
    _, blocks, _, _, _, _, half_length_squared = lines
    end = min((group + 1) * BLOCK, len(blocks))
    for block in range(group * BLOCK, end):
        bound = np.sqrt(squared_reach(least, half_length_squared))
        if may_hold(blocks, block, u, v, bound):
            nearest, least = search_block(lines, block, u, v, nearest, least)
    return nearest, least


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
    vertices, _, groups, regions, before, after, half_length_squared = lines
    for i in range(len(points)):
        u = points[i, 0]
        v = points[i, 1]
        vertex = nearest[i - stride] if i >= stride else 0
        least = to_neighbours(vertices, before, after, vertex, u, v)
        for region in range(len(regions)):
            bound = np.sqrt(squared_reach(least, half_length_squared))
            if not may_hold(regions, region, u, v, bound):
                continue
            end = min((region + 1) * BLOCK, len(groups))
            for group in range(region * BLOCK, end):
                bound = np.sqrt(squared_reach(least, half_length_squared))
                if may_hold(groups, group, u, v, bound):
                    vertex, least = search_group(lines, group, u, v, vertex, least)
        nearest[i] = vertex
        found[i] = np.sqrt(least)
