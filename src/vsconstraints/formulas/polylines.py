"""Distances of many points to polylines, by loops that are about 100 times slower uncompiled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..rows import Array, IntArray
from . import formula

BLOCK = 8  #: Number of vertices in a block, of blocks in a group, and of groups in a region.
SLACK = 1.0 + 1e-9  #: Margin for the rounding of bounds.
TINY = 1e-300  #: Least divisor, for segments without length.

#: Columns of the chords of blocks: first vertex, vector to the last vertex, 1/length², and greatest
#: distance of the block's vertices from the chord.
FIRST_U, FIRST_V, ALONG_U, ALONG_V, INVERSE, SPREAD = range(6)


class PreparedLines(NamedTuple):
    """Arrays that :func:`search` needs for polylines of p vertices in all."""

    vertices: Array  #: (p, 2).
    #: Chords (b, 6) of blocks of vertices, of groups of blocks and of regions of groups.
    blocks: Array
    groups: Array
    regions: Array
    before: IntArray  #: (p,) vertex before each one; itself at the beginning of a line.
    after: IntArray  #: (p,) vertex after each one; itself at the end of a line.
    half_length_squared: Array  #: (1,) squared half length of the longest segment.


def prepared(lines: Sequence[Array]) -> PreparedLines:
    """Arrays that :func:`search` needs for lines of vertices, (p, 2) each."""
    vertices = np.ascontiguousarray(np.concatenate(lines), dtype=np.float64)
    ends = np.cumsum([len(line) for line in lines])
    first = np.concatenate(([0], ends[:-1]))
    last = ends - 1
    after = np.arange(1, len(vertices) + 1)
    after[last] = last
    before = np.arange(-1, len(vertices) - 1)
    before[first] = first
    segments = vertices[after] - vertices
    squared_lengths = (segments**2).sum(axis=1)
    longest = squared_lengths.max(initial=0.0, keepdims=True)
    return PreparedLines(
        vertices=vertices,
        blocks=_chords(vertices, BLOCK),
        groups=_chords(vertices, BLOCK**2),
        regions=_chords(vertices, BLOCK**3),
        before=before,
        after=after,
        half_length_squared=0.25 * longest,
    )


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
    distance = np.linalg.norm(away, axis=1)
    spread = np.maximum.reduceat(distance, starts)
    columns = (first, chord, inverse, spread)
    return np.column_stack(columns)


@formula
def squared_distance_at(
    share: float, from_u: float, from_v: float, along_u: float, along_v: float
) -> float:
    """Squared distance of a point to the point of a segment at a share of it, at most at its ends.

    From the start of the segment, (from_u, from_v) leads to the point and (along_u, along_v) to the
    end of the segment.
    """
    share = min(max(share, 0.0), 1.0)
    away_u = from_u - share * along_u
    away_v = from_v - share * along_v
    squared_distance: float = away_u * away_u + away_v * away_v
    return squared_distance


@formula
def to_segment(u: float, v: float, start: Array, end: Array) -> float:
    """Squared distance of (u, v) to the segment between two vertices (2,)."""
    along_u = end[0] - start[0]
    along_v = end[1] - start[1]
    from_u = u - start[0]
    from_v = v - start[1]
    squared_length = along_u * along_u + along_v * along_v
    projection = from_u * along_u + from_v * along_v
    share = projection / max(squared_length, TINY)
    return squared_distance_at(share, from_u, from_v, along_u, along_v)


@formula
def may_hold(chords: Array, i: int, u: float, v: float, bound: float) -> bool:
    """True if a block may contain a vertex within the bound."""
    limit = (bound + chords[i, SPREAD]) * SLACK
    along_u = chords[i, ALONG_U]
    along_v = chords[i, ALONG_V]
    from_u = u - chords[i, FIRST_U]
    from_v = v - chords[i, FIRST_V]
    projection = from_u * along_u + from_v * along_v
    share = projection * chords[i, INVERSE]
    squared_distance = squared_distance_at(share, from_u, from_v, along_u, along_v)
    return bool(squared_distance <= limit * limit)


@formula
def to_neighbours(
    vertices: Array, before: IntArray, after: IntArray, k: int, u: float, v: float
) -> float:
    """Squared distance of (u, v) to the two segments at vertex k."""
    vertex = vertices[k]
    previous = vertices[before[k]]
    following = vertices[after[k]]
    to_previous = to_segment(u, v, vertex, previous)
    to_following = to_segment(u, v, vertex, following)
    return min(to_previous, to_following)


@formula
def squared_reach(least: float, half_length_squared: Array) -> float:
    """Squared distance of the vertices that matter, if the nearest line is at √``least``.

    The end of a segment is no farther than √(least + (length/2)²); see :func:`search`.
    """
    farthest: float = least + half_length_squared[0]
    return farthest * SLACK


@formula
def may_be_nearer(
    lines: PreparedLines, chords: Array, i: int, u: float, v: float, least: float
) -> bool:
    """True if a block may contain a vertex that matters; see :func:`squared_reach`."""
    reach = np.sqrt(squared_reach(least, lines.half_length_squared))
    return may_hold(chords, i, u, v, reach)


@formula
def search_block(
    lines: PreparedLines, block: int, u: float, v: float, nearest: int, least: float
) -> tuple[int, float]:
    """Return the nearest vertex so far and its squared distance, after a search of this block."""
    vertices = lines.vertices
    reach = squared_reach(least, lines.half_length_squared)
    start = block * BLOCK
    end = min(start + BLOCK, len(vertices))
    for k in range(start, end):
        du = vertices[k, 0] - u
        dv = vertices[k, 1] - v
        squared_distance = du**2 + dv**2
        if squared_distance > reach:
            continue
        squared = to_neighbours(vertices, lines.before, lines.after, k, u, v)
        if squared < least:
            nearest = k
            least = squared
            reach = squared_reach(least, lines.half_length_squared)
    return nearest, least


@formula
def search_group(
    lines: PreparedLines, group: int, u: float, v: float, nearest: int, least: float
) -> tuple[int, float]:
    """Return the same as :func:`search_block`, after a search of this group of blocks."""
    blocks = lines.blocks
    start = group * BLOCK
    end = min(start + BLOCK, len(blocks))
    for block in range(start, end):
        if may_be_nearer(lines, blocks, block, u, v, least):
            nearest, least = search_block(lines, block, u, v, nearest, least)
    return nearest, least


@formula
def search_region(
    lines: PreparedLines, region: int, u: float, v: float, nearest: int, least: float
) -> tuple[int, float]:
    """Return the same as :func:`search_block`, after a search of this region of groups."""
    groups = lines.groups
    start = region * BLOCK
    end = min(start + BLOCK, len(groups))
    for group in range(start, end):
        if may_be_nearer(lines, groups, group, u, v, least):
            nearest, least = search_group(lines, group, u, v, nearest, least)
    return nearest, least


@formula
def search(
    points: Array, arrays: tuple[Any, ...], stride: int, nearest: IntArray, found: Array
) -> None:
    """Write the distances of points (k, 2) to polylines to ``found`` (k,).

    ``arrays`` are those of :class:`PreparedLines`. A vertex of the closest segment is written to
    ``nearest``. The segment nearest to a point has one end no farther than
    √(distance² + (length/2)²). With the length of the longest segment, only vertices up to there
    matter, with the segments at them. Consecutive vertices form blocks along chords, and only
    blocks that may contain such a vertex are searched. The search starts at the vertex found
    ``stride`` points before, which belongs to the same marker.
    """
    # compiled code takes the arrays as a plain tuple
    lines = PreparedLines(*arrays)
    regions = lines.regions
    for i in range(len(points)):
        u = points[i, 0]
        v = points[i, 1]
        vertex = nearest[i - stride] if i >= stride else 0
        least = to_neighbours(lines.vertices, lines.before, lines.after, vertex, u, v)
        for region in range(len(regions)):
            if may_be_nearer(lines, regions, region, u, v, least):
                vertex, least = search_region(lines, region, u, v, vertex, least)
        nearest[i] = vertex
        found[i] = np.sqrt(least)
