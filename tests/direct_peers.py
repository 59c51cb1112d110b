"""Direct calls of other packages, each in its own environment: ``python direct_peers.py NAME FILE``.

FILE holds a setup message and recorded states, with the tip's goal, the error of the image and its
rows as vsconstraints computes them. The answers, q̇ or q̈, are printed as JSON, with NaN where the
package has none. Nothing here is taken from the adapters: this is what a user of the package
writes.
"""

import json
import sys

import numpy as np


def pink(setup, states):
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.barriers import Barrier
    from pink.exceptions import NoSolutionFound
    from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
    from pink.tasks import FrameTask, Task

    own = setup["settings"]

    class View(Barrier):
        def __init__(self, state):
            super().__init__(dim=len(state["sigma"]), gain=own["barrier_gain"])
            self.state = state

        def compute_barrier(self, configuration):
            return -np.array(self.state["sigma"])

        def compute_jacobian(self, configuration):
            return -np.array(self.state["sigma_J"])

    class Image(Task):
        def __init__(self, state, **options):
            super().__init__(cost=1.0, **options)
            self.state = state

        def compute_error(self, configuration):
            return np.array(self.state["error"])

        def compute_jacobian(self, configuration):
            return np.array(self.state["error_J"])

        def __repr__(self):
            return "Image"

    model = pin.buildModelFromXML(setup["urdf"])
    dt = setup["period"]
    limits = [ConfigurationLimit(model), VelocityLimit(model)]
    if own["acceleration_limit"]:
        acceleration = AccelerationLimit(model, np.array(setup["limits"]["acceleration"]))
        limits.append(acceleration)
    last = None
    for state in states:
        configuration = Configuration(model, model.createData(), np.array(state["q"]))
        gains = {"gain": own["gain"] * dt, "lm_damping": 1e-6}
        if setup["feature"] == "image-points":
            task = Image(state, **gains)
        else:
            task = FrameTask("tip", 1.0, 1.0, **gains)
            task.set_target(pin.SE3(np.array(state["tip_goal"])))
        if own["acceleration_limit"]:
            acceleration.set_last_integration(np.array(state["qd"]) if last is None else last, dt)
        options = {"solver": "daqp", "damping": own["damping"], "safety_break": False}
        try:
            last = solve_ik(
                configuration, [task], dt, limits=limits, barriers=[View(state)], **options
            )
        except NoSolutionFound:
            last = None
        yield np.full(model.nv, np.nan) if last is None else last


def mink(setup, states):
    import mink
    import mujoco

    own = setup["settings"]
    spec = mujoco.MjSpec.from_string(setup["urdf"])
    spec.compiler.fusestatic = 0
    model = spec.compile()
    dt = setup["period"]

    class View(mink.Limit):
        def compute_qp_inequalities(self, configuration, dt):
            bound = -own["view_gain"] * dt * np.array(state["sigma"])
            return mink.Constraint(np.array(state["sigma_J"]), bound)

    class Image(mink.Task):
        def compute_error(self, configuration):
            return np.array(state["error"])

        def compute_jacobian(self, configuration):
            return np.array(state["error_J"])

    speeds = dict(zip(setup["joints"], setup["limits"]["velocity"], strict=True))
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds), View()]
    for state in states:
        configuration = mink.Configuration(model, q=np.array(state["q"]))
        gains = {"gain": own["gain"] * dt, "lm_damping": 1e-6}
        if setup["feature"] == "image-points":
            task = Image(cost=np.ones(len(state["error"])), **gains)
        else:
            task = mink.FrameTask("tip", "body", 1.0, 1.0, **gains)
            task.set_target(mink.SE3.from_matrix(np.array(state["tip_goal"])))
        options = {"solver": "daqp", "damping": own["damping"], "limits": limits}
        try:
            yield mink.solve_ik(configuration, [task], dt, **options)
        except mink.NoSolutionFound:
            yield np.full(model.nv, np.nan)


def placo(setup, states):
    import pinocchio as pin
    import placo

    own = setup["settings"]
    dt = setup["period"]
    joints = setup["joints"]
    for state in states:
        robot = placo.RobotWrapper("", placo.Flags.ignore_collisions, setup["urdf"])
        for joint, angle in zip(joints, state["q"], strict=True):
            robot.set_joint(joint, angle)
        for joint, speed in zip(joints, setup["limits"]["velocity"], strict=True):
            robot.set_velocity_limit(joint, speed)
        robot.update_kinematics()
        solver = placo.KinematicsSolver(robot)
        solver.mask_fbase(True)
        solver.dt = dt
        solver.enable_joint_limits(True)
        solver.enable_velocity_limits(True)
        tip = pin.SE3(robot.get_T_world_frame("tip"))
        goal = pin.SE3(np.array(state["tip_goal"]))
        share = own["gain"] * dt
        turn = pin.exp3(share * pin.log3(tip.rotation.T @ goal.rotation))
        moved = tip.translation + share * (goal.translation - tip.translation)
        target = pin.SE3(tip.rotation @ turn, moved)
        solver.add_frame_task("tip", target.homogeneous).configure("tip", "soft", 1.0, 1.0)
        solver.add_regularization_task(own["regularization"])
        G = np.zeros((len(state["sigma"]), 7 + len(joints)))
        G[:, 7:] = state["sigma_J"]
        h = G[:, 7:] @ np.array(state["q"]) - own["view_gain"] * dt * np.array(state["sigma"])
        solver.add_joint_space_half_spaces_constraint(G, h).configure("view", "hard", 1.0)
        try:
            yield solver.solve(False)[6:] / dt
        except RuntimeError:
            yield np.full(len(joints), np.nan)


def rtb(setup, states):
    import tempfile

    import qpsolvers
    import roboticstoolbox as toolbox

    own = setup["settings"]
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(setup["urdf"])
        file.flush()
        robot = toolbox.Robot.URDF(file.name)
    most = np.array(setup["limits"]["velocity"])
    n = len(most)
    for state in states:
        q = np.array(state["q"])
        goal = np.array(state["tip_goal"])
        tip = robot.fkine(q, end="tip").A
        v, _ = toolbox.p_servo(tip, goal, own["gain"], 0.0, method="angle-axis")
        distance = np.abs(tip[:3, :3].T @ (goal[:3, 3] - tip[:3, 3])).sum()
        weights = np.concatenate((np.full(n, 0.01), np.full(6, 1.0 / distance)))
        A = np.hstack((robot.jacob0(q, end="tip"), np.eye(6)))
        G, h = robot.joint_velocity_damper(q, 0.05, 0.9)
        G = np.vstack((G, state["sigma_J"]))
        h = np.concatenate((h, -own["view_gain"] * np.array(state["sigma"])))
        G = np.hstack((G, np.zeros((len(G), 6))))
        c = np.concatenate((-robot.jacobm(q, end="tip").ravel(), np.zeros(6)))
        ub = np.concatenate((most, np.full(6, 10.0)))
        x = qpsolvers.solve_qp(np.diag(weights), c, G, h, A, v, -ub, ub, solver="daqp")
        yield np.full(n, np.nan) if x is None else x[:n]


def oink(setup, states):
    import roboplan.core as core
    import roboplan.optimal_ik as ik

    own = setup["settings"]
    dt = setup["period"]
    robot = core.Scene("scene", core.loadUrdfSceneDescriptionFromXml(setup["urdf"]))
    solver = ik.Oink(robot)  # one for all: its solver iterates from the last answer
    options = ik.FrameTaskOptions(task_gain=own["gain"] * dt, lm_damping=1e-6)
    speeds = ik.VelocityLimit(solver, dt, np.array(setup["limits"]["velocity"]))
    limits = [ik.PositionLimit(solver, 0.5), speeds]
    if own["acceleration_limit"]:
        most = np.array(setup["limits"]["acceleration"])
        acceleration = ik.AccelerationLimit(solver, dt, most)
        limits.append(acceleration)
    last = None
    for state in states:
        robot.setJointPositions(np.array(state["q"]))
        goal = np.asfortranarray(state["tip_goal"])
        target = core.CartesianConfiguration("base", "tip", goal)
        task = ik.FrameTask(solver, robot, target, options)
        if own["acceleration_limit"]:
            acceleration.setLastVelocity(np.array(state["qd"]) if last is None else last)
        step = np.zeros(len(state["q"]))
        try:
            solver.solveIk(robot, [task], limits, step)
        except RuntimeError:
            last = None
            yield np.full(len(step), np.nan)
        else:
            last = step / dt
            yield last


def tsid(setup, states):
    import pinocchio as pin
    import tsid.tsid_pywrap as tsid

    own = setup["settings"]
    model = pin.buildModelFromXML(setup["urdf"])
    for state in states:
        robot = tsid.RobotWrapper(model, tsid.RootJointType.FIXED_BASE_SYSTEM, False)
        problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
        problem.computeProblemData(0.0, np.array(state["q"]), np.array(state["qd"]))
        task = tsid.TaskSE3Equality("tip", robot, "tip")
        task.setKp(own["stiffness"] * np.ones(6))
        task.setKd(own["damping"] * np.ones(6))
        task.useLocalFrame(True)
        bounds = tsid.TaskJointBounds("bounds", robot, setup["period"])
        for name, set_bounds in (
            ("velocity", bounds.setVelocityBounds),
            ("acceleration", bounds.setAccelerationBounds),
        ):
            most = np.array(setup["limits"][name])
            set_bounds(-most, most)
        problem.addMotionTask(task, 1.0, 1, 0.0)
        problem.addMotionTask(bounds, 1.0, 0, 0.0)
        goal = np.array(state["tip_goal"])
        sample = tsid.TrajectorySample(12, 6)
        sample.value(np.concatenate((goal[:3, 3], goal[:3, :3].T.ravel())))
        task.setReference(sample)
        solver = tsid.SolverHQuadProgFast("solver")
        solver.resize(problem.nVar, problem.nEq, problem.nIn)
        data = problem.computeProblemData(state["t"], np.array(state["q"]), np.array(state["qd"]))
        yield problem.getAccelerations(solver.solve(data))


def cbfpy(setup, states):
    import os

    os.environ["JAX_ENABLE_X64"] = "1"
    import jax.numpy as jnp
    from cbfpy import CBF, CBFConfig

    own = setup["settings"]
    lower, upper, most = (np.array(setup["limits"][key]) for key in ("lower", "upper", "velocity"))
    rows = len(states[0]["sigma"])
    n = len(most)

    class Arm(CBFConfig):
        def __init__(self):
            blank = np.zeros(rows), np.zeros((rows, n)), np.zeros(n)
            super().__init__(n=n, m=n, u_min=-most, u_max=most, init_args=blank)

        def f(self, z, *args):
            return jnp.zeros(n)

        def g(self, z, *args):
            return jnp.eye(n)

        def h_1(self, z, view, rates, at):
            return jnp.concatenate((z - lower, upper - z, view + rates @ (z - at)))

        def alpha(self, h, *args):
            return own["barrier_gain"] * h

    cbf = CBF.from_config(Arm())
    for state in states:
        q = np.array(state["q"])
        view = -np.array(state["sigma"]), -np.array(state["sigma_J"]), q
        if setup["feature"] == "image-points":
            wanted = -np.linalg.pinv(state["error_J"]) @ state["error"]
        else:
            wanted = np.linalg.pinv(state["jacobian"]) @ state["twist"]
        yield cbf.safety_filter(q, own["gain"] * wanted, *view)


def mvt(setup, states):
    from machinevisiontoolbox import CentralCamera

    f_u, f_v, c_u, c_v = setup["camera"]["intrinsics"]
    camera = CentralCamera(f=[f_u, f_v], rho=1.0, pp=(c_u, c_v), imagesize=[640, 480])
    for state in states:
        p = np.array(state["pixels"]).T
        L = camera.visjac_p(p, state["depth"])
        error = (np.array(setup["goals"][0]["pixels"]).T - p).T.ravel()
        velocity = setup["settings"]["gain"] * np.linalg.pinv(L) @ error
        yield np.linalg.pinv(state["jacobian"]) @ velocity


if __name__ == "__main__":
    name, path = sys.argv[1:]
    with open(path, encoding="utf-8") as file:
        recorded = json.load(file)
    answers = globals()[name](recorded["setup"], recorded["states"])
    print(json.dumps([np.asarray(answer).tolist() for answer in answers]))
