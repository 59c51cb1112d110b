"""What stands before the tags of a scene: the arm's own links, bodies that it must not touch, forbidden regions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import coal
import numpy as np
import pinocchio as pin

from ..constraints import (
    Body,
    BodyDistance,
    Collision,
    Constraint,
    ForbiddenBox,
    ForbiddenCapsule,
    ForbiddenCylinder,
    ForbiddenRegion,
    ForbiddenSphere,
)
from ..constraints.bodies import convex
from ..errors import ConfigurationError
from ..rows import Array
from ..vision.images.settings import OpaqueName
from ..vision.scene import Scene
from .line_of_sight import LinesOfSight

POINTS = 300
"""On a sphere: their convex hull is 1 % smaller."""

ENDLESS = 1e3
"""What reaches farther from its frame has no end [m]."""


class Opaque:
    """Convex solids of a scene, where they are at an instant.

    Parameters
    ----------
    scene
        Whose arm it is.
    constraints
        With bodies and regions.
    kinds
        What is drawn. Links that move with the tip carry the camera or the tags, and never count.
    """

    def __init__(self, scene: Scene, constraints: Sequence[Constraint], kinds: Sequence[OpaqueName]) -> None:
        self.scene, self._data = scene, scene.robot.model.createData()
        self.bodies = [
            *(_links(scene, constraints) if "links" in kinds else ()),
            *(one.pairs[0][1] for one in constraints if "bodies" in kinds and isinstance(one, Collision)),
        ]
        self.regions = [one for one in constraints if "regions" in kinds and isinstance(one, ForbiddenRegion)]

    def solids(self, q: Array, t: float) -> Iterator[Array]:
        """Each (V, 3) points in the base frame whose convex hull a solid is, at ``q`` (n,) and ``t`` [s]."""
        if self.bodies:
            pin.forwardKinematics(self.scene.robot.model, self._data, q)
        for body in self.bodies:
            for placement, solid in body.parts:
                points = corners(solid)
                if points is not None:
                    at = self._data.oMi[body.joint] * placement
                    yield points @ at.rotation.T + at.translation
        for region in self.regions:
            points = _of_region(region)
            if points is not None:
                moved = np.zeros(3) if region.motion is None else region.motion.displacement(t)
                yield region.pose.act(points) + moved


def _links(scene: Scene, constraints: Sequence[Constraint]) -> list[Body]:
    """Of the URDF, or as collision constraints have them; none if a mesh is missing, which the start says."""
    robot = scene.robot
    if robot.source is not None:
        try:
            return list(LinesOfSight(scene).bodies)
        except ConfigurationError:
            return []
    carrying = int(robot.model.frames[robot.frame_id("tip")].parentJoint)
    known = (body for one in constraints if isinstance(one, BodyDistance) for pair in one.pairs for body in pair)
    return list({body.name: body for body in known if body.joint not in (0, carrying)}.values())


def corners(solid: coal.CollisionGeometry) -> Array | None:
    """(V, 3) points in its own frame whose convex hull a solid is; None if it has no end."""
    if isinstance(solid, coal.Convex):
        return np.asarray(solid.points())
    if isinstance(solid, coal.Sphere):
        return np.asarray(solid.radius * _ball())
    if isinstance(solid, coal.Capsule):
        up = np.array([0.0, 0.0, solid.halfLength])
        ball: Array = solid.radius * _ball()
        return np.concatenate([ball + up, ball - up])
    if isinstance(solid, coal.Cylinder):
        return np.asarray(convex(solid, "cylinder").points())
    solid.computeLocalAABB()
    low, high = np.array(solid.aabb_local.min_), np.array(solid.aabb_local.max_)
    return _box(low, high) if (np.abs([low, high]) < ENDLESS).all() else None


def _of_region(region: ForbiddenRegion) -> Array | None:
    if isinstance(region, ForbiddenSphere):
        return corners(coal.Sphere(region.radius))
    if isinstance(region, ForbiddenBox):
        return _box(-0.5 * region.size, 0.5 * region.size)
    if isinstance(region, ForbiddenCapsule | ForbiddenCylinder):
        radius, half = region.parameters
        return corners((coal.Capsule if isinstance(region, ForbiddenCapsule) else coal.Cylinder)(radius, 2.0 * half))
    return None


def _box(low: Array, high: Array) -> Array:
    return np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(-1, 3)


@lru_cache(maxsize=1)
def _ball() -> Array:
    """(POINTS, 3) evenly on the unit sphere: along a spiral, by the golden angle."""
    k = np.arange(POINTS) + 0.5
    z, turn = 1.0 - 2.0 * k / POINTS, np.pi * (1.0 + np.sqrt(5.0)) * k
    around = np.sqrt(1.0 - z * z)
    return np.stack([around * np.cos(turn), around * np.sin(turn), z], axis=1)
