"""Kinematics of a robot, computed by Pinocchio.

It is the reference for :mod:`vsconstraints.compiled.kinematics`:
``test_every_robot_and_constraint_in_every_world`` in ``tests/test_control_step.py`` compares the
two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..rows import Array
from .geometry import Pose, vector


@dataclass(frozen=True)
class RobotPoint:
    """A point fixed to a link: a frame of the robot's model, or ``"tip"``."""

    link: str = "tip"
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: (3,) position in that link's frame [m].
    name: str = ""  #: Name in row labels; the link's name if empty.

    @property
    def label(self) -> str:
        """Name used in row labels."""
        return self.name or self.link


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Pose and motion of a robot with n joints and of k of its points, in one configuration."""

    q: Array  #: (n,) [rad or m].
    qd: Array  #: (n,).
    tip: Pose  #: Pose of the tip in the base frame.
    J: Array  #: (6, n) Jacobian of the tip's twist (v, ω), expressed in the tip frame: ᵉJₑ.
    drift: Array  #: (6,) J̇ q̇, the derivative of that twist when q̈ = 0.
    points: Array  #: (k, 3) in the base frame [m].
    point_J: Array  #: (k, 3, n) Jacobians of the points in the base frame.
    point_drift: Array  #: (k, 3) J̇ q̇.


class KinematicsEvaluator:
    """Evaluates the kinematics of the tip and of points on frames, given by index.

    Each call overwrites Pinocchio's data.
    """

    def __init__(
        self,
        model: pin.Model,
        data: pin.Data,
        tip: int,
        points: Sequence[RobotPoint],
        frames: Sequence[int],
    ) -> None:
        self._model = model
        self._data = data
        self._tip = tip
        self._still = np.zeros(model.nv)
        self._points = []
        for point, index in zip(points, frames, strict=True):
            frame = model.frames[index]
            position = vector(point.offset, 3, f"offset of {point.label}")
            placement = frame.placement * pin.SE3(np.eye(3), position)
            self._points.append((frame.parentJoint, placement))

    def __call__(self, q: Array, qd: Array) -> Kinematics:
        """Return the kinematics at ``q`` and ``qd`` (n,)."""
        model = self._model
        data = self._data
        local = pin.ReferenceFrame.LOCAL
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.forwardKinematics(model, data, q, qd, self._still)
        pin.computeJointJacobians(model, data)
        tip, J = self._tip_of_data()
        acceleration = pin.getFrameAcceleration(model, data, self._tip, local)
        k = len(self._points)
        points = np.empty((k, 3))
        point_J = np.empty((k, 3, model.nv))
        point_drift = np.empty((k, 3))
        for i, (joint, place) in enumerate(self._points):
            in_base = data.oMi[joint] * place
            points[i] = in_base.translation
            twist_J = as_matrix(pin.getFrameJacobian(model, data, joint, place, world))
            point_J[i] = twist_J[:3]
            point_drift[i] = pin.getFrameClassicalAcceleration(
                model, data, joint, place, world
            ).linear
        return Kinematics(
            q=q.copy(),
            qd=qd.copy(),
            tip=tip,
            J=J,
            drift=np.array(acceleration.vector),
            points=points,
            point_J=point_J,
            point_drift=point_drift,
        )

    def tip_jacobian(self, q: Array) -> tuple[Pose, Array]:
        """Return the tip's pose and Jacobian (6, n) of :class:`Kinematics` at ``q`` (n,)."""
        pin.computeJointJacobians(self._model, self._data, q)
        return self._tip_of_data()

    def _tip_of_data(self) -> tuple[Pose, Array]:
        placement = pin.updateFramePlacement(self._model, self._data, self._tip)
        local = pin.ReferenceFrame.LOCAL
        J = as_matrix(pin.getFrameJacobian(self._model, self._data, self._tip, local))
        return Pose.of(placement), J


def as_matrix(jacobian: Array) -> Array:
    """Return a copy (6, n) of a Jacobian; Pinocchio returns one of a single column as a vector."""
    return np.array(jacobian).reshape(6, -1)
