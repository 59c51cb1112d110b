# /// script
# requires-python = ">=3.10"
# dependencies = ["roboticstoolbox-python==1.5.0", "qpsolvers", "daqp", "msgspec", "numpy"]
# ///
"""robotics-toolbox-python: resolved-rate control as a QP with slack, as in its example NEO.

The twist of the tip is that of ``p_servo`` in base axes; ranges act by ``joint_velocity_damper``,
speeds as bounds. With the term of manipulability this is NEO without obstacles (Haviland and Corke,
2020).

Settings
--------
gain
    Gain of ``p_servo`` [1/s].
view_gain
    α of the rows dσ/dt ≤ −α σ of the field of view [1/s]; 0 leaves them out.
manipulability
    False leaves out the term that makes the arm more dexterous.
damper_stop, damper_influence
    Distances [rad] from a range limit at which joints stop, and at which the damper begins.
velocity_weight
    Weight of ‖q̇‖² relative to the slack.
solver
    Solver of qpsolvers.
"""

import tempfile
from pathlib import Path

import numpy as np
import qpsolvers
import roboticstoolbox as rtb
from servoing import Scene, from_limits, settings_of
from stack_io import NoAnswer, serve

#: Defaults of the settings.
DEFAULTS = {
    "gain": 2.0,
    "view_gain": 5.0,
    "manipulability": True,
    "damper_stop": 0.05,
    "damper_influence": 0.9,
    "velocity_weight": 0.01,
    "solver": "daqp",
}


class RoboticsToolboxStack:
    """``p_servo`` and the QP of ``neo.py`` on the camera's pose."""

    name = f"roboticstoolbox {rtb.__version__}"
    output = "velocity"
    features = ("camera-pose",)
    uses = (*Scene.uses, "urdf", "limits", "q", "pixels", "jacobian")

    def start(self, setup):
        """Build the robot."""
        own = settings_of(setup, DEFAULTS)
        self.scene = Scene(setup, self.features)
        self.gain = own["gain"]
        self.view_gain = own["view_gain"]
        self.manipulability = own["manipulability"]
        self.stop = own["damper_stop"]
        self.influence = own["damper_influence"]
        self.weight = own["velocity_weight"]
        self.solver = own["solver"]
        self.most = from_limits(setup["limits"]["velocity"], 1e6)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(setup["urdf"], encoding="utf-8")
            self.robot = rtb.Robot.URDF(str(path))
        self.tip = setup["tip"]

    def step(self, now):
        """Return q̇ (n,)."""
        q = np.array(now["q"])
        robot = self.robot
        n = len(q)
        tip = np.asarray(robot.fkine(q, end=self.tip))
        goal = self.scene.tip_goal(now, tip)
        twist, _ = rtb.p_servo(tip, goal, self.gain, 0.0, method="angle-axis")
        twist = np.asarray(twist, dtype=float).ravel()
        goal_in_tip = np.linalg.inv(tip) @ goal
        distances = np.abs(goal_in_tip[:3, 3])
        error = np.sum(distances)
        # as in neo.py: the slack costs more the nearer the goal is
        slack_weight = 1.0 / max(error, 1e-3)
        Q = np.diag([self.weight] * n + [slack_weight] * 6)
        J = robot.jacob0(q, end=self.tip)
        equality = np.hstack((J, np.eye(6)))
        G, h = self.rows(q, now)
        # none of them limits the slack
        G = np.hstack((G, np.zeros((len(G), 6))))
        c = np.zeros(n + 6)
        if self.manipulability:
            slope = robot.jacobm(q, end=self.tip)
            c[:n] = -slope.ravel()
        bounds = np.concatenate((self.most, np.full(6, 10.0)))
        answer = qpsolvers.solve_qp(
            Q,
            c,
            G,
            h,
            equality,
            twist,
            lb=-bounds,
            ub=bounds,
            solver=self.solver,
        )
        if answer is None:
            raise NoAnswer("the QP has no solution")
        return answer[:n]

    def rows(self, q, now):
        """Return the rows G q̇ ≤ h of ranges and field of view."""
        G, h = self.robot.joint_velocity_damper(q, self.stop, self.influence, len(q))
        sigma, A = self.scene.view_rows(now)
        if self.view_gain <= 0.0 or not len(sigma):
            return G, h
        camera_J = np.array(now["jacobian"])
        view_bound = -self.view_gain * sigma
        return np.vstack((G, A @ camera_J)), np.concatenate((h, view_bound))


if __name__ == "__main__":
    serve(RoboticsToolboxStack())
