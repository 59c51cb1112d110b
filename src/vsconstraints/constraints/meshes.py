"""Solids of coal as triangle meshes, convex solids and patches.

They serve for figures, occluders, distances and link points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import NamedTuple

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
        count = geometry.num_tris
        corners = [_corners(geometry.tri_indices(k)) for k in range(count)]
        triangles = np.array(corners, dtype=np.int64).reshape(-1, 3)
        return Mesh(vertices, triangles)
    if isinstance(geometry, coal.Halfspace):
        return _square(geometry, reach) if np.isfinite(reach) else None
    points = hull_points(geometry)
    if points is None:
        return None
    return hull(points)


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
    corners = [
        centre + reach * (-x - y),
        centre + reach * (x - y),
        centre + reach * (x + y),
        centre + reach * (-x + y),
    ]
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
        prism = convex(solid, "cylinder")
        return np.asarray(prism.points())
    ends = np.array(box_around(solid))
    is_bounded = np.abs(ends) < ENDLESS
    if not is_bounded.all():
        return None
    x_ends, y_ends, z_ends = ends.T
    return _grid_points(x_ends, y_ends, z_ends)


def box_around(geometry: coal.CollisionGeometry) -> tuple[Array, Array]:
    """Return the least and the greatest coordinates (3,) of a geometry in its own frame."""
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    return np.array(box.min_), np.array(box.max_)


def _grid_points(x: Array, y: Array, z: Array) -> Array:
    """Return all points (a · b · c, 3) with coordinates from x (a,), y (b,) and z (c,)."""
    coordinates = np.meshgrid(x, y, z, indexing="ij")
    return np.stack(coordinates, axis=-1).reshape(-1, 3)


def convex(geometry: coal.CollisionGeometry, name: str) -> coal.CollisionGeometry:
    """Return a solid that contains the given one and whose distances coal computes reliably.

    Distances are reliable inside, too. A mesh becomes its convex hull, because a mesh is hollow. A
    cylinder becomes the circumscribed prism of :data:`SIDES` sides, which is 0.5 % wider: coal's
    iterations converge slowly on a round side, and inside they often do not end at the shortest way
    out. All other geometries are returned unchanged.
    """
    if isinstance(geometry, coal.Cylinder):
        corners = _prism_around(geometry)
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


def _prism_around(cylinder: coal.Cylinder) -> Array:
    """Return the corners of the prism of :data:`SIDES` sides around a cylinder."""
    cosine, sine = _directions(SIDES)
    radius = cylinder.radius / np.cos(np.pi / SIDES)
    x = radius * cosine
    y = radius * sine
    z = np.full(SIDES, cylinder.halfLength)
    upper = np.column_stack((x, y, z))
    lower = np.column_stack((x, y, -z))
    return np.concatenate((upper, lower))


def _directions(count: int) -> tuple[Array, Array]:
    """Return cosine and sine of so many angles, of which :data:`SIDES` make a whole turn."""
    angle = 2.0 * np.pi / SIDES * np.arange(count)
    return np.cos(angle), np.sin(angle)


def hull(points: Array) -> Mesh:
    """Return the convex hull of points (V, 3); the mesh keeps all points."""
    solid = _hull(points)
    # coal numbers the corners of the hull anew: find the number of each among all points
    number_of_point = {}
    for i, point in enumerate(points.tolist()):
        number_of_point[tuple(point)] = i
    numbers = []
    for corner in np.asarray(solid.points()).tolist():
        numbers.append(number_of_point[tuple(corner)])
    count = solid.num_polygons
    faces = np.array([_corners(solid.polygons(k)) for k in range(count)])
    triangles = np.array(numbers)[faces]
    return Mesh(points, triangles)


def _hull(points: Array) -> coal.CollisionGeometry:
    """Return the convex hull of points (V, 3) as a solid of triangles."""
    vertices = coal.StdVec_Vec3s()
    for point in points:
        vertices.append(point)
    keep_triangles = True
    qhull_options = "Qt"  # triangulated output
    return coal.Convex.convexHull(vertices, keep_triangles, qhull_options)


def traced(depth: Callable[[Array], Array]) -> Mesh | None:
    """Return the surface around the origin on which a signed depth is zero.

    The surface is traced as far as it is visible from the origin. ``depth`` gives distances (V,) to
    the surface [m] at points (V, 3), positive inside. None if the origin is not inside, or if the
    surface is not closed around it.
    """
    ball = _ball()
    distance = np.zeros((len(ball.points), 1))  # from the origin, in the direction of each point
    for _ in range(STEPS):
        remaining = depth(distance * ball.points)
        distance = distance + remaining[:, None]
        is_closed = (distance > 0.0) & (distance < ENDLESS)
        if not is_closed.all():
            return None
    return Mesh(distance * ball.points, ball.triangles)


@lru_cache(maxsize=1)
def _ball() -> Mesh:
    """Return points evenly on the unit sphere: along a spiral, by the golden angle."""
    k = np.arange(BALL_POINTS) + 0.5
    z = 1.0 - 2.0 * k / BALL_POINTS
    # the golden angle, turning backwards
    turn_per_point = np.pi * (1.0 + np.sqrt(5.0))
    turn = turn_per_point * k
    radius = np.sqrt(1.0 - z * z)
    x = radius * np.cos(turn)
    y = radius * np.sin(turn)
    return hull(np.column_stack((x, y, z)))


class Surface(NamedTuple):
    """Surface made of patches (p, c, 3), each the convex hull of c corners [m].

    The patches cover the surface within the ``slack`` [m].
    """

    patches: Array
    slack: float


def surface(geometry: coal.CollisionGeometry, longest: float) -> Surface:
    """Return the surface of a geometry in its own frame.

    Triangles of a mesh are kept, cylinders are cut into facets, a sphere is its centre and a
    capsule its axis, with the radius as slack. All other geometries become the boxes around them.
    Edges longer than ``longest`` [m] are divided.
    """
    if isinstance(geometry, coal.BVHModelBase):
        mesh = mesh_of(geometry)
        assert mesh is not None
        triangles = mesh.points[mesh.triangles]
        return Surface(_divided(triangles, longest), 0.0)
    if isinstance(geometry, coal.Sphere):
        centre = np.zeros((1, 1, 3))
        return Surface(centre, float(geometry.radius))
    if isinstance(geometry, coal.Cylinder):
        apothem = float(np.cos(np.pi / SIDES))  # of a prism in a cylinder of radius 1
        slack = geometry.radius * (1.0 - apothem)
        triangles = _cylinder(geometry.radius, geometry.halfLength)
        return Surface(_divided(triangles, longest), slack)
    if isinstance(geometry, coal.Capsule):
        half = geometry.halfLength
        count = 2 + int(2.0 * half / longest)
        axis = np.zeros((count, 3))
        axis[:, 2] = np.linspace(-half, half, count)
        begins = axis[:-1]
        ends = axis[1:]
        segments = np.stack((begins, ends), axis=1)
        return Surface(segments, float(geometry.radius))
    low, high = box_around(geometry)
    return Surface(_cells(low, high, longest), 0.0)


def _cells(low: Array, high: Array, longest: float) -> Array:
    """Return the corners (c, 8, 3) of the cells into which a box is divided."""
    ends_by_axis = []
    for a, b in zip(low, high, strict=True):
        needed = int(np.ceil((b - a) / longest))
        steps = np.linspace(a, b, 1 + max(1, needed))
        lower_ends = steps[:-1]
        upper_ends = steps[1:]
        ends_by_axis.append((lower_ends, upper_ends))
    x_ends, y_ends, z_ends = ends_by_axis
    corners = [_grid_points(x, y, z) for x, y, z in product(x_ends, y_ends, z_ends)]
    return np.stack(corners, axis=1)


def _cylinder(radius: float, half: float) -> Array:
    """Return triangles (t, 3, 3) between a cylinder's rims and the centres of its ends."""
    x, y = _directions(SIDES + 1)
    rim = radius * np.column_stack((x, y, np.zeros_like(x)))
    up = np.array([0.0, 0.0, half])
    lower_rim = rim - up
    upper_rim = rim + up
    # corners of each side, at its beginning and at its end around the axis
    low = lower_rim[:-1]
    next_low = lower_rim[1:]
    high = upper_rim[:-1]
    next_high = upper_rim[1:]
    centre = np.zeros((SIDES, 3))
    bottom = centre - up
    top = centre + up
    triangles = [
        np.stack((low, next_low, high), axis=1),
        np.stack((next_low, next_high, high), axis=1),
        np.stack((low, next_low, bottom), axis=1),
        np.stack((high, next_high, top), axis=1),
    ]
    return np.concatenate(triangles)


def _divided(corners: Array, longest: float) -> Array:
    """Return triangles (t, 3, 3), halved repeatedly until no edge is longer than ``longest``."""
    done = []
    while len(corners):
        next_corners = np.roll(corners, -1, axis=1)
        edges = np.linalg.norm(corners - next_corners, axis=2)
        is_long = edges.max(axis=1) > longest
        done.append(corners[~is_long])
        corners = corners[is_long]
        # reordered so that the longest edge is from the first to the second corner
        longest_edge = edges[is_long].argmax(axis=1)
        first_corner = longest_edge[:, None]
        order = (first_corner + np.arange(3)) % 3
        ordered = np.take_along_axis(corners, order[:, :, None], axis=1)
        a, b, c = ordered.transpose(1, 0, 2)
        middle = 0.5 * (a + b)
        first_half = np.stack((a, middle, c), axis=1)
        second_half = np.stack((middle, b, c), axis=1)
        corners = np.concatenate((first_half, second_half))
    return np.concatenate(done)
