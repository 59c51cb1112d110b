"""What stands between the camera and the markers: the arm's own links, bodies and regions of
constraints.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import coal
import numpy as np
import pinocchio as pin

from ..constraints import Body, BodyDistance, Collision, Constraint, link_bodies
from ..constraints.meshes import hull_points
from ..errors import ConfigurationError
from ..rows import Array
from ..vision.images.settings import OpaqueName
from ..vision.scene import Scene

THIN = 1e-6  #: Radius of a line of sight [m].
GLANCES = 100  #: Instants of a run at which lines of sight are checked.
#: By how much the boxes around links are enlarged [m]: more than rounding, and a line's radius.
SLACK = 1e-5
TINY = 1e-300  #: For a coordinate that does not change along a line [m].


class LinesOfSight:
    """Lines from the camera to the markers of a scene, and the links of a URDF arm as convex hulls.

    Links that move with the tip carry the camera or the markers, and never count. Raises
    ConfigurationError if a mesh cannot be read.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        robot = scene.robot
        self._data = robot.model.createData()
        carrying = int(robot.model.frames[robot.frame_id("tip")].parentJoint)
        bodies: Sequence[Body] = () if robot.source is None else link_bodies(robot)
        self.bodies = tuple(body for body in bodies if body.joint != carrying)
        self._parts = [
            (body, placement, solid) for body in self.bodies for placement, solid in body.parts
        ]
        for _, _, solid in self._parts:
            solid.computeLocalAABB()
        #: (P, 1, 3) least and greatest coordinates of each solid, in its own frame.
        self._low = np.array([solid.aabb_local.min_ for _, _, solid in self._parts])[:, None]
        self._high = np.array([solid.aabb_local.max_ for _, _, solid in self._parts])[:, None]

    def hidden(self, q: Array, t: Sequence[float]) -> list[list[tuple[int, str]]]:
        """Numbers of the markers that a link hides at q (N, n) and t (N,) [s], each with the first
        such link.
        """
        if not self._parts or not len(t):
            return [[] for _ in t]
        camera = self.scene.camera
        robot = self.scene.robot
        eyes = []
        markers = []
        places = []
        for each, time in zip(q, t, strict=True):
            eyes.append((camera.fixed or robot.pose(each) @ camera.mount.inverse).t)
            markers.append(self.scene.markers_at(each, time))
            pin.forwardKinematics(robot.model, self._data, each)
            places.append(
                [self._data.oMi[body.joint] * placement for body, placement, _ in self._parts]
            )
        frames = np.array([[at.homogeneous for at in now] for now in places])
        R = frames[..., :3, :3]
        origin = frames[..., None, :3, 3]
        # where each line enters and leaves the box around each solid, in whose frame both are: (N,
        # P, M, 3)
        begin = (np.array(eyes)[:, None, None] - origin) @ R
        along = (np.array(markers)[:, None] - origin) @ R - begin
        along[along == 0.0] = TINY
        shares = np.stack(
            ((self._low - SLACK - begin) / along, (self._high + SLACK - begin) / along)
        )
        enters = shares.min(axis=0).max(axis=-1)
        leaves = shares.max(axis=0).min(axis=-1)
        near = np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)
        hidden: list[list[tuple[int, str]]] = [[] for _ in t]
        for n, i in np.argwhere(near.any(axis=1)):  # distances of solids take far longer than boxes
            parts = ((*self._parts[k], places[n][k]) for k in np.flatnonzero(near[n, :, i]))
            hiding = (
                body.name
                for body, _, solid, at in parts
                if _crosses(eyes[n], markers[n][i], solid, at)
            )
            hidden[n] += [(int(i) + 1, link) for link in itertools.islice(hiding, 1)]
        return hidden


def _crosses(eye: Array, marker: Array, solid: coal.CollisionGeometry, at: pin.SE3) -> bool:
    """Whether the line from eye to marker (3,) meets a solid that is placed there."""
    along = marker - eye
    length = float(np.sqrt(along @ along))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along / length).matrix()
    line = coal.Capsule(THIN, length)
    middle = coal.Transform3s(turn, 0.5 * (eye + marker))
    there = coal.Transform3s(at.rotation, at.translation)
    return bool(
        coal.distance(line, middle, solid, there, coal.DistanceRequest(), coal.DistanceResult())
        <= 0.0
    )


def hidden_markers(scene: Scene, t: Array, q: Array) -> list[str]:
    """Which markers the robot's own links hide at times t (N,) [s] and q (N, n), in :data:`GLANCES`
    after the first.
    """
    try:
        lines = LinesOfSight(scene)
    except ConfigurationError:  # said at the start
        return []
    first: dict[tuple[int, str], float] = {}
    glances = (
        np.unique(np.linspace(1, len(t) - 1, GLANCES).astype(int))
        if len(t) > 1
        else np.empty(0, dtype=int)
    )
    for k, seen in zip(glances, lines.hidden(q[glances], t[glances].tolist()), strict=True):
        for hidden in seen:
            first.setdefault(hidden, float(t[k]))
    return [
        f"marker {number} is hidden by {link}, first seen at {since:.3g} s"
        for (number, link), since in first.items()
    ]


class Occluders:
    """Convex solids that may stand before the tags of a scene: links, bodies of constraints,
    forbidden regions.

    Of ``kinds``, obstacles of collision are ``bodies``, and all others that have a mesh
    ``regions``. Links that move with the tip carry the camera or the tags, and never count.
    """

    def __init__(
        self, scene: Scene, constraints: Sequence[Constraint], kinds: Sequence[OpaqueName]
    ) -> None:
        self.scene = scene
        self._data = scene.robot.model.createData()
        self.links = _links(scene, constraints) if "links" in kinds else []
        obstacles = [
            each
            for each in constraints
            if ("bodies" if isinstance(each, Collision) else "regions") in kinds
        ]
        self._moving = [each for each in obstacles if getattr(each, "motion", None) is not None]
        self._still = [
            mesh.points
            for each in obstacles
            if each not in self._moving
            for mesh in each.meshes(0.0)
        ]

    def solids(self, q: Array, t: float) -> Iterator[Array]:
        """Each (V, 3) points in the base frame whose convex hull a solid is, at ``q`` (n,) and
        ``t`` [s].
        """
        if self.links:
            pin.forwardKinematics(self.scene.robot.model, self._data, q)
        for body in self.links:
            for placement, solid in body.parts:
                points = hull_points(solid)
                if points is not None:
                    at = self._data.oMi[body.joint] * placement
                    yield points @ at.rotation.T + at.translation
        yield from self._still
        for obstacle in self._moving:
            yield from (mesh.points for mesh in obstacle.meshes(t))


def _links(scene: Scene, constraints: Sequence[Constraint]) -> list[Body]:
    """Of the URDF, or as collision constraints have them; none if a mesh is missing, which the
    start says.
    """
    robot = scene.robot
    if robot.source is not None:
        try:
            return list(LinesOfSight(scene).bodies)
        except ConfigurationError:
            return []
    carrying = int(robot.model.frames[robot.frame_id("tip")].parentJoint)
    distances = (each for each in constraints if isinstance(each, BodyDistance))
    known = (body for each in distances for pair in each.pairs for body in pair)
    return list({body.name: body for body in known if body.joint not in (0, carrying)}.values())
