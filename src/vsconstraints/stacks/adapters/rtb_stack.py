# /// script
# requires-python = ">=3.10"
# dependencies = ["roboticstoolbox-python==1.5.0", "qpsolvers", "daqp", "numpy"]
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
from servoing import Scene, from_limits
from stack_io import NoAnswer, serve


class RoboticsToolboxStack:
    """``p_servo`` and the QP of ``neo.py`` on the camera's pose."""

    name = f"roboticstoolbox {rtb.__version__}"
    output = "velocity"
    uses = (
        "urdf", "limits", "camera", "target", "goals", "constraints",
        "q", "pixels", "pose", "jacobian",
    )  # fmt: skip

    def start(self, setup):
        """Build the robot."""
        own = setup["settings"]
        self.scene = Scene(setup)
        self.scene.require_pose("robotics-toolbox-python")
        self.gain = own.get("gain", 2.0)
        self.view_gain = own.get("view_gain", 5.0)
        self.manipulability = own.get("manipulability", True)
        self.stop = own.get("damper_stop", 0.05)
        self.influence = own.get("damper_influence", 0.9)
        self.weight = own.get("velocity_weight", 0.01)
        self.solver = own.get("solver", "daqp")
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
        error = np.sum(np.abs((np.linalg.inv(tip) @ goal)[:3, 3]))
        # as in neo.py: the slack costs more the nearer the goal is
        Q = np.diag([self.weight] * n + [1.0 / max(error, 1e-3)] * 6)
        equality = np.hstack((robot.jacob0(q, end=self.tip), np.eye(6)))
        G, h = robot.joint_velocity_damper(q, self.stop, self.influence, n)
        sigma, A = self.scene.view_rows(now)
        if self.view_gain > 0.0 and len(sigma):
            G = np.vstack((G, A @ np.array(now["jacobian"])))
            h = np.concatenate((h, -self.view_gain * sigma))
        c = np.zeros(n + 6)
        if self.manipulability:
            c[:n] = -robot.jacobm(q, end=self.tip).ravel()
        bounds = np.concatenate((self.most, np.full(6, 10.0)))
        answer = qpsolvers.solve_qp(
            Q,
            c,
            np.hstack((G, np.zeros((len(G), 6)))),
            h,
            equality,
            np.asarray(twist, dtype=float).ravel(),
            lb=-bounds,
            ub=bounds,
            solver=self.solver,
        )
        if answer is None:
            raise NoAnswer("the QP has no solution")
        return answer[:n]


if __name__ == "__main__":
    serve(RoboticsToolboxStack())
