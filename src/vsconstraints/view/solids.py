"""Meshes of simple solids: spheres and round bars, joined to larger ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..constraints.meshes import Mesh
from ..rows import Array


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return one or more meshes as one."""
    points = []
    triangles = []
    point_count = 0
    for mesh in meshes:
        points.append(mesh.points)
        triangles.append(mesh.triangles + point_count)
        point_count += len(mesh.points)
    return Mesh(np.concatenate(points), np.concatenate(triangles))


def grid_surface(points: Array) -> Mesh:
    """Return the surface through a grid of points (a, b, 3)."""
    a, b, _ = points.shape
    numbers = np.arange(a * b).reshape(a, b)
    above = numbers[:-1]
    below = numbers[1:]
    # corners of each cell
    top_left = above[:, :-1]
    top_right = above[:, 1:]
    bottom_left = below[:, :-1]
    bottom_right = below[:, 1:]
    # each cell is two triangles, on both sides of its diagonal
    upper = np.stack((top_left, top_right, bottom_right), axis=-1)
    lower = np.stack((top_left, bottom_right, bottom_left), axis=-1)
    triangles = np.concatenate((upper, lower))
    return Mesh(points.reshape(-1, 3), triangles.reshape(-1, 3))


def ball(centre: Array, radius: float, count: int = 16) -> Mesh:
    """Return a sphere with ``count`` meridians."""
    polar = np.linspace(0.0, np.pi, count // 2 + 1)
    azimuth = np.linspace(0.0, 2.0 * np.pi, count + 1)
    theta, phi = np.meshgrid(polar, azimuth, indexing="ij")
    rho = np.sin(theta)
    directions = np.empty((*theta.shape, 3))
    directions[..., 0] = rho * np.cos(phi)
    directions[..., 1] = rho * np.sin(phi)
    directions[..., 2] = np.cos(theta)
    return grid_surface(centre + radius * directions)


def bar(begin: Array, end: Array, radius: float, sides: int = 12) -> Mesh:
    """Return a straight round bar between two points (3,)."""
    return tube(np.array([begin, end]), radius, sides)


def tube(points: Array, radius: float, sides: int = 12, caps: bool = True) -> Mesh:
    """Return a round bar along a polyline (p, 3)."""
    along = _unit(np.gradient(points, axis=0))
    # all sections are oriented by the direction in which the line extends least
    _, _, directions = np.linalg.svd(along)
    least = directions[2]
    x = _unit(np.cross(along, least))
    y = np.cross(along, x)
    numbers = np.arange(sides + 1)
    angles = 2.0 * np.pi * numbers / sides
    cos = np.cos(angles)[:, None]
    sin = np.sin(angles)[:, None]
    sections = cos * x[:, None] + sin * y[:, None]
    surface = points[:, None] + radius * sections
    if caps:
        # sections of radius 0 at both ends
        one_at_each_end = ((1, 1), (0, 0), (0, 0))
        closed = np.pad(surface, one_at_each_end)
        closed[0] = points[0]
        closed[-1] = points[-1]
        surface = closed
    return grid_surface(surface)


def _unit(vectors: Array) -> Array:
    """Return vectors (p, 3) scaled to length 1."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: Array = vectors / np.maximum(lengths, 1e-12)
    return unit
