"""The vertex nearest to each of many points."""

from __future__ import annotations

import numpy as np

from ..rows import Array, IntArray
from .compiler import compiled

BLOCK = 32
"""Vertices that are looked at together."""


def nearest_vertices(points: Array, vertices: Array) -> IntArray:
    """(k,) index of the vertex (p, 2) nearest to each point (k, 2).

    Consecutive vertices form blocks, each within a circle about one of its vertices. Only blocks whose circles may hold
    the nearest vertex are looked at one by one.
    """
    starts = np.arange(0, len(vertices), BLOCK)
    middles = np.minimum(starts + BLOCK // 2, len(vertices) - 1)
    block = np.arange(len(vertices)) // BLOCK
    away = np.sqrt(((vertices - vertices[middles[block]]) ** 2).sum(axis=1))
    reach = np.maximum.reduceat(away, starts)
    nearest = np.empty(len(points), dtype=np.int64)
    _search(np.ascontiguousarray(points), np.ascontiguousarray(vertices), middles.astype(np.int64), reach, nearest)
    return nearest


@compiled("void(float64[:, ::1], float64[:, ::1], int64[::1], float64[::1], int64[::1])")
def _search(points: Array, vertices: Array, middles: IntArray, reach: Array, nearest: IntArray) -> None:
    blocks = len(middles)
    coarse = np.empty(blocks)
    for i in range(len(points)):
        u, v = points[i, 0], points[i, 1]
        best, at = np.inf, 0
        for b in range(blocks):
            k = middles[b]
            d = np.sqrt((vertices[k, 0] - u) ** 2 + (vertices[k, 1] - v) ** 2)
            coarse[b] = d
            if d < best:
                best, at = d, k
        for b in range(blocks):
            if coarse[b] - reach[b] < best:
                for k in range(b * BLOCK, min((b + 1) * BLOCK, len(vertices))):
                    d = np.sqrt((vertices[k, 0] - u) ** 2 + (vertices[k, 1] - v) ** 2)
                    if d < best:
                        best, at = d, k
        nearest[i] = at
