# /// script
# requires-python = ">=3.10,<3.13"
# dependencies = [
#   "tsid==1.7.1", "pin==3.4.0", "cmeel-urdfdom<5", "cmeel-tinyxml2<11", "msgspec", "numpy"
# ]
# ///
"""TSID: inverse dynamics as a QP over accelerations; it commands accelerations.

Settings
--------
stiffness, damping
    Kp [1/s²] and Kd [1/s] of the task; by default Kd = 2 √Kp.
bounds
    ``"velocity"``: ``TaskJointBounds``; ``"viability"``: ``TaskJointPosVelAccBounds``, which also
    keeps ranges; ``"none"``.
"""

from importlib.metadata import version

import numpy as np
import pinocchio as pin
import tsid.tsid_pywrap as tsid
from servoing import Scene, from_limits, settings_of
from stack_io import NoAnswer, serve

#: Defaults of the settings.
DEFAULTS = {
    "stiffness": 30.0,
    "damping": None,
    "bounds": "velocity",
}


class TsidStack:
    """``InverseDynamicsFormulationAccForce`` on the camera's pose."""

    name = f"tsid {version('tsid')}"
    output = "acceleration"
    features = ("camera-pose",)
    uses = (*Scene.uses, "urdf", "limits", "q", "qd")

    def start(self, setup):
        """Build robot, task, bounds and solver."""
        own = settings_of(setup, DEFAULTS)
        self.scene = Scene(setup, self.features)
        model = pin.buildModelFromXML(setup["urdf"])
        self.robot = robot = tsid.RobotWrapper(model, tsid.RootJointType.FIXED_BASE_SYSTEM, False)
        self.frame = model.getFrameId(setup["tip"])
        self.problem = problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
        q = pin.neutral(model)
        qd = np.zeros(model.nv)
        problem.computeProblemData(0.0, q, qd)
        stiffness = own["stiffness"]
        damping = own["damping"]
        if damping is None:
            damping = 2.0 * np.sqrt(stiffness)
        self.task = task = tsid.TaskSE3Equality("tip", robot, setup["tip"])
        task.setKp(np.full(6, stiffness))
        task.setKd(np.full(6, damping))
        task.useLocalFrame(True)
        weight = 1.0
        problem.addMotionTask(task, weight, 1, 0.0)
        self.bounds = self.joint_bounds(own["bounds"], setup)
        if self.bounds is not None:
            problem.addMotionTask(self.bounds, weight, 0, 0.0)
        self.solver = tsid.SolverHQuadProgFast("solver")
        self.solver.resize(problem.nVar, problem.nEq, problem.nIn)

    def joint_bounds(self, kind, setup):
        """Return TSID's task of a kind of bounds; None without one."""
        limits = setup["limits"]
        period = setup["period"]
        lower = from_limits(limits["lower"], -1e3)
        upper = from_limits(limits["upper"], 1e3)
        speed = from_limits(limits["velocity"], 1e3)
        most = np.full(len(speed), 1e3)
        if limits["acceleration"] is not None:
            most = from_limits(limits["acceleration"], 1e3)
        bounds = None
        if kind == "velocity":
            bounds = tsid.TaskJointBounds("bounds", self.robot, period)
            bounds.setVelocityBounds(-speed, speed)
            bounds.setAccelerationBounds(-most, most)
        elif kind == "viability":
            bounds = tsid.TaskJointPosVelAccBounds("bounds", self.robot, period, False)
            bounds.setPositionBounds(lower, upper)
            bounds.setVelocityBounds(speed)
            bounds.setAccelerationBounds(most)
        elif kind != "none":
            raise SystemExit(f"bounds are velocity, viability or none, not {kind!r}")
        return bounds

    def step(self, now):
        """Return q̈ (n,)."""
        t = now["t"]
        q = np.array(now["q"])
        qd = np.array(now["qd"])
        self.problem.computeProblemData(t, q, qd)
        tip = self.robot.framePosition(self.problem.data(), self.frame)
        goal = pin.SE3(self.scene.tip_goal(now, tip.homogeneous))
        rotation = goal.rotation.ravel(order="F")
        sample = tsid.TrajectorySample(12, 6)
        sample.value(np.concatenate((goal.translation, rotation)))
        self.task.setReference(sample)
        data = self.problem.computeProblemData(t, q, qd)
        answer = self.solver.solve(data)
        if answer.status != 0:
            raise NoAnswer(f"the solver's status is {answer.status}")
        return np.array(self.problem.getAccelerations(answer))


if __name__ == "__main__":
    serve(TsidStack())
