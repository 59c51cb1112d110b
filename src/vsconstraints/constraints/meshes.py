"""Solids of coal as triangle meshes, convex solids and patches.

They serve for figures, occluders, distances and link points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import coal
import numpy as np

from ..errors import ConfigurationError
from ..robots.geometry import Pose
from ..rows import Array, IntArray

#: Sides of the prism that replaces a cylinder, and facets of a cylinder's side.
SIDES = 32
BALL_POINTS = 300  #: Points on a sphere: their convex hull is 1 % smaller.
ENDLESS = 1e3  #: Distance from its frame beyond which a geometry is unbounded [m].
STEPS = 100  #: Steps from inside a region to its surface, each as long as the depth there.


@dataclass(frozen=True)
class Mesh:
    """Triangle mesh: points (V, 3) [m] and triangles (F, 3), which are indices of points."""

    points: Array
    triangles: IntArray

    def moved(self, pose: Pose) -> Mesh:
        """Return the mesh in the frame to which ``pose``, its own pose, refers."""
        return Mesh(pose.act(self.points), self.triangles)


def mesh_of(geometry: coal.CollisionGeometry, reach: float = np.inf) -> Mesh | None:
    """Return a geometry of coal as a mesh in its own frame, or None if it is unbounded.

    Triangle meshes are kept, and solids become their convex hull. A half-space becomes a square of
    half side ``reach`` [m] of its boundary, or None if ``reach`` is not finite.
    """
    if isinstance(geometry, coal.BVHModelBase):
        vertices = np.array(geometry.vertices())
        triangles = [_corners(geometry.tri_indices(k)) for k in range(geometry.num_tris)]
        return Mesh(vertices, np.array(triangles, dtype=np.int64).reshape(-1, 3))
    if isinstance(geometry, coal.Halfspace):
        return _square(geometry, reach) if np.isfinite(reach) else None
    points = hull_points(geometry)
    return None if points is None else hull(points)


def _corners(triangle: Sequence[int]) -> tuple[int, int, int]:
    """Return the indices of a triangle's corners; a triangle of coal has no length."""
    return triangle[0], triangle[1], triangle[2]


def _square(plane: coal.Halfspace, reach: float) -> Mesh:
    """Return a square of half side ``reach`` [m] of a half-space's boundary."""
    normal = np.array(plane.n)
    least_aligned = int(np.argmin(np.abs(normal)))
    x = np.cross(normal, np.eye(3)[least_aligned])
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    centre = plane.d * normal
    corners = []
    for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        corners.append(centre + reach * (a * x + b * y))
    triangles = [[0, 1, 2], [0, 2, 3]]
    return Mesh(np.array(corners), np.array(triangles))


def hull_points(solid: coal.CollisionGeometry) -> Array | None:
    """Return points (V, 3) whose convex hull is the solid, in its own frame; None if unbounded."""
    if isinstance(solid, coal.Convex):
        return np.asarray(solid.points())
    if isinstance(solid, coal.Sphere):
        return np.asarray(solid.radius * _ball().points)
    if isinstance(solid, coal.Capsule):
        up = np.array([0.0, 0.0, solid.halfLength])
        ball: Array = solid.radius * _ball().points
        return np.concatenate([ball + up, ball - up])
    if isinstance(solid, coal.Cylinder):
        return np.asarray(convex(solid, "cylinder").points())
    solid.computeLocalAABB()
    box = solid.aabb_local
    ends = np.array([box.min_, box.max_])
    if not (np.abs(ends) < ENDLESS).all():
        return None
    corners = np.meshgrid(*ends.T, indexing="ij")
    return np.stack(corners, axis=-1).reshape(-1, 3)


def convex(geometry: coal.CollisionGeometry, name: str) -> coal.CollisionGeometry:
    """Return a solid that contains the given one and whose distances coal computes reliably.

    Distances are reliable inside, too. A mesh becomes its convex hull, because a mesh is hollow. A
    cylinder becomes the circumscribed prism of :data:`SIDES` sides, which is 0.5 % wider: coal's
    iterations converge slowly on a round side, and inside they often do not end at the shortest way
    out. All other geometries are returned unchanged.
    """
    if isinstance(geometry, coal.Cylinder):
        angle = 2.0 * np.pi / SIDES * np.arange(SIDES)
        radius = geometry.radius / np.cos(np.pi / SIDES)
        half = np.full(SIDES, geometry.halfLength)
        x = radius * np.cos(angle)
        y = radius * np.sin(angle)
        upper = np.stack((x, y, half), axis=1)
        lower = np.stack((x, y, -half), axis=1)
        corners = np.concatenate((upper, lower))
    elif isinstance(geometry, coal.BVHModelBase):
        corners = np.asarray(geometry.vertices())
    else:
        return geometry
    try:
        return _hull(corners)
    except (RuntimeError, ValueError):
        raise ConfigurationError(
            f"{name} has no convex hull: are its corners in one plane?"
        ) from None


def hull(points: Array) -> Mesh:
    """Return the convex hull of points (V, 3); the mesh keeps all points."""
    solid = _hull(points)
    number = {tuple(point): i for i, point in enumerate(points.tolist())}
    corners = np.asarray(solid.points()).tolist()
    number_of_corner = np.array([number[tuple(corner)] for corner in corners])
    faces = np.array([_corners(solid.polygons(k)) for k in range(solid.num_polygons)])
    return Mesh(points, number_of_corner[faces])


def _hull(points: Array) -> coal.CollisionGeometry:
    every = coal.StdVec_Vec3s()
    for point in points:
        every.append(point)
    return coal.Convex.convexHull(every, True, "Qt")


def traced(depth: Callable[[Array], Array]) -> Mesh | None:
    """Return the surface around the origin on which a signed depth is zero.

    The surface is traced as far as it is visible from the origin. ``depth`` gives distances (V,) to
    the surface [m] at points (V, 3), positive inside. None if the origin is not inside, or if the
    surface is not closed around it.
    """
    ball = _ball()
    away = np.zeros((len(ball.points), 1))
    for _ in range(STEPS):
        away = away + depth(away * ball.points)[:, None]
        if not ((away > 0.0) & (away < ENDLESS)).all():
            return None
    return Mesh(away * ball.points, ball.triangles)


@lru_cache(maxsize=1)
def _ball() -> Mesh:
    """Return points evenly on the unit sphere: along a spiral, by the golden angle."""
    k = np.arange(BALL_POINTS) + 0.5
    z = 1.0 - 2.0 * k / BALL_POINTS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    x = radius * np.cos(turn)
    y = radius * np.sin(turn)
    return hull(np.stack([x, y, z], axis=1))


def surface(geometry: coal.CollisionGeometry, longest: float) -> tuple[Array, float]:
    """Return patches (p, c, 3) of a surface, each the hull of c corners, and their slack [m].

    The patches cover the surface within this distance. Triangles of a mesh are kept, cylinders are
    cut into facets, and all other geometries become the boxes around them. Edges longer than
    ``longest`` [m] are divided.
    """
    if isinstance(geometry, coal.BVHModelBase):
        mesh = mesh_of(geometry)
        assert mesh is not None
        return _divided(mesh.points[mesh.triangles], longest), 0.0
    if isinstance(geometry, coal.Sphere):
        return np.zeros((1, 1, 3)), float(geometry.radius)
    if isinstance(geometry, coal.Cylinder):
        slack = geometry.radius * (1.0 - float(np.cos(np.pi / SIDES)))
        triangles = _cylinder(geometry.radius, geometry.halfLength)
        return _divided(triangles, longest), slack
    if isinstance(geometry, coal.Capsule):
        half = geometry.halfLength
        count = 2 + int(2.0 * half / longest)
        z = np.linspace(-half, half, count)
        zeros = np.zeros_like(z)
        line = np.stack((zeros, zeros, z), axis=1)
        segments = np.stack((line[:-1], line[1:]), axis=1)
        return segments, float(geometry.radius)
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    return _cells(np.array(box.min_), np.array(box.max_), longest), 0.0


def _cells(low: Array, high: Array, longest: float) -> Array:
    """Return the corners (c, 8, 3) of the cells into which a box is divided."""
    ends = []
    for a, b in zip(low, high, strict=True):
        count = max(1, int(np.ceil((b - a) / longest)))
        steps = np.linspace(a, b, 1 + count)
        lower_ends = steps[:-1]
        upper_ends = steps[1:]
        ends.append((lower_ends, upper_ends))
    corners = []
    # the lower (0) or the upper (1) end of every step along x, y and z
    for x, y, z in np.ndindex(2, 2, 2):
        corner = np.meshgrid(ends[0][x], ends[1][y], ends[2][z], indexing="ij")
        coordinates = np.stack(corner, axis=-1)
        corners.append(coordinates.reshape(-1, 3))
    return np.stack(corners, axis=1)


def _cylinder(radius: float, half: float) -> Array:
    """Return triangles (t, 3, 3) between a cylinder's rims and the centres of its ends."""
    angle = 2.0 * np.pi / SIDES * np.arange(SIDES + 1)
    x = np.cos(angle)
    y = np.sin(angle)
    rim = radius * np.stack((x, y, np.zeros_like(angle)), axis=1)
    up = np.array([0.0, 0.0, half])
    # corners of each side, at its beginning and at its end around the axis
    low = (rim - up)[:-1]
    next_low = (rim - up)[1:]
    high = (rim + up)[:-1]
    next_high = (rim + up)[1:]
    centre = np.zeros((SIDES, 3))
    triangles = (
        (low, next_low, high),
        (next_low, next_high, high),
        (low, next_low, centre - up),
        (high, next_high, centre + up),
    )
    return np.concatenate([np.stack(corners, axis=1) for corners in triangles])


def _divided(corners: Array, longest: float) -> Array:
    """Return triangles (t, 3, 3), halved repeatedly until no edge is longer than ``longest``."""
    done = []
    while len(corners):
        to_next = corners - np.roll(corners, -1, axis=1)
        edges = np.linalg.norm(to_next, axis=2)
        long = edges.max(axis=1) > longest
        done.append(corners[~long])
        corners = corners[long]
        edges = edges[long]
        # reordered so that the longest edge is from the first to the second corner
        longest_edge = edges.argmax(axis=1)
        order = (longest_edge[:, None] + np.arange(3)) % 3
        ordered = np.take_along_axis(corners, order[:, :, None], axis=1)
        a, b, c = ordered.transpose(1, 0, 2)
        middle = 0.5 * (a + b)
        first_half = np.stack((a, middle, c), axis=1)
        second_half = np.stack((middle, b, c), axis=1)
        corners = np.concatenate((first_half, second_half))
    return np.concatenate(done)
