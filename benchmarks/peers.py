"""Steps of other packages on a UR5, run in a separate process and possibly another environment.

``python -m benchmarks.peers NAME TURNS URDF`` prints times [s] as JSON. Without the package it ends
with the reason.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from .timing import compare

SAMPLING_TIME = 0.002


def pink(urdf: str) -> dict[str, Callable[[], object]]:
    """Differential kinematics as one QP, solved by daqp.

    It has joint ranges and speeds, and one frame task.
    """
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.limits import ConfigurationLimit, VelocityLimit
    from pink.tasks import FrameTask

    model, q, goal, frame = _ur5(urdf)
    task = FrameTask(frame, position_cost=1.0, orientation_cost=1.0)
    task.set_target(goal)
    configuration = Configuration(model, model.createData(), q)
    limits = [ConfigurationLimit(model), VelocityLimit(model)]

    def solve() -> Any:
        return solve_ik(configuration, [task], SAMPLING_TIME, solver="daqp", limits=limits)

    sign = 1.0
    speed = solve()

    def step() -> None:
        # alternate, so that no call starts where the last one did, and none at rest
        nonlocal sign
        sign = -sign
        configuration.update(pin.integrate(model, q, sign * 1e-3 * speed))
        solve()

    return {"solve_ik alone": solve, "configuration update and solve_ik": step}


def tsid(urdf: str) -> dict[str, Callable[[], object]]:
    """Inverse dynamics as a hierarchy of two levels.

    It has joint ranges, speeds and accelerations; one SE3 task; damping.
    """
    import numpy as np
    import tsid as t

    model, q, goal, frame = _ur5(urdf)
    robot = t.RobotWrapper(urdf, [], False)
    dynamics = t.InverseDynamicsFormulationAccForce("UR5", robot, False)
    v = np.zeros(robot.nv)
    dynamics.computeProblemData(0.0, q, v)
    motion = t.TaskSE3Equality("tool", robot, frame)
    motion.setKp(20.0 * np.ones(6))
    motion.setKd(9.0 * np.ones(6))
    trajectory = t.TrajectorySE3Constant("goal", goal)
    motion.setReference(trajectory.computeNext())
    dynamics.addMotionTask(motion, 1.0, 1, 0.0)
    posture = t.TaskJointPosture("posture", robot)
    posture.setKp(np.ones(robot.nv))
    posture.setKd(2.0 * np.ones(robot.nv))
    posture.setReference(t.TrajectoryEuclidianConstant("rest", q).computeNext())
    dynamics.addMotionTask(posture, 1e-3, 1, 0.0)
    bounds = t.TaskJointPosVelAccBounds("bounds", robot, SAMPLING_TIME, False)
    bounds.setPositionBounds(model.lowerPositionLimit, model.upperPositionLimit)
    bounds.setVelocityBounds(model.velocityLimit)
    bounds.setAccelerationBounds(50.0 * np.ones(robot.nv))
    dynamics.addMotionTask(bounds, 1.0, 0, 0.0)
    solver = t.SolverHQuadProgFast("solver")
    solver.resize(dynamics.nVar, dynamics.nEq, dynamics.nIn)

    def step() -> Any:
        data = dynamics.computeProblemData(0.0, q, v)
        solution = solver.solve(data)
        return solution, dynamics.getAccelerations(solution)

    solution, acceleration = step()
    if solution.status != 0 or not np.isfinite(acceleration).all():
        raise RuntimeError(f"its solver gave the status {solution.status}")
    return {"computeProblemData and solve": step}


def placo(urdf: str) -> dict[str, Callable[[], object]]:
    """Differential kinematics as one QP in C++: joint ranges and speeds, one frame task."""
    # folder in which meshes are searched for
    os.environ["ROS_PACKAGE_PATH"] = str(Path(urdf).parents[4])
    import numpy as np
    import placo as p

    _, q, goal, frame = _ur5(urdf)
    robot = p.RobotWrapper(urdf, p.Flags.ignore_collisions)
    solver = p.KinematicsSolver(robot)
    solver.mask_fbase(True)
    for name, angle in zip(robot.joint_names(), q, strict=True):
        robot.set_joint(name, angle)
    robot.update_kinematics()
    task = solver.add_frame_task(frame, np.array(goal.homogeneous))
    task.configure(frame, "soft", 1.0, 1.0)
    solver.enable_joint_limits(True)
    solver.enable_velocity_limits(True)
    solver.dt = SAMPLING_TIME

    def step() -> Any:
        robot.update_kinematics()
        return solver.solve(False)

    if not np.abs(step()).max() > 0.0:
        raise RuntimeError("its answer is zero")
    return {"update_kinematics and solve": step}


PEERS: dict[str, tuple[str, Callable[[str], dict[str, Callable[[], object]]]]] = {
    "pink": ("pin-pink", pink),
    "tsid": ("tsid", tsid),
    "placo": ("placo", placo),
}
"""Name of the distribution, and function that makes the subjects for a robot's URDF."""


def _ur5(urdf: str) -> tuple[Any, Any, Any, str]:
    """Model, configuration, a tool pose some centimetres away, and name of the tool's frame."""
    import numpy as np
    import pinocchio as pin

    model = pin.buildModelFromUrdf(urdf)
    frame = "tool0"
    q = np.array([0.664, -1.778, 1.729, -1.729, -1.935, -0.151])
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    away = pin.SE3(np.asarray(pin.exp3(np.array([0.05, -0.1, 0.2]))), np.array([0.05, 0.02, -0.03]))
    return model, q, data.oMf[model.getFrameId(frame)] * away, frame


def main(name: str, turns: int, urdf: str) -> None:
    """Measure a peer and print the times."""
    warnings.simplefilter("ignore")
    package, make = PEERS[name]
    try:
        subjects = make(urdf)
    except ImportError as error:
        raise SystemExit(f"{type(error).__name__}: {error}") from None
    times = compare(subjects, turns)
    found = {
        key: [value.median, value.p99, value.max, value.unit]
        for key, value in times.items()
        if key in subjects
    }
    print(json.dumps({"version": version(package), "times": found}))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
