"""Pose of the camera relative to a goal (position-based servoing), and its rotation alone."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ...errors import ConfigurationError
from ...formulas.features import pose_error, pose_motion
from ...formulas.vectors import rotate
from ...robots.geometry import Pose
from ...rows import Array
from ..scene import State
from .base import Feature, FeatureMotion, Goal


class CameraPose(Feature):
    """Position-based servoing: s = (c*t_C, θu of c*R_C) of eq. (44), in metres and radians.

    The reference, the value at the goal, is zero. Both poses are relative to the target. J_s =
    blkdiag(c*R_C, L_θu) J with J the Jacobian of the camera's twist relative to the target, in the
    camera frame.
    """

    name = "camera-pose"
    reached_by = "pose"

    def size(self, markers: int) -> int:
        """Return 6: a translation and a rotation vector."""
        return 6

    def check_goal(self, goal: Goal) -> None:
        """Raise ConfigurationError if the goal has no pose."""
        require_pose(self, goal)

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return the reference relative to a new goal: see :meth:`Feature.carried`."""
        assert old.camera is not None
        assert new.camera is not None
        camera = old.camera @ Pose(np.asarray(pin.exp3(reference[3:])), reference[:3])
        _, t, rotation = pose_error(new.camera.R, new.camera.t, camera.R, camera.t, near[3:], True)
        return np.array((*t, *rotation))

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Evaluate the feature in NumPy: see :meth:`Feature.evaluate`."""
        assert goal.camera is not None
        near = np.zeros(6) if previous is None else previous
        continues = previous is not None
        camera = state.camera
        wanted = goal.camera
        v, omega = state.camera_twist.reshape(2, 3)
        v_dot, omega_dot = state.camera_drift.reshape(2, 3)
        twist = (v, omega, v_dot, omega_dot)
        motion = pose_motion(wanted.R, wanted.t, camera.R, camera.t, near[3:], continues, twist)
        J_t = rotate(motion.E, state.camera_J[:3])
        J_theta_u = rotate(motion.L, state.camera_J[3:])
        J: Array = np.concatenate((J_t, J_theta_u))
        velocity = np.array((*motion.t_dot, *motion.theta_u_dot))
        return FeatureMotion(
            error=np.array((*motion.t, *motion.theta_u)),
            J=J,
            velocity=velocity,
            drift=np.array((*motion.t_ddot, *motion.theta_u_ddot)),
            partial=velocity - J @ state.robot.qd,
        )


class Rotation(Feature):
    """Rotation s = θu of c*R_C from the goal to the camera [rad].

    ṡ = L_θu ω (Malis, Chaumette and Boudet 1999).
    """

    name = "rotation"
    reached_by = "feature"

    def size(self, markers: int) -> int:
        """Return 3."""
        return 3

    def check_goal(self, goal: Goal) -> None:
        """Raise ConfigurationError if the goal has no pose."""
        require_pose(self, goal)

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return the reference relative to a new goal: see :meth:`Feature.carried`."""
        return CameraPose().carried(_padded(reference), old, new, _padded(near))[3:]

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Evaluate the feature: see :meth:`Feature.evaluate`."""
        last = None if previous is None else _padded(previous)
        return FeatureMotion(*(part[3:] for part in CameraPose().evaluate(state, goal, last)))


def _padded(rotation: Array) -> Array:
    """Return (0, 0, 0, θu) (6,): the feature of a pose with this θu (3,) and no translation."""
    return np.concatenate((np.zeros(3), rotation))


def require_pose(feature: Feature, goal: Goal) -> None:
    """Raise ConfigurationError if a goal has no pose, which the feature needs."""
    if goal.camera is None:
        raise ConfigurationError(
            f"a {feature.name} task needs goals with a camera pose: camera_at_q or camera_pose"
        )
