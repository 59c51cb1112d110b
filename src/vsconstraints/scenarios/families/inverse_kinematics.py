"""From the pose that a tip shall have to joint coordinates within the robot's ranges."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ...robots.geometry import Pose
from ...robots.robot import Robot
from ...rows import Array

CLOSE = 1e-9
"""Error of a pose, ‖(m, rad)‖, that counts as none."""

MOST_STEPS = 60
LONGEST_STEP = 0.5
"""Of any joint [rad or m], so that the steps stay near where the linearisation holds."""

DAMPING = 0.02
"""Share of the squared error by which singular directions are damped: none is left at the solution."""


def inverse_kinematics(robot: Robot, tip: Pose, near: Array) -> Array | None:
    """Joint coordinates (n,) at which the tip is there, found from ``near`` (n,); None if that finds none in range.

    Steps of Levenberg and Marquardt on the logarithm of the pose's error, each clipped to the joints' ranges:
    δq = (JᵀJ + μ I)⁻¹ Jᵀ e with μ falling to zero with ‖e‖² (Sugihara, IEEE Trans. Robotics 27, 2011).
    """
    model, frame = robot.model, robot.frame_id("tip")
    data, wanted, eye = model.createData(), pin.SE3(tip.R, tip.t), np.eye(robot.n)
    q = np.clip(near, robot.q_min, robot.q_max)
    for _ in range(MOST_STEPS):
        pin.computeJointJacobians(model, data, q)
        there = pin.updateFramePlacement(model, data, frame).actInv(wanted)
        error = pin.log6(there).vector
        squared = float(error @ error)
        if squared <= CLOSE**2:
            return np.asarray(q)
        J = pin.Jlog6(there.inverse()) @ pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
        step = np.linalg.solve(J.T @ J + (DAMPING * squared + 1e-12) * eye, J.T @ error)
        q = np.clip(q + step / max(1.0, np.abs(step).max() / LONGEST_STEP), robot.q_min, robot.q_max)
    return None
