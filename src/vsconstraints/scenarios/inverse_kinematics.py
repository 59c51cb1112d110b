"""Configurations at which the camera has a pose."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ..robots.geometry import Pose
from ..robots.robot import Robot
from ..rows import Array
from ..vision.scene import Scene

POSE_TOLERANCE = 1e-9  #: pose error ‖(m, rad)‖ that counts as zero
MAX_STEPS = 60
#: largest step of any joint [rad or m], so that the linearisation remains valid
MAX_STEP = 0.5
#: damping of singular directions, relative to the squared error; it vanishes at the solution
DAMPING = 0.02


def inverse_kinematics(robot: Robot, tip: Pose, near: Array) -> Array | None:
    """Return a configuration (n,) at which the tip has a pose; None if none in range is found.

    Iterates from ``near`` (n,) by Levenberg–Marquardt steps on the logarithm of the pose error,
    each clipped to the joint ranges: δq = (JᵀJ + μ I)⁻¹ Jᵀ e with μ falling to zero with ‖e‖²
    (Sugihara, IEEE Trans. Robotics 27, 2011).
    """
    model = robot.model
    frame = robot.frame_id("tip")
    data = model.createData()
    wanted = pin.SE3(tip.R, tip.t)
    eye = np.eye(robot.n)
    q = np.clip(near, robot.q_min, robot.q_max)
    for _ in range(MAX_STEPS):
        pin.computeJointJacobians(model, data, q)
        present = pin.updateFramePlacement(model, data, frame)
        difference = present.actInv(wanted)
        error = pin.log6(difference).vector
        squared = float(error @ error)
        if squared <= POSE_TOLERANCE**2:
            return np.asarray(q)
        tip_J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
        J = pin.Jlog6(difference.inverse()) @ tip_J
        mu = DAMPING * squared + 1e-12
        step = np.linalg.solve(J.T @ J + mu * eye, J.T @ error)
        longest = np.abs(step).max()
        excess = max(1.0, longest / MAX_STEP)
        q = np.clip(q + step / excess, robot.q_min, robot.q_max)
    return None


def tip_of(scene: Scene, camera: Pose) -> Pose:
    """Return the pose of the tip in the base frame for a pose of the camera in the target's frame.

    The target is where it is at t = 0.
    """
    fixed = scene.camera.fixed
    if fixed is not None:
        return fixed @ camera.inverse
    return camera @ scene.camera.mount
