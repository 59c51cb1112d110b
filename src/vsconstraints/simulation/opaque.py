"""What hides tags in the images of a scene: the arm's own links, and what constraints forbid in space."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import pinocchio as pin

from ..constraints import Body, BodyDistance, Collision, Constraint
from ..constraints.meshes import hull_points
from ..errors import ConfigurationError
from ..rows import Array
from ..vision.images.settings import OpaqueName
from ..vision.scene import Scene
from .line_of_sight import LinesOfSight


class Opaque:
    """Convex solids of a scene, where they are at an instant.

    Parameters
    ----------
    scene
        Whose arm it is.
    constraints
        Those that give a mesh are drawn: obstacles of collision as ``bodies``, all others as ``regions``.
    kinds
        What is drawn. Links that move with the tip carry the camera or the tags, and never count.
    """

    def __init__(self, scene: Scene, constraints: Sequence[Constraint], kinds: Sequence[OpaqueName]) -> None:
        self.scene, self._data = scene, scene.robot.model.createData()
        self.links = _links(scene, constraints) if "links" in kinds else []
        self.obstacles = [
            one for one in constraints if ("bodies" if isinstance(one, Collision) else "regions") in kinds
        ]

    def solids(self, q: Array, t: float) -> Iterator[Array]:
        """Each (V, 3) points in the base frame whose convex hull a solid is, at ``q`` (n,) and ``t`` [s]."""
        if self.links:
            pin.forwardKinematics(self.scene.robot.model, self._data, q)
        for body in self.links:
            for placement, solid in body.parts:
                points = hull_points(solid)
                if points is not None:
                    at = self._data.oMi[body.joint] * placement
                    yield points @ at.rotation.T + at.translation
        yield from self._still
        for one in self._moving:
            yield from (mesh.points for mesh in one.meshes(t))

    @cached_property
    def _moving(self) -> list[Constraint]:
        return [one for one in self.obstacles if getattr(one, "motion", None) is not None]

    @cached_property
    def _still(self) -> list[Array]:
        return [mesh.points for one in self.obstacles if one not in self._moving for mesh in one.meshes(0.0)]


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
