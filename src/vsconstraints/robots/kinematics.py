"""Where a robot is and how it moves: evaluated on Pinocchio for one configuration at a time.

The oracle of :mod:`vsconstraints.compiled.kinematics`: ``test_every_robot_and_constraint_in_every_world`` in
``tests/test_control_step.py`` compares the two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..rows import Array
from .geometry import Pose, skew, vector


@dataclass(frozen=True)
class RobotPoint:
    """A point fixed to a link: a frame of the robot's model, or ``"tip"``."""

    link: str = "tip"
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: (3,) position in that link's frame [m].
    name: str = ""  #: What rows call it; the link's name if empty.

    @property
    def label(self) -> str:
        """Name used in row labels."""
        return self.name or self.link


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Where a robot with n joints is and how it moves, in one configuration, with k of its points."""

    q: Array  #: (n,) [rad or m].
    qd: Array  #: (n,).
    tip: Pose  #: In the base frame.
    J: Array  #: (6, n) Jacobian of the tip's twist (v, ω), expressed in the tip frame: ᵉJₑ.
    drift: Array  #: (6,) J̇ q̇, the derivative of that twist when q̈ = 0.
    points: Array  #: (k, 3) in the base frame [m].
    point_J: Array  #: (k, 3, n)
    point_drift: Array  #: (k, 3) J̇ q̇.


class KinematicsEvaluator:
    """Evaluates the kinematics of a model for fixed points, on the frames with these numbers.

    Pinocchio's data is overwritten by every call.
    """

    def __init__(
        self, model: pin.Model, data: pin.Data, tip: int, points: Sequence[RobotPoint], frames: Sequence[int]
    ) -> None:
        self._model, self._data, self._tip = model, data, tip
        by_frame: dict[int, list[int]] = {}
        for i, frame in enumerate(frames):
            by_frame.setdefault(frame, []).append(i)
        offsets = np.array([vector(p.offset, 3, f"offset of {p.label}") for p in points]).reshape(-1, 3)
        self._by_frame = [(frame, np.array(at), offsets[at]) for frame, at in by_frame.items()]
        self._count, self._n = len(points), model.nv
        self._no_acceleration = np.zeros(model.nv)

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
