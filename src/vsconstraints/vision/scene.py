"""Scene of robot, camera and markers, evaluated once per control step for tasks and rows.

All quantities follow from the motion of the camera relative to the target. The target's frame is
the base frame for a static target, moves with a moving target, and is the robot's tip frame for a
target that the robot carries in front of a fixed camera (eye-to-hand).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInput, SceneError
from ..formulas.features import MINIMUM_DEPTH as MINIMUM_DEPTH
from ..formulas.features import image_motion, image_row
from ..formulas.motion import carried, relative_twist
from ..formulas.vectors import cross, minus
from ..robots.geometry import Pose
from ..robots.kinematics import Kinematics, RobotPoint
from ..robots.robot import Robot
from ..rows import Array
from ..rows.readable import counted, in_one_line
from .camera import Camera
from .motion import TargetMotion


def interaction_matrix(xy: Array, Z: Array) -> Array:
    """Return L_sx (m, 2, 6) of eq. (24) at normalised image points and depths.

    Points ``xy`` are (m, 2), depths ``Z`` (m,) [m].
    """
    x = xy[:, 0]
    y = xy[:, 1]
    L = np.empty((len(Z), 2, 6))
    for row in (0, 1):
        for column, entry in enumerate(image_row(row, x, y, Z)):
            L[:, row, column] = entry
    return L


@dataclass(frozen=True, slots=True)
class PointMotion:
    """Positions of points and their motion, in the image (d = 2) or in space (d = 3)."""

    position: Array  #: (m, d) coordinates.
    J: Array  #: (m, d, n) ∂position/∂q.
    velocity: Array  #: (m, d) time derivative.
    drift: Array  #: (m, d) second time derivative when q̈ = 0.


@dataclass(frozen=True, slots=True)
class State:
    """One instant of a scene, true or as a controller believes it."""

    t: float
    #: Kinematics of the tip and of the robot points of the constraints, in the base frame.
    robot: Kinematics
    camera: Pose  #: Pose of the camera in the target's frame.
    #: (6, n) ∂(v, ω)/∂q̇ of the twist relative to the target, in the camera frame.
    camera_J: Array
    camera_twist: Array  #: (6,) that twist: J q̇ minus the target's motion.
    camera_drift: Array  #: (6,) its derivative when q̈ = 0.
    depth: Array  #: (m,) Z of the markers in the camera frame [m].
    normalised: PointMotion  #: The markers in normalised coordinates.
    pixels: PointMotion  #: The markers in pixels from the image centre.
    believed: bool = False  #: True if motions that a controller does not know count as zero.


class Scene:
    """Robot, camera and markers; the robot carries either the camera or the markers.

    Markers (m, 3) are in the target's frame [m]: the base frame at t = 0 or, for a camera that is
    fixed in space, the robot's tip frame. ``points`` are robot points whose motion constraints
    need. ``motion`` is the target's motion, None if it is static or carried by the robot.
    """

    def __init__(
        self,
        robot: Robot,
        camera: Camera,
        markers: Array,
        points: Sequence[RobotPoint] = (),
        motion: TargetMotion | None = None,
    ) -> None:
        self.robot = robot
        self.camera = camera
        self.motion = motion
        self.markers = np.array(markers, dtype=np.float64)
        if (
            self.markers.ndim != 2
            or self.markers.shape[1] != 3
            or not np.isfinite(self.markers).all()
        ):
            raise InvalidInput(
                f"markers must be (m, 3) finite numbers; the shape is {self.markers.shape}"
            )
        if motion is not None and camera.fixed is not None:
            raise InvalidInput(
                "a target that the robot carries before a fixed camera has no motion of its own"
            )
        self.points = tuple(points)
        self._evaluate_robot = robot.evaluator(self.points)
        self._mount_twist = camera.mount.twist_matrix
        self._mount_inverse = camera.mount.inverse

    @in_one_line
    def __repr__(self) -> str:
        markers = counted(len(self.markers), "marker") + (
            ", moving" if self.motion is not None else ""
        )
        width, height = self.camera.size
        place = "on the robot" if self.camera.fixed is None else "fixed in space"
        return (
            f"<Scene: robot {self.robot.name}, {markers}, camera of {width:g} × {height:g} px "
            f"{place}>"
        )

    def camera_pose(self, q: object, t: float = 0.0) -> Pose:
        """Return the pose of the camera in the target's frame at ``q`` (n,) and time ``t`` [s]."""
        return self._camera(self.robot.pose(self.robot.configuration(q)), t)

    def _camera(self, tip: Pose, t: float) -> Pose:
        if self.camera.fixed is not None:
            return tip.inverse @ self.camera.fixed
        camera = tip @ self._mount_inverse
        return camera if self.motion is None else self.motion.pose(t).inverse @ camera

    def markers_at(self, q: object, t: float) -> Array:
        """Return the markers (m, 3) in the base frame at ``q`` (n,) and time ``t`` [s]."""
        if self.camera.fixed is not None:
            return self.robot.pose(self.robot.configuration(q)).act(self.markers)
        return self.markers if self.motion is None else self.motion.pose(t).act(self.markers)

    def project(self, camera: Pose) -> Array:
        """Return the pixels (m, 2) of the markers seen from a pose in the target's frame.

        Raises
        ------
        SceneError
            if a marker is not in front of the camera.
        """
        P = self._in_camera(camera)
        return self.camera.pixels(P[:, :2] / P[:, 2:])

    def depth(self, camera: Pose) -> Array:
        """Return the depths Z (m,) of the markers [m] seen from a pose in the target's frame.

        Raises as :meth:`project` does.
        """
        return self._in_camera(camera)[:, 2]

    def evaluate(self, t: float, q: Array, qd: Array) -> State:
        """Evaluate all quantities that tasks and rows need at ``t`` [s], ``q`` and ``qd`` (n,).

        Raises
        ------
        SceneError
            if a marker is not in front of the camera.
        """
        robot = self._evaluate_robot(q, qd)
        camera = self._camera(robot.tip, t)
        J, twist, drift = self._relative_motion(robot, t)
        P = self._in_camera(camera)
        depth = P[:, 2]
        v, omega = twist.reshape(2, 3)
        v_dot, omega_dot = drift.reshape(2, 3)
        x, y, x_dot, y_dot, x_ddot, y_ddot = image_motion(P.T, v, omega, v_dot, omega_dot)
        xy = np.stack((x, y), axis=1)
        xy_dot = np.stack((x_dot, y_dot), axis=1)
        xy_ddot = np.stack((x_ddot, y_ddot), axis=1)
        J_xy = interaction_matrix(xy, depth) @ J
        F = np.asarray(self.camera.focal)
        J_pixels = J_xy * F[:, None]
        normalised = PointMotion(xy, J_xy, xy_dot, xy_ddot)
        pixels = PointMotion(self.camera.pixels(xy), J_pixels, xy_dot * F, xy_ddot * F)
        return State(t, robot, camera, J, twist, drift, depth, normalised, pixels)

    def glance(self, q: Array, t: float = 0.0) -> tuple[Array, Array]:
        """Return the pixels (m, 2) of the markers and the robot points (k, 3) at ``q`` (n,).

        Their motion is not computed.
        """
        robot = self._evaluate_robot(q, np.zeros(self.robot.n))
        camera = self._camera(robot.tip, t)
        return self.project(camera), robot.points

    def kinematics(self, q: Array, qd: Array) -> Kinematics:
        """Return positions and motion of the robot and its points at ``q`` and ``qd`` (n,).

        The points are those that constraints need.
        """
        return self._evaluate_robot(q, qd)

    def camera_jacobian(self, q: Array) -> Array:
        """Return the Jacobian (6, n) of the camera's twist at ``q`` (n,).

        The twist is relative to a target that does not move by itself, in the camera frame.
        """
        tip, tip_J = self._evaluate_robot.tip_jacobian(q)
        J: Array = self._twist_of_camera(tip) @ tip_J
        return J

    def _twist_of_camera(self, tip: Pose) -> Array:
        """Return the map (6, 6) from the tip's twist, in its own axes, to that of the camera."""
        if self.camera.fixed is None:
            return self._mount_twist
        # as if the tip carried the camera: its motion is the reversed motion of the target
        reversed_twist: Array = -(self.camera.fixed.inverse @ tip).twist_matrix
        return reversed_twist

    def _relative_motion(self, robot: Kinematics, t: float) -> tuple[Array, Array, Array]:
        """Return the motion of the camera relative to the target, in the camera frame.

        It consists of the Jacobian (6, n), the twist (6,) and the drift (6,).
        """
        tip = robot.tip
        fixed = self.camera.fixed
        motion = self.motion
        R: Array
        r: Array
        # orientation of the camera in the base frame, and its position relative to the tip
        if fixed is None:
            R = tip.R @ self._mount_inverse.R
            r = tip.R @ self._mount_inverse.t
        else:
            R = fixed.R
            r = fixed.t - tip.t
        twist = robot.J @ robot.qd
        tip_v, tip_omega = twist.reshape(2, 3)
        tip_v_dot, tip_omega_dot = robot.drift.reshape(2, 3)
        v = tip.R @ tip_v
        omega = tip.R @ tip_omega
        alpha = tip.R @ tip_omega_dot
        # acceleration of the origin from the derivative of a twist in moving axes
        of_axes = np.array(cross(tip_omega, tip_v))
        linear = tip.R @ (tip_v_dot + of_axes)
        velocity, acceleration = carried(r, v, omega, linear, alpha)
        turning: Array = np.zeros(3)
        away: Array = np.zeros(3)
        if motion is not None:
            d_dot, d_ddot = motion.translation.rates(t)
            velocity = minus(velocity, d_dot)
            acceleration = minus(acceleration, d_ddot)
            turning = motion.angular_velocity
            away = tip.t + r - motion.centre - motion.translation.displacement(t)
        parts = relative_twist(velocity, acceleration, omega, alpha, turning, away)
        sign = 1.0 if fixed is None else -1.0
        v, omega, v_dot, omega_dot = sign * (np.array(parts) @ R)
        J = self._twist_of_camera(tip) @ robot.J
        camera_twist = np.concatenate((v, omega))
        camera_drift = np.concatenate((v_dot, omega_dot))
        return J, camera_twist, camera_drift

    def _in_camera(self, camera: Pose) -> Array:
        P: Array = (self.markers - camera.t) @ camera.R
        Z = P[:, 2]
        behind = np.flatnonzero(Z < MINIMUM_DEPTH)
        if len(behind):
            which = ", ".join(f"marker {i + 1} (depth {Z[i]:.3g} m)" for i in behind)
            raise SceneError(f"not in front of the camera: {which}")
        return P
