# /// script
# requires-python = ">=3.10"
# dependencies = ["placo==0.10.2", "msgspec", "numpy"]
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
from servoing import Scene, axis_and_angle, from_limits, pose, settings_of
from stack_io import NoAnswer, serve

#: Defaults of the settings.
DEFAULTS = {
    "gain": 2.0,
    "view_gain": 5.0,
    "joint_limits": True,
    "velocity_limits": True,
    "regularization": 1e-8,
}


def between(start, goal, share):
    """Return the pose at a share of the way from one pose to another, (4, 4) each.

    The origin moves on a line, and the axes turn about one axis.
    """
    R_start = start[:3, :3]
    R_goal = goal[:3, :3]
    t_start = start[:3, 3]
    t_goal = goal[:3, 3]
    R = R_start
    axis, angle = axis_and_angle(R_start.T @ R_goal)
    size = np.linalg.norm(axis)
    if size > 1e-12:
        # formula of Rodrigues
        x, y, z = axis / size
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turned = share * angle
        sine = np.sin(turned)
        cosine = np.cos(turned)
        R = R_start @ (np.eye(3) + sine * K + (1.0 - cosine) * K @ K)
    return pose(R, t_start + share * (t_goal - t_start))


def robot_of(setup):
    """Return placo's robot of a setup message, with its limits of speed."""
    robot = placo.RobotWrapper("", placo.Flags.ignore_collisions, setup["urdf"])
    speeds = from_limits(setup["limits"]["velocity"], 1e6)
    for joint, speed in zip(setup["joints"], speeds, strict=True):
        robot.set_velocity_limit(joint, speed)
    return robot


class PlacoStack:
    """``placo.KinematicsSolver`` on the camera's pose."""

    name = f"placo {version('placo')}"
    output = "velocity"
    features = ("camera-pose",)
    uses = (*Scene.uses, "urdf", "limits", "q", "pixels", "jacobian")

    def start(self, setup):
        """Build robot, solver and task."""
        own = settings_of(setup, DEFAULTS)
        self.scene = Scene(setup, self.features)
        self.period = setup["period"]
        self.gain = own["gain"]
        self.view_gain = own["view_gain"]
        self.joints = setup["joints"]
        self.robot = robot_of(setup)
        self.solver = solver = placo.KinematicsSolver(self.robot)
        solver.mask_fbase(True)
        solver.dt = self.period
        solver.enable_joint_limits(own["joint_limits"])
        solver.enable_velocity_limits(own["velocity_limits"])
        self.tip = setup["tip"]
        self.task = solver.add_frame_task(self.tip, np.eye(4))
        self.task.configure("tip", "soft", 1.0, 1.0)
        solver.add_regularization_task(own["regularization"])
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
        rows = self.add_view(now, q)
        try:
            step = self.solver.solve(False)
        except RuntimeError as error:
            raise NoAnswer(str(error)[:100]) from error
        finally:
            if rows is not None:
                self.solver.remove_constraint(rows)
        return np.asarray(step)[self.at] / self.period

    def add_view(self, now, q):
        """Add the half-spaces of the field of view, and return them; None without any."""
        sigma, A = self.scene.view_rows(now)
        if self.view_gain <= 0.0 or not len(sigma):
            return None
        rates = A @ np.array(now["jacobian"])
        G = np.zeros((len(sigma), self.coordinates))
        G[:, self.columns] = rates
        # placo's half-spaces are of the coordinates after the step
        bound = rates @ q - self.view_gain * self.period * sigma
        rows = self.solver.add_joint_space_half_spaces_constraint(G, bound)
        rows.configure("view", "hard", 1.0)
        return rows


if __name__ == "__main__":
    serve(PlacoStack())
