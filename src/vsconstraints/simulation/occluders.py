"""What stands between the camera and the markers: the arm's own links, bodies and regions of constraints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import coal
import numpy as np
import pinocchio as pin

from ..constraints import Body, BodyDistance, Collision, Constraint, link_bodies
from ..constraints.meshes import hull_points
from ..errors import ConfigurationError
from ..rows import Array, BoolArray
from ..vision.images.settings import OpaqueName
from ..vision.scene import Scene

THIN = 1e-6
"""Radius of a line of sight [m]."""

GLANCES = 100
"""Instants of a run at which lines of sight are checked."""

SLACK = 1e-5
"""By how much the boxes around links are enlarged [m]: more than rounding, and a line's radius."""

TINY = 1e-300
"""For a coordinate that does not change along a line [m]."""


class LinesOfSight:
    """Lines from the camera to the markers of a scene, and the links of a URDF arm as convex hulls.

    Links that move with the tip carry the camera or the markers, and never count. Raises ConfigurationError if a mesh
    cannot be read.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        robot = scene.robot
        self._data = robot.model.createData()
        carrying = int(robot.model.frames[robot.frame_id("tip")].parentJoint)
        bodies: Sequence[Body] = () if robot.source is None else link_bodies(robot)
        self.bodies = tuple(body for body in bodies if body.joint != carrying)

    def near(self, q: Array, t: Array) -> BoolArray:
        """(N,) whether any line comes into the box around any part of a link, at ``q`` (N, n) and ``t`` (N,) [s].

        Where none does, nothing is hidden. All instants are looked at together: far faster than distances of solids.
        """
        parts = [(body.joint, placement, solid) for body in self.bodies for placement, solid in body.parts]
        if not parts:
            return np.zeros(len(t), dtype=np.bool_)
        joints, placements, solids = zip(*parts, strict=True)
        low, high = (np.array(corner)[:, None] for corner in zip(*map(_bounds, solids), strict=True))
        model, data, tip = self.scene.robot.model, self._data, self.scene.robot.frame_id("tip")
        tips, moved = np.empty((len(t), 4, 4)), np.empty((len(t), model.njoints, 4, 4))
        for k, configuration in enumerate(q):
            pin.forwardKinematics(model, data, configuration)
            tips[k] = pin.updateFramePlacement(model, data, tip).homogeneous
            for joint in {*joints}:
                moved[k, joint] = data.oMi[joint].homogeneous
        frames = moved[:, joints] @ np.array([placement.homogeneous for placement in placements])
        origin, R = frames[..., None, :3, 3], frames[..., :3, :3]
        eyes, markers = ((p[:, None] - origin) @ R for p in self._ends(tips, t))
        along = markers - eyes
        along[along == 0.0] = TINY
        shares = np.stack(((low - SLACK - eyes) / along, (high + SLACK - eyes) / along))
        enters, leaves = shares.min(axis=0).max(axis=-1), shares.max(axis=0).min(axis=-1)
        crosses: BoolArray = (np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)).any(axis=(1, 2))
        return crosses

    def _ends(self, tips: Array, t: Array) -> tuple[Array, Array]:
        """(·, 1, 3) eyes and (·, M, 3) markers in the base frame, for tips (N, 4, 4) and times (N,) [s]."""
        scene, camera = self.scene, self.scene.camera
        R, origin = tips[:, :3, :3].transpose(0, 2, 1), tips[:, None, :3, 3]
        if camera.fixed is not None:
            return camera.fixed.t[None, None], scene.markers @ R + origin
        if scene.motion is None:
            markers = scene.markers[None]
        else:
            markers = np.array([scene.motion.pose(float(now)).act(scene.markers) for now in t])
        return camera.mount.inverse.t[None] @ R + origin, markers

    def hidden(self, q: Array, t: float) -> list[tuple[int, str]]:
        """Numbers of the markers that a link hides at ``q`` (n,) and ``t`` [s], each with the first such link."""
        if not self.bodies:
            return []
        camera = self.scene.camera
        eye = (camera.fixed or self.scene.robot.pose(q) @ camera.mount.inverse).t
        pin.forwardKinematics(self.scene.robot.model, self._data, q)
        names = [self._in_between(eye, marker) for marker in self.scene.markers_at(q, t)]
        return [(number, name) for number, name in enumerate(names, start=1) if name]

    def _in_between(self, eye: Array, marker: Array) -> str:
        along = marker - eye
        length = float(np.sqrt(along @ along))
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along / length).matrix()
        line, middle = coal.Capsule(THIN, length), coal.Transform3s(turn, 0.5 * (eye + marker))
        for body in self.bodies:
            for placement, solid in body.parts:
                at = self._data.oMi[body.joint] * placement
                there = coal.Transform3s(at.rotation, at.translation)
                if coal.distance(line, middle, solid, there, coal.DistanceRequest(), coal.DistanceResult()) <= 0.0:
                    return body.name
        return ""


def _bounds(solid: coal.CollisionGeometry) -> tuple[Array, Array]:
    """(3,) least and greatest coordinates of a solid, in its own frame."""
    solid.computeLocalAABB()
    return np.array(solid.aabb_local.min_), np.array(solid.aabb_local.max_)


def hidden_markers(scene: Scene, t: Array, q: Array) -> list[str]:
    """Which markers the robot's own links hide at times t (N,) [s] and q (N, n), in :data:`GLANCES` after the first."""
    try:
        lines = LinesOfSight(scene)
    except ConfigurationError:
        # said at the start
        return []
    first: dict[tuple[int, str], float] = {}
    glances = np.unique(np.linspace(1, len(t) - 1, GLANCES).astype(int)) if len(t) > 1 else np.empty(0, dtype=int)
    for k in glances[lines.near(q[glances], t[glances])]:
        for hidden in lines.hidden(q[k], float(t[k])):
            first.setdefault(hidden, float(t[k]))
    return [
        f"marker {number} is hidden by {link}, first seen at {since:.3g} s" for (number, link), since in first.items()
    ]


class Occluders:
    """Convex solids that may stand before the tags of a scene: links, bodies of constraints, forbidden regions.

    Of ``kinds``, obstacles of collision are ``bodies``, and all others that have a mesh ``regions``. Links that move
    with the tip carry the camera or the tags, and never count.
    """

    def __init__(self, scene: Scene, constraints: Sequence[Constraint], kinds: Sequence[OpaqueName]) -> None:
        self.scene, self._data = scene, scene.robot.model.createData()
        self.links = _links(scene, constraints) if "links" in kinds else []
        obstacles = [one for one in constraints if ("bodies" if isinstance(one, Collision) else "regions") in kinds]
        self._moving = [one for one in obstacles if getattr(one, "motion", None) is not None]
        self._still = [mesh.points for one in obstacles if one not in self._moving for mesh in one.meshes(0.0)]

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
