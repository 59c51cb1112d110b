"""Triangle meshes: what pictures draw of a constraint in space, and what hides markers in rendered images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import coal
import numpy as np

from ..errors import ConfigurationError
from ..robots.geometry import Pose
from ..rows import Array, IntArray

SIDES = 32
"""Of the prism that stands for a cylinder."""

BALL_POINTS = 300
"""On a sphere: their convex hull is 1 % smaller."""

ENDLESS = 1e3
"""What reaches farther from its frame is unbounded [m]."""

STEPS = 100
"""From inside a region to its surface, each as long as the depth there."""


@dataclass(frozen=True)
class Mesh:
    """Points (V, 3) [m] and triangles (F, 3), which are indices of points."""

    points: Array
    triangles: IntArray

    def moved(self, pose: Pose) -> Mesh:
        """The same in the frame that ``pose`` (of its own frame) is given in."""
        return Mesh(pose.act(self.points), self.triangles)


def mesh_of(geometry: coal.CollisionGeometry, reach: float = np.inf) -> Mesh | None:
    """A geometry of coal as a mesh in its own frame, triangle meshes as they are and solids as their convex hull.

    A half-space is a square of half side ``reach`` [m] of its boundary. None if it is unbounded and ``reach`` is not
    finite.
    """
    if isinstance(geometry, coal.BVHModelBase):
        triangles = [tuple(geometry.tri_indices(k)[j] for j in range(3)) for k in range(geometry.num_tris)]
        return Mesh(np.array(geometry.vertices()), np.array(triangles, dtype=np.int64).reshape(-1, 3))
    if isinstance(geometry, coal.Halfspace):
        normal = np.array(geometry.n)
        return square(reach, normal, geometry.d * normal)
    points = hull_points(geometry)
    return None if points is None else hull(points)


def hull_points(solid: coal.CollisionGeometry) -> Array | None:
    """(V, 3) points in its own frame whose convex hull a solid is; None if it is unbounded."""
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
    ends = np.array([solid.aabb_local.min_, solid.aabb_local.max_])
    if not (np.abs(ends) < ENDLESS).all():
        return None
    return np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(-1, 3)


def convex(geometry: coal.CollisionGeometry, name: str) -> coal.CollisionGeometry:
    """A solid whose distances coal computes reliably, inside too, and which holds the given one.

    A mesh becomes its convex hull: a mesh is hollow, a hull has an inside, so that a penetration has a depth. A
    cylinder becomes the prism of :data:`SIDES` sides around it, which is 0.5 % wider: coal's iterations converge
    slowly on a cylinder's round side, and inside it they often end at another than the shortest way out. Everything
    else stays as it is.
    """
    if isinstance(geometry, coal.Cylinder):
        angle = 2.0 * np.pi / SIDES * np.arange(SIDES)
        radius, half = geometry.radius / np.cos(np.pi / SIDES), np.full(SIDES, geometry.halfLength)
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        corners = np.concatenate((np.stack((x, y, half), axis=1), np.stack((x, y, -half), axis=1)))
    elif isinstance(geometry, coal.BVHModelBase):
        corners = np.asarray(geometry.vertices())
    else:
        return geometry
    points = coal.StdVec_Vec3s()
    for corner in corners:
        points.append(corner)
    try:
        return coal.Convex.convexHull(points, True, "Qt")
    except (RuntimeError, ValueError):
        raise ConfigurationError(f"{name} has no convex hull: are its corners in one plane?") from None


def hull(points: Array) -> Mesh:
    """The convex hull of points (V, 3), all of which stay."""
    every = coal.StdVec_Vec3s()
    for point in points:
        every.append(point)
    made = coal.Convex.convexHull(every, True, "Qt")
    number = {tuple(point): i for i, point in enumerate(points.tolist())}
    own = np.array([number[tuple(point)] for point in np.asarray(made.points()).tolist()])
    triangles = [[made.polygons(k)[j] for j in range(3)] for k in range(made.num_polygons)]
    return Mesh(points, own[np.array(triangles)])


def square(reach: float, normal: Array, point: Array) -> Mesh | None:
    """A square of half side ``reach`` [m] around a point (3,) of a plane; None if that is not finite."""
    if not np.isfinite(reach):
        return None
    x = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    corners = [point + reach * (a * x + b * y) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def traced(depth: Callable[[Array], Array]) -> Mesh | None:
    """The surface around the origin on which a signed depth is zero, as far as it is seen from there.

    ``depth`` gives (V,) distances to the surface [m] at points (V, 3), positive inside. None where the origin is not
    inside, or the surface is not closed around it.
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
    """Points evenly on the unit sphere: along a spiral, by the golden angle."""
    k = np.arange(BALL_POINTS) + 0.5
    z, turn = 1.0 - 2.0 * k / BALL_POINTS, np.pi * (1.0 + np.sqrt(5.0)) * k
    around = np.sqrt(1.0 - z * z)
    return hull(np.stack([around * np.cos(turn), around * np.sin(turn), z], axis=1))
