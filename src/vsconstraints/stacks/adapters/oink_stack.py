# /// script
# requires-python = ">=3.10"
# dependencies = ["roboplan-oink==0.7.0", "msgspec", "numpy"]
# ///
"""roboplan-oink (OInK): optimal inverse kinematics as a QP, with its own limits.

Its constraints cannot be defined in Python, so the field of view is not among them.

Settings
--------
gain
    Gain λ of the task [1/s]. OInK's own ``task_gain`` is the fraction λ T_s per period.
lm_damping
    Weight of the Levenberg–Marquardt damping of the task.
limit_gain
    Share of the distance to a range limit that a period may use.
acceleration_limit
    True adds OInK's ``AccelerationLimit`` with the limits of the scenario.
"""

from importlib.metadata import version

import numpy as np
import roboplan.core as core
import roboplan.optimal_ik as oink
from servoing import Scene, acceleration_limits, from_limits, settings_of
from stack_io import NoAnswer, serve

#: Defaults of the settings.
DEFAULTS = {
    "gain": 2.0,
    "lm_damping": 1e-6,
    "limit_gain": 0.5,
    "acceleration_limit": False,
}


class OinkStack:
    """``Oink.solveIk`` on the camera's pose."""

    name = f"roboplan-oink {version('roboplan-oink')}"
    output = "velocity"
    features = ("camera-pose",)
    uses = (*Scene.uses, "urdf", "limits", "q", "qd")

    def start(self, setup):
        """Build scene, solver, task and limits."""
        own = settings_of(setup, DEFAULTS)
        self.scene = Scene(setup, self.features)
        self.period = period = setup["period"]
        self.tip = setup["tip"]
        description = core.loadUrdfSceneDescriptionFromXml(setup["urdf"])
        self.robot = core.Scene("scene", description)
        self.solver = oink.Oink(self.robot)
        gain = own["gain"]
        damping = own["lm_damping"]
        options = oink.FrameTaskOptions(task_gain=gain * period, lm_damping=damping)
        anywhere = np.eye(4, order="F")
        goal = core.CartesianConfiguration("base", self.tip, anywhere)
        self.task = oink.FrameTask(self.solver, self.robot, goal, options)
        speeds = from_limits(setup["limits"]["velocity"], 1e6)
        self.limits = [
            oink.PositionLimit(self.solver, own["limit_gain"]),
            oink.VelocityLimit(self.solver, period, speeds),
        ]
        self.acceleration = None
        if own["acceleration_limit"]:
            most = acceleration_limits(setup)
            self.acceleration = oink.AccelerationLimit(self.solver, period, most)
            self.limits.append(self.acceleration)
        self.last = None  # last velocity that was commanded

    def step(self, now):
        """Return q̇ (n,)."""
        q = np.array(now["q"])
        self.robot.setJointPositions(q)
        tip = np.array(self.robot.forwardKinematics(q, self.tip))
        goal = self.scene.tip_goal(now, tip)
        self.task.setTargetFrameTransform(np.asfortranarray(goal))
        if self.acceleration is not None:
            last = np.array(now["qd"]) if self.last is None else self.last
            self.acceleration.setLastVelocity(last)
        step = np.zeros(len(q))
        try:
            self.solver.solveIk(self.robot, [self.task], self.limits, step)
        except RuntimeError as error:
            self.last = None
            raise NoAnswer(str(error)[:100]) from error
        self.last = step / self.period
        return self.last


if __name__ == "__main__":
    serve(OinkStack())
