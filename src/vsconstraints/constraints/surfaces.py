"""Surfaces of solids as patches, so small that what covers their corners covers them."""

from __future__ import annotations

import coal
import numpy as np

from ..rows import Array

FACETS = 32
"""Into how many facets a cylinder's side is cut."""


def surface(geometry: coal.CollisionGeometry, longest: float) -> tuple[Array, float]:
    """Patches (p, c, 3), each the hull of c corners, and a distance [m] within which they cover the surface.

    Parameters
    ----------
    geometry
        Triangles of a mesh are used as they are, cylinders are cut into facets, everything else into the boxes around
        it.
    longest
        Edges longer than this [m] are divided.
    """
    if isinstance(geometry, coal.BVHModelBase):
        return _divided(triangles(geometry), longest), 0.0
    if isinstance(geometry, coal.Sphere):
        return np.zeros((1, 1, 3)), float(geometry.radius)
    if isinstance(geometry, coal.Cylinder):
        return _divided(_cylinder(geometry.radius, geometry.halfLength), longest), geometry.radius * (
            1.0 - float(np.cos(np.pi / FACETS))
        )
    if isinstance(geometry, coal.Capsule):
        z = np.linspace(-geometry.halfLength, geometry.halfLength, 2 + int(2.0 * geometry.halfLength / longest))
        line = np.stack((np.zeros_like(z), np.zeros_like(z), z), axis=1)
        return np.stack((line[:-1], line[1:]), axis=1), float(geometry.radius)
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    low, high = np.array(box.min_), np.array(box.max_)
    steps = [np.linspace(a, b, 1 + max(1, int(np.ceil((b - a) / longest)))) for a, b in zip(low, high, strict=True)]
    # the lower or the upper end of every step, along each axis: the eight corners of all cells
    ends = [(step[:-1], step[1:]) for step in steps]
    corners = [
        np.stack(np.meshgrid(*(pair[i] for pair, i in zip(ends, corner, strict=True)), indexing="ij"), axis=-1)
        for corner in np.ndindex(2, 2, 2)
    ]
    return np.stack([corner.reshape(-1, 3) for corner in corners], axis=1), 0.0


def triangles(mesh: coal.BVHModelBase) -> Array:
    """(t, 3, 3) corners of a mesh's triangles [m]."""
    indices = [mesh.tri_indices(i) for i in range(mesh.num_tris)]
    corners: Array = np.asarray(mesh.vertices())[np.array([[t[0], t[1], t[2]] for t in indices])]
    return corners


def _cylinder(radius: float, half: float) -> Array:
    """(t, 3, 3) triangles between corners on a cylinder's rims and its ends' centres."""
    angle = 2.0 * np.pi / FACETS * np.arange(FACETS + 1)
    rim = radius * np.stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)), axis=1)
    up = np.array([0.0, 0.0, half])
    low, high, centre = rim - up, rim + up, np.zeros((FACETS, 3))
    return np.concatenate(
        [
            np.stack((low[:-1], low[1:], high[:-1]), axis=1),
            np.stack((low[1:], high[1:], high[:-1]), axis=1),
            np.stack((low[:-1], low[1:], centre - up), axis=1),
            np.stack((high[:-1], high[1:], centre + up), axis=1),
        ]
    )


def _divided(corners: Array, longest: float) -> Array:
    """The same triangles (t, 3, 3) with those halved, again and again, that have an edge longer than ``longest``."""
    done = []
    while len(corners):
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = edges.max(axis=1) > longest
        done.append(corners[~long])
        corners, edges = corners[long], edges[long]
        # turned so that the longest edge is from the first to the second corner
        order = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(corners, order[:, :, None], axis=1).transpose(1, 0, 2)
        middle = 0.5 * (a + b)
        corners = np.concatenate((np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)))
    return np.concatenate(done)
