"""A controller in an own loop: replace the lines marked `robot` by a real arm's interface."""

import numpy as np

from vsconstraints import Camera, RobotPoint
from vsconstraints.constraints import ConstraintSet, FieldOfView, ForbiddenSphere, JointSpeed, robot_points
from vsconstraints.control_step import ControlStep
from vsconstraints.controllers import SlidingMode
from vsconstraints.features import CameraPose, Goal
from vsconstraints.robots import ur5
from vsconstraints.scene import Scene
from vsconstraints.tracking import TrackingGains, VisualTask

Ts = 0.002
robot, camera = ur5(), Camera(focal_px=(600.0, 600.0), size_px=(640.0, 480.0))
markers = np.array([[0.35, -0.05, 0.0], [0.45, -0.05, 0.0], [0.45, 0.05, 0.0], [0.35, 0.05, 0.0]])
constraints = [
    FieldOfView(camera, margin=0.05, K=0.15, switching_gain=5.0),
    JointSpeed(robot, switching_gain=3.0),
    ForbiddenSphere(
        centre=(0.1, 0.1, 0.2), radius=0.1, K=0.15, switching_gain=0.5, points=[RobotPoint("forearm_link")]
    ),
]
scene = Scene(robot, camera, markers, robot_points(constraints))
q, qd = np.array([-0.24, -1.8, 2.0, -1.77, -1.57, -0.24]), np.zeros(6)
desired = scene.camera_pose(q + np.array([0.1, 0.05, -0.05, 0.0, 0.05, 0.6]))
pixels = scene.project(desired)
task = VisualTask(
    CameraPose(), [Goal(0.0, pixels, camera.normalised(pixels), desired)], TrackingGains(Kp0=10.0, Kp_slope=5.0)
)
to_command = ControlStep(scene, ConstraintSet(constraints, scene), task).bind(SlidingMode())

for k in range(3000):
    now, command = to_command(k * Ts, q, qd)
    if command.status != "ok":
        raise SystemExit(f"{command.status}: {command.reason}")
    q, qd = q + Ts * qd + 0.5 * Ts**2 * command.qdd, qd + Ts * command.qdd  # robot
distance, angle = np.linalg.norm(now.error[:3]), np.linalg.norm(now.error[3:])
print(f"error after {k * Ts:.1f} s: {distance * 1e3:.2f} mm, {angle * 1e3:.2f} mrad")
