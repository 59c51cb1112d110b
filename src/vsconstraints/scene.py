"""What a robot's camera sees, and how that changes: evaluated once per control step, used by tasks and rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .camera import Camera
from .errors import InvalidInput, SceneError
from .geometry import Pose, skew
from .kinematics import Kinematics, RobotPoint
from .robot import Robot
from .rows import Array

MINIMUM_DEPTH = 1e-3
"""Depth [m] in front of the camera below which a marker cannot be projected."""


def interaction_matrix(xy: Array, Z: Array) -> Array:
    """(m, 2, 6) L_sx of eq. (24) for normalised image points ``xy`` (m, 2) at depths ``Z`` (m,) [m]."""
    x, y = xy[:, 0], xy[:, 1]
    L = np.zeros((len(xy), 2, 6))
    L[:, 0, 0] = L[:, 1, 1] = -1.0 / Z
    L[:, :, 2] = xy / Z[:, None]
    L[:, 0, 3] = x * y
    L[:, 0, 4] = -1.0 - x * x
    L[:, 0, 5] = y
    L[:, 1, 3] = 1.0 + y * y
    L[:, 1, 4] = -x * y
    L[:, 1, 5] = -x
    return L


@dataclass(frozen=True, slots=True)
class PointMotion:
    """Where points are and how they move, in the image (d = 2) or in space (d = 3).

    Attributes
    ----------
    position
        (m, d) coordinates.
    J
        (m, d, n) ∂position/∂q.
    velocity
        (m, d) time derivative.
    drift
        (m, d) second time derivative when q̈ = 0.
    """

    position: Array
    J: Array
    velocity: Array
    drift: Array


@dataclass(frozen=True, slots=True)
class State:
    """One instant of a scene.

    Attributes
    ----------
    t
        Time [s].
    robot
        Kinematics of the tip and of the robot points that constraints ask for, in the base frame.
    camera
        Pose of the camera in the base frame.
    camera_J, camera_drift
        (6, n) and (6,): Jacobian and J̇ q̇ of the camera's twist (v, ω), expressed in the camera frame.
    depth
        (m,) Z of the markers in the camera frame [m].
    normalised, pixels
        The markers in the image: normalised coordinates, and pixels from the image's centre.
    """

    t: float
    robot: Kinematics
    camera: Pose
    camera_J: Array
    camera_drift: Array
    depth: Array
    normalised: PointMotion
    pixels: PointMotion


class Scene:
    """A robot that carries a camera and looks at markers.

    Attributes
    ----------
    robot, camera
        Who looks, and through what.
    markers
        (m, 3) positions of the target's markers in the base frame [m].
    points
        Robot points whose motion constraints need.
    """

    def __init__(self, robot: Robot, camera: Camera, markers: Array, points: Sequence[RobotPoint] = ()) -> None:
        self.robot, self.camera = robot, camera
        self.markers = np.array(markers, dtype=np.float64)
        if self.markers.ndim != 2 or self.markers.shape[1] != 3 or not np.isfinite(self.markers).all():
            raise InvalidInput(f"markers must be (m, 3) finite numbers; the shape is {self.markers.shape}")
        self.points = tuple(points)
        self._evaluate_robot = robot.evaluator(self.points)
        self._mount_twist = camera.mount.twist_matrix
        self._mount_inverse = camera.mount.inverse
        self._focal = np.array(camera.focal)

    def camera_pose(self, q: object) -> Pose:
        """Pose of the camera in the base frame at ``q`` (n,)."""
        return self.robot.pose(self.robot.configuration(q)) @ self._mount_inverse

    def project(self, camera: Pose) -> Array:
        """(m, 2) pixels of the markers seen from a camera pose; raises SceneError if one is not in front."""
        P = (self.markers - camera.t) @ camera.R
        self._demand_in_front(P[:, 2])
        return self.camera.pixels(P[:, :2] / P[:, 2:])

    def evaluate(self, t: float, q: Array, qd: Array) -> State:
        """Everything that tasks and rows need, at time ``t`` [s], ``q`` and ``qd`` (n,).

        Raises
        ------
        SceneError
            if a marker is not in front of the camera.
        """
        robot = self._evaluate_robot(q, qd)
        camera = robot.tip @ self._mount_inverse
        J, drift = self._mount_twist @ robot.J, self._mount_twist @ robot.drift
        twist = J @ qd
        v, omega = twist[:3], twist[3:]
        P = (self.markers - camera.t) @ camera.R
        Z = P[:, 2]
        self._demand_in_front(Z)
        xy = P[:, :2] / P[:, 2:]
        J_xy = interaction_matrix(xy, Z) @ J
        xy_dot = J_xy @ qd
        # a fixed point seen from a moving frame: Ṗ = −v − ω × P and P̈ = −v̇ − ω̇ × P − ω × Ṗ
        turn = skew(omega)
        P_dot = P @ turn - v
        P_ddot = P @ skew(drift[3:]) - drift[:3] + P_dot @ turn
        # twice the derivative of x Z = X
        xy_ddot = (P_ddot[:, :2] - xy * P_ddot[:, 2:] - 2.0 * xy_dot * P_dot[:, 2:]) / P[:, 2:]
        F = self._focal
        return State(
            t,
            robot,
            camera,
            J,
            drift,
            Z,
            PointMotion(xy, J_xy, xy_dot, xy_ddot),
            PointMotion(self.camera.pixels(xy), J_xy * F[:, None], xy_dot * F, xy_ddot * F),
        )

    def glance(self, q: Array) -> tuple[Array, Array]:
        """(m, 2) pixels of the markers and (k, 3) robot points at ``q`` (n,), without their motion."""
        robot = self._evaluate_robot(q, np.zeros(self.robot.n))
        return self.project(robot.tip @ self._mount_inverse), robot.points

    @staticmethod
    def _demand_in_front(Z: Array) -> None:
        if (Z < MINIMUM_DEPTH).any():
            which = ", ".join(f"marker {i + 1} (depth {Z[i]:.3g} m)" for i in np.flatnonzero(Z < MINIMUM_DEPTH))
            raise SceneError(f"not in front of the camera: {which}")
