"""Occluders between camera and markers: the arm's links, and bodies and regions of constraints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Literal, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ..constraints import Body, BodyDistance, Collision, Constraint, link_bodies
from ..constraints.meshes import box_around, hull_points
from ..errors import ConfigurationError
from ..rows import Array, BoolArray
from ..vision.scene import Scene

OpaqueName = Literal["links", "bodies", "regions"]  #: Kinds of solids that hide markers.

THIN = 1e-6  #: Radius of a line of sight [m].
GLANCES = 100  #: Number of instants of a run at which lines of sight are checked.
#: Enlargement of the boxes around links [m]: more than rounding and a line's radius.
SLACK = 1e-5
TINY = 1e-300  #: Substitute for a zero change of a coordinate along a line [m].


class BodyPart(NamedTuple):
    """Convex solid of a body, with its placement in the frame of the body's joint."""

    body: Body
    placement: pin.SE3
    solid: coal.CollisionGeometry


class LinesOfSight:
    """Lines from the camera to a scene's markers, and the links of a URDF arm as convex hulls.

    Links that move with the tip carry the camera or the markers and are ignored. Raises
    ConfigurationError if a mesh cannot be read.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        robot = scene.robot
        self._data = robot.model.createData()
        tip = robot.model.frames[robot.frame_id("tip")]
        carrying = int(tip.parentJoint)
        bodies: Sequence[Body] = () if robot.source is None else link_bodies(robot)
        self.bodies = tuple(body for body in bodies if body.joint != carrying)
        self._parts: list[BodyPart] = []
        low = []
        high = []
        for body in self.bodies:
            for placement, solid in body.parts:
                self._parts.append(BodyPart(body, placement, solid))
                least, greatest = box_around(solid)
                low.append(least)
                high.append(greatest)
        #: (P, 1, 3) smallest and largest coordinates of each solid, in its own frame.
        self._low = np.array(low)[:, None]
        self._high = np.array(high)[:, None]

    def hidden(self, q: Array, t: Sequence[float]) -> list[list[tuple[int, str]]]:
        """Return the markers that a link hides at q (N, n) and t (N,) [s].

        For each time, the result holds the numbers of the hidden markers, each with the first link
        that hides it.
        """
        if not self._parts or not len(t):
            return [[] for _ in t]
        camera = self.scene.camera
        eyes = []
        markers = []
        places = []
        for configuration, time in zip(q, t, strict=True):
            tip = self.scene.robot.pose(configuration)
            eyes.append(camera.pose(tip).t)
            markers.append(self.scene.markers_at(configuration, time))
            places.append(self._places(configuration))
        near = self._near(np.array(eyes), np.array(markers), places)
        hidden: list[list[tuple[int, str]]] = [[] for _ in t]
        # distances of solids take far longer to compute than boxes
        for n, i in np.argwhere(near.any(axis=1)):
            marker = markers[n][i]
            number = int(i) + 1
            for k in np.flatnonzero(near[n, :, i]):
                part = self._parts[k]
                if _crosses(eyes[n], marker, part.solid, places[n][k]):
                    hidden[n].append((number, part.body.name))
                    break
        return hidden

    def _places(self, q: Array) -> list[pin.SE3]:
        """Return the placement of each solid in the base frame at q (n,)."""
        pin.forwardKinematics(self.scene.robot.model, self._data, q)
        joints = self._data.oMi
        return [joints[part.body.joint] * part.placement for part in self._parts]

    def _near(self, eyes: Array, markers: Array, places: list[list[pin.SE3]]) -> BoolArray:
        """Return a mask (N, P, M) of the lines that meet the box around a solid.

        The lines begin at the eyes (N, 3) and end at the markers (N, M, 3). The shares of a line at
        which it enters and leaves a box are computed in the frame of the solid.
        """
        matrices = []
        for now in places:
            matrices.append([placement.homogeneous for placement in now])
        frames = np.array(matrices)
        R = frames[..., :3, :3]
        origin = frames[..., None, :3, 3]
        to_eye = eyes[:, None, None] - origin
        to_marker = markers[:, None] - origin
        begin = to_eye @ R
        along = to_marker @ R - begin
        along[along == 0.0] = TINY
        to_low = (self._low - SLACK - begin) / along
        to_high = (self._high + SLACK - begin) / along
        enters = np.minimum(to_low, to_high).max(axis=-1)
        leaves = np.maximum(to_low, to_high).min(axis=-1)
        near: BoolArray = np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)
        return near


def _crosses(eye: Array, marker: Array, solid: coal.CollisionGeometry, placement: pin.SE3) -> bool:
    """True if the line from eye to marker (3,) meets a solid at this placement."""
    along = marker - eye
    length = float(np.sqrt(along @ along))
    z_axis = np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(z_axis, along / length)
    line = coal.Capsule(THIN, length)
    centre = 0.5 * (eye + marker)
    middle = coal.Transform3s(turn.matrix(), centre)
    pose = coal.Transform3s(placement.rotation, placement.translation)
    request = coal.DistanceRequest()
    distance = coal.distance(line, middle, solid, pose, request, coal.DistanceResult())
    return bool(distance <= 0.0)


def hidden_markers(scene: Scene, t: Array, q: Array) -> list[str]:
    """Return remarks on the markers that the robot's own links hide during a run.

    Times t (N,) [s] and configurations q (N, n) are checked at :data:`GLANCES` instants after the
    first.
    """
    try:
        lines = LinesOfSight(scene)
    except ConfigurationError:  # reported at the start
        return []
    if len(t) < 2:
        return []
    first: dict[tuple[int, str], float] = {}
    glances = np.unique(np.linspace(1, len(t) - 1, GLANCES).astype(int))
    times = t[glances].tolist()
    for time, hidden in zip(times, lines.hidden(q[glances], times), strict=True):
        for marker_and_link in hidden:
            first.setdefault(marker_and_link, time)
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
        self._moving: list[Constraint] = []
        self._still: list[Array] = []
        for constraint in constraints:
            kind = "bodies" if isinstance(constraint, Collision) else "regions"
            if kind not in kinds:
                continue
            if getattr(constraint, "motion", None) is not None:
                self._moving.append(constraint)
            else:
                self._still += [mesh.points for mesh in constraint.meshes(0.0)]

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
    base = 0
    carrying = int(robot.model.frames[robot.frame_id("tip")].parentJoint)
    links = {}
    for constraint in constraints:
        if not isinstance(constraint, BodyDistance):
            continue
        for body in chain.from_iterable(constraint.pairs):
            if body.joint not in (base, carrying):
                links[body.name] = body
    return list(links.values())
