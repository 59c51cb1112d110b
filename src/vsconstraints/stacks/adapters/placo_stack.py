# /// script
# requires-python = ">=3.10"
# dependencies = ["placo==0.10.2", "numpy"]
# ///
"""placo: inverse kinematics with weighted tasks and hard constraints as a QP.

placo's solver takes a full step to the target; with a gain, the target is moved to the share λ T_s
of the way there.

Settings
--------
gain
    λ [1/s]; 0 lets placo step to the goal at once, as it does by itself.
view_gain
    α of the rows dσ/dt ≤ −α σ of the field of view [1/s]; 0 leaves them out.
joint_limits, velocity_limits
    False switches off the limits of placo.
regularization
    Weight of the regularization task.
"""

from importlib.metadata import version

import numpy as np
import placo
from servoing import Scene, axis_and_angle, from_limits
from stack_io import NoAnswer, serve


def between(start, goal, share):
    """Return the pose at a share of the way from one pose to another, (4, 4) each.

    The origin moves on a line, and the axes turn about one axis.
    """
    R = start[:3, :3].T @ goal[:3, :3]
    axis, angle = axis_and_angle(R)
    out = start.copy()
    out[:3, 3] += share * (goal[:3, 3] - start[:3, 3])
    if np.linalg.norm(axis) > 1e-12:
        x, y, z = axis / np.linalg.norm(axis)
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turned = share * angle
        out[:3, :3] = start[:3, :3] @ (
            np.eye(3) + np.sin(turned) * K + (1.0 - np.cos(turned)) * K @ K
        )
    return out


class PlacoStack:
    """``placo.KinematicsSolver`` on the camera's pose."""

    name = f"placo {version('placo')}"
    output = "velocity"
    uses = (
        "urdf", "limits", "camera", "target", "goals", "constraints",
        "q", "pixels", "pose", "jacobian",
    )  # fmt: skip

    def start(self, setup):
        """Build robot, solver and task."""
        own = setup["settings"]
        self.scene = Scene(setup)
        self.scene.require_pose("placo")
        self.period = setup["period"]
        self.gain = own.get("gain", 2.0)
        self.view_gain = own.get("view_gain", 5.0)
        self.joints = setup["joints"]
        flags = placo.Flags.ignore_collisions
        self.robot = placo.RobotWrapper("", flags, setup["urdf"])
        speeds = from_limits(setup["limits"]["velocity"], 1e6)
        for joint, speed in zip(self.joints, speeds, strict=True):
            self.robot.set_velocity_limit(joint, speed)
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.solver.dt = self.period
        self.solver.enable_joint_limits(own.get("joint_limits", True))
        self.solver.enable_velocity_limits(own.get("velocity_limits", True))
        self.tip = setup["tip"]
        self.task = self.solver.add_frame_task(self.tip, np.eye(4))
        self.task.configure("tip", "soft", 1.0, 1.0)
        self.solver.add_regularization_task(own.get("regularization", 1e-8))
        # places of the joints in Δq, after the six of a floating base
        self.at = [self.robot.get_joint_v_offset(joint) for joint in self.joints]
        # places in half-spaces, which are of all coordinates, seven of them of the floating base
        self.columns = [self.robot.get_joint_offset(joint) for joint in self.joints]
        self.coordinates = self.robot.model.nq

    def step(self, now):
        """Return q̇ (n,)."""
        q = np.array(now["q"])
        for joint, value in zip(self.joints, q, strict=True):
            self.robot.set_joint(joint, value)
        self.robot.update_kinematics()
        tip = self.robot.get_T_world_frame(self.tip)
        goal = self.scene.tip_goal(now, tip)
        if self.gain > 0.0:
            goal = between(tip, goal, self.gain * self.period)
        self.task.T_world_frame = goal
        sigma, A = self.scene.view_rows(now)
        rows = None
        if self.view_gain > 0.0 and len(sigma):
            rates = A @ np.array(now["jacobian"])
            G = np.zeros((len(sigma), self.coordinates))
            G[:, self.columns] = rates
            # placo's half-spaces are of the coordinates after the step
            bound = rates @ q - self.view_gain * self.period * sigma
            rows = self.solver.add_joint_space_half_spaces_constraint(G, bound)
            rows.configure("view", "hard", 1.0)
        try:
            step = self.solver.solve(False)
        except RuntimeError as error:
            raise NoAnswer(str(error)[:100]) from error
        finally:
            if rows is not None:
                self.solver.remove_constraint(rows)
        return np.asarray(step)[self.at] / self.period


if __name__ == "__main__":
    serve(PlacoStack())
