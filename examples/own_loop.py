"""A controller in an own loop that reads a camera: replace the class `World` by a real arm's and
camera's interface.
"""

import numpy as np

from vsconstraints import Camera, RobotPoint
from vsconstraints.constraints import (
    ConstraintSet,
    FieldOfView,
    ForbiddenSphere,
    JointSpeed,
    robot_points,
)
from vsconstraints.control import ControlStep
from vsconstraints.controllers import SlidingMode
from vsconstraints.robots import ur5
from vsconstraints.vision.features import Goal, ImagePoints
from vsconstraints.vision.measurement import Plausible
from vsconstraints.vision.scene import Scene
from vsconstraints.vision.tracking import TrackingGains, VisualTask

Ts = 0.002
robot = ur5()
camera = Camera(focal_px=(600.0, 600.0), size_px=(640.0, 480.0))
markers = np.array([[0.35, -0.05, 0.0], [0.45, -0.05, 0.0], [0.45, 0.05, 0.0], [0.35, 0.05, 0.0]])
start = np.array([-0.24, -1.8, 2.0, -1.77, -1.57, -0.24])


class World:
    """The arm, and the target four centimetres from where the model has it, seen with noise at 50
    Hz.
    """

    def __init__(self):
        self.q = start.copy()
        self.qd = np.zeros(6)
        self.scene = Scene(robot, camera, markers + np.array([0.04, 0.0, 0.0]))
        self.rng = np.random.default_rng(0)

    def image(self):
        pose = self.scene.camera_pose(self.q)
        noise = 0.1 * self.rng.standard_normal((4, 2))
        return self.scene.project(pose) + noise, self.scene.depth(pose)

    def move(self, qdd):
        self.q = self.q + Ts * self.qd + 0.5 * Ts**2 * qdd
        self.qd = self.qd + Ts * qdd


# what the control knows
constraints = [
    FieldOfView(camera, margin=0.05, K=0.15, switching_gain=5.0),
    JointSpeed(robot, switching_gain=3.0),
    ForbiddenSphere(
        centre=(0.1, 0.1, 0.2),
        radius=0.1,
        K=0.15,
        switching_gain=0.5,
        points=[RobotPoint("forearm_link")],
    ),
]
scene = Scene(robot, camera, markers, robot_points(constraints))
desired = scene.camera_pose(start + np.array([0.1, 0.05, -0.05, 0.0, 0.05, 0.6]))
pixels = scene.project(desired)
goal = Goal(0.0, pixels, camera.normalised(pixels), desired, scene.depth(desired))
task = VisualTask(ImagePoints("mean"), [goal], TrackingGains(Kp0=10.0, Kp_slope=5.0))
# the target may be seen farther from where the model has it than by default, a tenth of the image's
# height
plausible = Plausible(image_share=0.2)
to_command = ControlStep(scene, ConstraintSet(constraints, scene), task, plausible=plausible).bind(
    SlidingMode()
)

world = World()
for k in range(4000):
    t = k * Ts
    if k % 10 == 0:
        seen, depth = world.image()
        taken = t
    # markers that a detector did not find would be NaN; without pixels the model alone would
    # predict the image
    now, command = to_command(t, world.q, world.qd, pixels=seen, depth=depth, taken=taken)
    # a remark says what of the measurement cannot be right
    if command.status != "ok" or command.remark:
        raise SystemExit(f"{command.status}: {command.reason or command.remark}")
    world.move(command.qdd)
off = np.abs(world.scene.project(world.scene.camera_pose(world.q)) - pixels).max()
print(f"after {t:.1f} s the markers are within {off:.2f} px of the goal")
