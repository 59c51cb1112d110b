"""Where a robot is and how it moves: evaluated on Pinocchio for one configuration at a time.

This and :mod:`vsconstraints.compiled.kinematics`, which does the same for compiled code, are a pair:
``test_every_robot_and_constraint_in_every_world`` in ``tests/test_control_step.py`` holds it together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..errors import unknown_name
from ..rows import Array
from .geometry import Pose, skew, vector

if TYPE_CHECKING:
    from .robot import Robot


@dataclass(frozen=True)
class RobotPoint:
    """A point fixed to a link.

    Attributes
    ----------
    link
        Name of the link (a frame of the robot's model), or ``"tip"``.
    offset
        (3,) position in that link's frame [m].
    name
        What rows call it; the link's name if empty.
    """

    link: str = "tip"
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    name: str = ""

    @property
    def label(self) -> str:
        """Name used in row labels."""
        return self.name or self.link


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Where a robot is and how it moves, in one configuration.

    Attributes
    ----------
    q, qd
        (n,) joint coordinates [rad or m] and speeds.
    tip
        Pose of the tip in the base frame.
    J
        (6, n) Jacobian of the tip's twist (v, ω), expressed in the tip frame: ᵉJₑ.
    drift
        (6,) J̇ q̇, the derivative of that twist when q̈ = 0.
    points, point_J, point_drift
        (k, 3) positions, (k, 3, n) Jacobians and (k, 3) J̇ q̇ of the requested points, in the base frame.
    """

    q: Array
    qd: Array
    tip: Pose
    J: Array
    drift: Array
    points: Array
    point_J: Array
    point_drift: Array


class KinematicsEvaluator:
    """Evaluates one robot's kinematics for a fixed set of points; call it with ``q`` and ``qd`` (n,)."""

    def __init__(self, robot: Robot, points: Sequence[RobotPoint]) -> None:
        self._model, self._data, self._tip = robot.model, robot._data, robot.frame_id("tip")
        by_frame: dict[int, list[int]] = {}
        for i, point in enumerate(points):
            by_frame.setdefault(robot.frame_id(point.link), []).append(i)
        offsets = np.array([vector(p.offset, 3, f"offset of {p.label}") for p in points]).reshape(-1, 3)
        self._by_frame = [(frame, np.array(at), offsets[at]) for frame, at in by_frame.items()]
        self._count, self._n = len(points), robot.n
        self._no_acceleration = np.zeros(robot.n)

    def __call__(self, q: Array, qd: Array) -> Kinematics:
        """Evaluate at ``q`` and ``qd`` (n,)."""
        model, data = self._model, self._data
        pin.forwardKinematics(model, data, q, qd, self._no_acceleration)
        pin.computeJointJacobians(model, data)
        placement = pin.updateFramePlacement(model, data, self._tip)
        # Pinocchio gives a Jacobian of one column as a vector
        J = np.array(pin.getFrameJacobian(model, data, self._tip, pin.ReferenceFrame.LOCAL)).reshape(6, -1)
        drift = np.array(pin.getFrameAcceleration(model, data, self._tip, pin.ReferenceFrame.LOCAL).vector)
        points = np.empty((self._count, 3))
        point_J = np.empty((self._count, 3, self._n))
        point_drift = np.empty((self._count, 3))
        for frame, at, offsets in self._by_frame:
            frame_placement = pin.updateFramePlacement(model, data, frame)
            arms = offsets @ frame_placement.rotation.T
            points[at] = arms + frame_placement.translation
            world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            J_frame = pin.getFrameJacobian(model, data, frame, world).reshape(6, -1)
            # v_point = v + ω × r, and so for every column of the Jacobian
            point_J[at] = J_frame[:3] - skew(arms) @ J_frame[3:]
            acceleration = pin.getFrameClassicalAcceleration(model, data, frame, world)
            spin = skew(np.asarray(pin.getFrameVelocity(model, data, frame, world).angular))
            # a_point = a + α × r + ω × (ω × r)
            turning = skew(np.asarray(acceleration.angular)) + spin @ spin
            point_drift[at] = np.asarray(acceleration.linear) + arms @ turning.T
        tip = Pose(np.array(placement.rotation), np.array(placement.translation))
        return Kinematics(q.copy(), qd.copy(), tip, J, drift, points, point_J, point_drift)


def point_twist(
    robot: Robot, q: ArrayLike, qd: ArrayLike, link: str, offset: Sequence[float], axes: str
) -> tuple[Array, Array]:
    """Jacobian (6, n) and J̇ q̇ (6,) of a point's twist: see :meth:`vsconstraints.robots.robot.Robot.jacobian`."""
    if axes not in ("base", "tip"):
        raise unknown_name("axes", axes, ("base", "tip"))
    q, qd = robot.configuration(q), robot.configuration(qd, "qd")
    x, y, z = vector(offset, 3, "offset")
    motion = robot.kinematics(q, qd, [RobotPoint(link, (x, y, z))])
    model, data, frame, world = robot.model, robot._data, robot.frame_id(link), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    angular_J = np.array(pin.getFrameJacobian(model, data, frame, world)).reshape(6, -1)[3:]
    angular_drift = np.array(pin.getFrameAcceleration(model, data, frame, world).angular)
    J = np.concatenate((motion.point_J[0], angular_J))
    drift = np.concatenate((motion.point_drift[0], angular_drift))
    if axes == "base":
        return J, drift
    # the tip's axes turn with it: d/dt (Rᵀ a) = Rᵀ (ȧ − ω × a)
    R = motion.tip.R
    spin = skew(R @ (motion.J[3:] @ qd))
    turning = drift - np.concatenate((spin @ (J[:3] @ qd), spin @ (J[3:] @ qd)))
    to_tip = np.kron(np.eye(2), R.T)
    return to_tip @ J, to_tip @ turning
