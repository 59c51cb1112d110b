"""What stands in the robot's way, as bodies of glass."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np

from ...constraints import (
    Collision,
    Constraint,
    ForbiddenBox,
    ForbiddenCapsule,
    ForbiddenCylinder,
    ForbiddenHalfSpace,
    ForbiddenRegion,
    ForbiddenSphere,
)
from ...constraints.forbidden_region import frame_along
from ...robots.geometry import Pose
from ...rows import Array
from ...simulation import Setup
from ..plots.mesh import Mesh

GLASS = "#F0A20266"


def add_obstacles(mesh: Mesh, setup: Setup, t: float, size: float) -> None:
    """Forbidden regions and bodies of a setup where they are at ``t`` [s]; ``size`` is half of what is shown [m]."""
    for constraint in setup.constraints.constraints:
        add_obstacle(mesh, constraint, t, size)


def add_obstacle(mesh: Mesh, constraint: Constraint, t: float, size: float) -> None:
    """What a constraint forbids in space, if it does."""
    if isinstance(constraint, ForbiddenRegion):
        moved = np.zeros(3) if constraint.motion is None else constraint.motion.displacement(t)
        _region(mesh, constraint, Pose(constraint.pose.R, constraint.pose.t + moved), size)
    elif isinstance(constraint, Collision):
        for placement, solid in constraint.pairs[0][1].parts:
            _solid(mesh, solid, Pose(np.array(placement.rotation), np.array(placement.translation)), size)


def _region(mesh: Mesh, region: Any, at: Pose, size: float) -> None:
    if isinstance(region, ForbiddenSphere):
        mesh.ball(at.t, region.radius, GLASS, 20)
    elif isinstance(region, ForbiddenBox):
        _box(mesh, 0.5 * region.size, at)
    elif isinstance(region, ForbiddenCapsule | ForbiddenCylinder):
        radius, half = region.parameters
        _bar(mesh, half, radius, at, round_ends=isinstance(region, ForbiddenCapsule))
    elif isinstance(region, ForbiddenHalfSpace):
        _plane(mesh, size, at)


def _solid(mesh: Mesh, solid: coal.CollisionGeometry, at: Pose, size: float) -> None:
    """A solid of coal; the box around it where it is of another kind."""
    if isinstance(solid, coal.Sphere):
        mesh.ball(at.t, solid.radius, GLASS, 20)
    elif isinstance(solid, coal.Capsule):
        _bar(mesh, solid.halfLength, solid.radius, at, round_ends=True)
    elif isinstance(solid, coal.Halfspace):
        _plane(mesh, size, at @ Pose(frame_along(np.array(solid.n)), solid.d * np.array(solid.n)))
    elif isinstance(solid, coal.Convex):
        corners = np.asarray(solid.points())
        for k in range(solid.num_polygons):
            triangle = solid.polygons(k)
            mesh.add(at.act(corners[[triangle[0], triangle[1], triangle[2]]]), GLASS)
    else:
        solid.computeLocalAABB()
        low, high = np.array(solid.aabb_local.min_), np.array(solid.aabb_local.max_)
        _box(mesh, 0.5 * (high - low), at @ Pose(np.eye(3), 0.5 * (high + low)))


def _plane(mesh: Mesh, size: float, at: Pose) -> None:
    """A part of the plane z = 0 of a frame."""
    corners = 0.8 * size * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    mesh.add(at.act(corners), GLASS, shaded=False)


def _bar(mesh: Mesh, half: float, radius: float, at: Pose, round_ends: bool) -> None:
    """A cylinder or a capsule along the z axis of a frame."""
    ends = at.act(np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]))
    mesh.tube(ends, radius, GLASS, 20)
    for end in ends if round_ends else ():
        mesh.ball(end, radius, GLASS, 16)


def _box(mesh: Mesh, half: Array, at: Pose) -> None:
    """A box around the origin of a frame, of half sizes (3,)."""
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for axis in range(3):
        for side in (-1.0, 1.0):
            mesh.add(at.act(np.insert(corners, axis, side, axis=1) * half), GLASS)
