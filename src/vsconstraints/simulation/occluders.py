"""Occluders between camera and markers: the arm's links, and bodies and regions of constraints."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Literal

import coal
import numpy as np
import pinocchio as pin

from ..constraints import Body, BodyDistance, Collision, Constraint, link_bodies
from ..constraints.meshes import hull_points
from ..errors import ConfigurationError
from ..rows import Array
from ..vision.scene import Scene

OpaqueName = Literal["links", "bodies", "regions"]  #: Kinds of solids that hide markers.

THIN = 1e-6  #: Radius of a line of sight [m].
GLANCES = 100  #: Number of instants of a run at which lines of sight are checked.
#: Enlargement of the boxes around links [m]: more than rounding and a line's radius.
SLACK = 1e-5
TINY = 1e-300  #: Substitute for a zero change of a coordinate along a line [m].


class LinesOfSight:
    """Lines from the camera to a scene's markers, and the links of a URDF arm as convex hulls.

    Links that move with the tip carry the camera or the markers and are ignored. Raises
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
        #: (P, 1, 3) smallest and largest coordinates of each solid, in its own frame.
        self._low = np.array([solid.aabb_local.min_ for _, _, solid in self._parts])[:, None]
        self._high = np.array([solid.aabb_local.max_ for _, _, solid in self._parts])[:, None]

    def hidden(self, q: Array, t: Sequence[float]) -> list[list[tuple[int, str]]]:
        """Return the markers that a link hides at q (N, n) and t (N,) [s].

        For each time, the result holds the numbers of the hidden markers, each with the first link
        that hides it.
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
        frames = np.array([[placement.homogeneous for placement in now] for now in places])
        R = frames[..., :3, :3]
        origin = frames[..., None, :3, 3]
        # shares of each line at which it enters and leaves the box around each solid, computed in
        # the solid's frame: (N, P, M, 3)
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
        # distances of solids take far longer to compute than boxes
        for n, i in np.argwhere(near.any(axis=1)):
            parts = ((*self._parts[k], places[n][k]) for k in np.flatnonzero(near[n, :, i]))
            hiding = (
                body.name
                for body, _, solid, placement in parts
                if _crosses(eyes[n], markers[n][i], solid, placement)
            )
            hidden[n] += [(int(i) + 1, link) for link in itertools.islice(hiding, 1)]
        return hidden


def _crosses(eye: Array, marker: Array, solid: coal.CollisionGeometry, placement: pin.SE3) -> bool:
    """True if the line from eye to marker (3,) meets a solid at this placement."""
    along = marker - eye
    length = float(np.sqrt(along @ along))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along / length).matrix()
    line = coal.Capsule(THIN, length)
    middle = coal.Transform3s(turn, 0.5 * (eye + marker))
    pose = coal.Transform3s(placement.rotation, placement.translation)
    return bool(
        coal.distance(line, middle, solid, pose, coal.DistanceRequest(), coal.DistanceResult())
        <= 0.0
    )


def hidden_markers(scene: Scene, t: Array, q: Array) -> list[str]:
    """Return remarks on the markers that the robot's own links hide during a run.

    Times t (N,) [s] and configurations q (N, n) are checked at :data:`GLANCES` instants after the
    first.
    """
    try:
        lines = LinesOfSight(scene)
    except ConfigurationError:  # reported at the start
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
    """Convex solids that may hide the tags of a scene: links, bodies and forbidden regions.

    Among ``kinds``, ``bodies`` are the obstacles of collision constraints, and ``regions`` all
    other constraints that have a mesh. Links that move with the tip carry the camera or the tags
    and are ignored.
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
        """Yield points (V, 3) of each solid, in the base frame, at ``q`` (n,) and ``t`` [s].

        A solid is the convex hull of its points.
        """
        if self.links:
            pin.forwardKinematics(self.scene.robot.model, self._data, q)
        for body in self.links:
            for placement, solid in body.parts:
                points = hull_points(solid)
                if points is not None:
                    pose = self._data.oMi[body.joint] * placement
                    yield points @ pose.rotation.T + pose.translation
        yield from self._still
        for obstacle in self._moving:
            yield from (mesh.points for mesh in obstacle.meshes(t))


def _links(scene: Scene, constraints: Sequence[Constraint]) -> list[Body]:
    """Return the links of the URDF, or else those of collision constraints.

    The list is empty if a mesh is missing, which the check of the start reports.
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
