# /// script
# requires-python = ">=3.10,<3.13"
# dependencies = ["tsid==1.7.1", "pin==3.4.0", "cmeel-urdfdom<5", "cmeel-tinyxml2<11", "numpy"]
# ///
"""TSID: inverse dynamics as a QP over accelerations; it commands accelerations.

Settings
--------
stiffness, damping
    Kp [1/s²] and Kd [1/s] of the task; by default Kp = 30 and Kd = 2 √Kp.
bounds
    ``"velocity"``: ``TaskJointBounds``; ``"viability"``: ``TaskJointPosVelAccBounds``, which also
    keeps ranges; ``"none"``.
"""

from importlib.metadata import version

import numpy as np
import pinocchio as pin
import tsid.tsid_pywrap as tsid
from servoing import Scene, from_limits
from stack_io import NoAnswer, serve


class TsidStack:
    """``InverseDynamicsFormulationAccForce`` on the camera's pose."""

    name = f"tsid {version('tsid')}"
    output = "acceleration"
    uses = ("urdf", "limits", "camera", "target", "goals", "constraints", "q", "qd", "pose")

    def start(self, setup):
        """Build robot, task, bounds and solver."""
        own = setup["settings"]
        self.scene = Scene(setup)
        self.scene.require_pose("TSID")
        model = pin.buildModelFromXML(setup["urdf"])
        self.robot = robot = tsid.RobotWrapper(model, tsid.RootJointType.FIXED_BASE_SYSTEM, False)
        self.frame = model.getFrameId(setup["tip"])
        q = pin.neutral(model)
        self.problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
        self.problem.computeProblemData(0.0, q, np.zeros(model.nv))
        stiffness = own.get("stiffness", 30.0)
        damping = own.get("damping", 2.0 * np.sqrt(stiffness))
        self.task = tsid.TaskSE3Equality("tip", robot, setup["tip"])
        self.task.setKp(np.full(6, stiffness))
        self.task.setKd(np.full(6, damping))
        self.task.useLocalFrame(True)
        self.problem.addMotionTask(self.task, 1.0, 1, 0.0)
        limits = setup["limits"]
        speed = from_limits(limits["velocity"], 1e3)
        if limits["acceleration"] is None:
            most = np.full(model.nv, 1e3)
        else:
            most = from_limits(limits["acceleration"], 1e3)
        kind = own.get("bounds", "velocity")
        self.bounds = None
        if kind == "velocity":
            self.bounds = tsid.TaskJointBounds("bounds", robot, setup["period"])
            self.bounds.setVelocityBounds(-speed, speed)
            self.bounds.setAccelerationBounds(-most, most)
        elif kind == "viability":
            self.bounds = tsid.TaskJointPosVelAccBounds("bounds", robot, setup["period"], False)
            lower = from_limits(limits["lower"], -1e3)
            upper = from_limits(limits["upper"], 1e3)
            self.bounds.setPositionBounds(lower, upper)
            self.bounds.setVelocityBounds(speed)
            self.bounds.setAccelerationBounds(most)
        if self.bounds is not None:
            self.problem.addMotionTask(self.bounds, 1.0, 0, 0.0)
        self.solver = tsid.SolverHQuadProgFast("solver")
        self.solver.resize(self.problem.nVar, self.problem.nEq, self.problem.nIn)

    def step(self, now):
        """Return q̈ (n,)."""
        q = np.array(now["q"])
        qd = np.array(now["qd"])
        self.problem.computeProblemData(now["t"], q, qd)
        tip = self.robot.framePosition(self.problem.data(), self.frame).homogeneous
        goal = pin.SE3(self.scene.tip_goal(now, tip))
        sample = tsid.TrajectorySample(12, 6)
        sample.value(np.concatenate((goal.translation, goal.rotation.ravel(order="F"))))
        self.task.setReference(sample)
        data = self.problem.computeProblemData(now["t"], q, qd)
        answer = self.solver.solve(data)
        if answer.status != 0:
            raise NoAnswer(f"the solver's status is {answer.status}")
        return np.array(self.problem.getAccelerations(answer))


if __name__ == "__main__":
    serve(TsidStack())
