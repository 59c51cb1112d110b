"""Whether the robot's own links stand between the camera and a marker."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

from ..constraints import Body, link_bodies
from ..errors import ConfigurationError
from ..rows import Array
from ..scene import Scene

THIN = 1e-6
"""Radius of a line of sight [m]."""

GLANCES = 100
"""How often in a run lines of sight are checked."""


class LinesOfSight:
    """Lines from the camera to the markers of a scene, and the links of a URDF arm as convex hulls.

    Links that move with the tip carry the camera or the markers, and never count.

    Raises
    ------
    ConfigurationError
        if a mesh cannot be read.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        robot = scene.robot
        self._data = robot.model.createData()
        carrying = int(robot.model.frames[robot.frame_id("tip")].parentJoint)
        bodies: Sequence[Body] = () if robot.source is None else link_bodies(robot)
        self.bodies = tuple(body for body in bodies if body.joint != carrying)

    def hidden(self, q: Array, t: float) -> list[tuple[int, str]]:
        """Numbers of the markers that a link hides at ``q`` (n,) and ``t`` [s], each with the first such link."""
        if not self.bodies:
            return []
        camera = self.scene.camera
        eye = (camera.fixed or self.scene.robot.pose(q) @ camera.mount.inverse).t
        pin.forwardKinematics(self.scene.robot.model, self._data, q)
        found = []
        for number, marker in enumerate(self.scene.markers_at(q, t), start=1):
            name = self._in_between(eye, marker)
            if name:
                found.append((number, name))
        return found

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


def hidden_markers(scene: Scene, t: Array, q: Array) -> list[str]:
    """Which markers the robot's own links hide at times t (N,) [s] and q (N, n), in :data:`GLANCES` after the first."""
    try:
        lines = LinesOfSight(scene)
    except ConfigurationError:
        # said at the start
        return []
    first: dict[tuple[int, str], float] = {}
    for k in np.unique(np.linspace(1, len(t) - 1, GLANCES).astype(int)) if len(t) > 1 else ():
        for hidden in lines.hidden(q[k], float(t[k])):
            first.setdefault(hidden, float(t[k]))
    return [
        f"marker {number} is hidden by {link}, first seen at {since:.3g} s" for (number, link), since in first.items()
    ]
