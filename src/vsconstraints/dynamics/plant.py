"""Arm with mass as a plant of the closed loop."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from ..compiled import load
from ..compiled.memory import Workspace
from ..errors import ConfigurationError, SceneError, described
from ..formulas.limits import JointLimits
from ..plugins.extras import demand
from ..robots.limits import per_joint
from ..robots.robot import Robot
from ..rows import Array, IntArray
from ..simulation.disturbances import Disturbances
from ..simulation.follower import LowLevelLoop
from ..simulation.plant import Plant, cubic
from .kernels.arm import POSITION, SPEED, TORQUE, Arm, BodyArrays, Drive, blank
from .settings import OUTER, ArmDynamics, MujocoDynamics

KINDS = {"computed-torque": TORQUE, "position": POSITION, "speed": SPEED}

#: Smallest eigenvalue of a regular inertia matrix, scaled to ones on its diagonal.
SINGULAR = 1e-9
#: Mass and inertia of massless links, which MuJoCo does not accept [kg, kg m²].
NOTHING = 1e-12


def with_masses(
    robot: Robot,
    dynamics: ArmDynamics,
    rotor: Array,
    factor: float = 1.0,
    payload_factor: float = 1.0,
) -> pin.Model:
    """Return the robot's model with the masses of its links, payload and motors.

    ``factor`` scales the links, ``payload_factor`` the payload; ``rotor`` (n,) are the inertias of
    the motors. Raises ConfigurationError if the robot has no inertias and rods are not given, or if
    it has inertias and rods are given.
    """
    model = pin.Model(robot.model)
    rods = dynamics.rods
    tip = model.frames[robot.frame_id("tip")]
    has_masses = any(body.mass > 0.0 for body in list(model.inertias)[1:])
    if rods is None and not has_masses:
        raise ConfigurationError(
            f"plant: the links of {robot.name} have no masses, which an arm with dynamics needs: "
            "give its URDF <inertial> elements, or plant.rods, which takes links for rods"
        )
    if rods is not None and has_masses:
        raise ConfigurationError(
            f"plant: rods replace missing inertias, but the URDF of {robot.name} has inertias: "
            "leave out rods"
        )
    for i in range(1, model.njoints):
        body = model.inertias[i]
        if rods is not None:
            following = model.jointPlacements[i + 1] if i + 1 < model.njoints else tip.placement
            body = rods.inertia(np.array(following.translation))
        model.inertias[i] = _times(factor, body)
    if dynamics.payload is not None:
        ball = tip.placement.act(_times(payload_factor, dynamics.payload.inertia()))
        model.inertias[tip.parentJoint] = model.inertias[tip.parentJoint] + ball
    model.armature[:] = rotor
    model.gravity.linear = np.array(dynamics.gravity, dtype=np.float64)
    return model


def _times(factor: float, body: pin.Inertia) -> pin.Inertia:
    return pin.Inertia(factor * body.mass, np.array(body.lever), factor * np.array(body.inertia))


def require_inertia(robot: Robot, model: pin.Model, q: Array) -> None:
    """Raise ConfigurationError unless M(q) is regular.

    The message names a joint and the links without mass.
    """
    M = _inertia(model, q)
    scale = np.sqrt(np.maximum(np.diag(M), np.finfo(np.float64).tiny))
    values, vectors = np.linalg.eigh(M / np.outer(scale, scale))
    if values[0] > SINGULAR and (np.diag(M) > 0.0).all():
        return
    worst = int(np.argmax(np.abs(vectors[:, 0])))
    bodies = list(model.inertias)[1:]
    named_bodies = zip(robot.joint_names, bodies, strict=True)
    massless = [name for name, body in named_bodies if not body.mass > 0.0]
    without = f"; no mass moves with {', '.join(massless)}" if massless else ""
    raise ConfigurationError(
        f"plant: joint {worst + 1} ({robot.joint_names[worst]}) of {robot.name} moves nothing "
        f"with inertia at the start, so that no acceleration follows from a torque{without}: "
        "complete the URDF's <inertial> elements, or give rotor_inertia"
    )


def require_holding(robot: Robot, model: pin.Model, q: Array, effort: Array) -> None:
    """Raise ConfigurationError unless the joints' torques (n,) hold the arm at q (n,).

    The message names the joints that cannot.
    """
    weight = np.array(pin.computeGeneralizedGravity(model, model.createData(), q))
    short = [
        f"joint {j + 1} ({robot.joint_names[j]}) needs {abs(weight[j]):.4g}, and has "
        f"{effort[j]:.4g}"
        for j in np.flatnonzero(np.abs(weight) > effort)
    ]
    if short:
        raise ConfigurationError(
            f"plant: the torques [Nm or N] cannot hold {robot.name} at its start: "
            f"{'; '.join(short)}: effort, payload or the start must change"
        )


def felt_inertia(model: pin.Model, q: Array) -> Array:
    """Return the inertia (n,) of each joint if the others are free, at q (n,): 1 / (M⁻¹)ⱼⱼ.

    Torques equal to these inertias times accelerations never cause more than n times the
    accelerations, in any direction of motion.
    """
    return 1.0 / np.diag(np.linalg.inv(_inertia(model, q)))


def _inertia(model: pin.Model, q: Array) -> Array:
    upper = np.triu(np.array(pin.crba(model, model.createData(), q)))
    M: Array = upper + np.triu(upper, 1).T
    return M


def body_arrays(robot: Robot, model: pin.Model) -> BodyArrays:
    """Return the bodies of a model as arrays for compiled code."""
    placements = list(robot.model.jointPlacements)[1:]
    bodies = list(model.inertias)[1:]
    return BodyArrays(
        R=np.array([place.rotation for place in placements]),
        t=np.array([place.translation for place in placements]),
        axis=np.array(robot.axes),
        prismatic=np.array(robot.prismatic, dtype=np.bool_),
        mass=np.array([body.mass for body in bodies]),
        centre=np.array([np.array(body.lever) for body in bodies]),
        inertia=np.array([np.array(body.inertia) for body in bodies]),
        rotor=np.array(model.armature, dtype=np.float64),
        gravity=np.array(model.gravity.linear, dtype=np.float64),
    )


class MujocoArm:
    """Arm in MuJoCo, moved by the torques and the friction of the plant, without contacts.

    Its bodies have no geometry. The payload is part of the last of the ``bodies``; ``h`` is a
    substep [s]. Raises ConfigurationError if MuJoCo is not installed or cannot represent the robot.
    """

    def __init__(self, robot: Robot, bodies: BodyArrays, h: float) -> None:
        demand("physics")
        import mujoco

        self._mujoco = mujoco
        spec = mujoco.MjSpec()
        # MuJoCo would write warnings of unbounded motions to a file; the loop reports them
        mujoco.set_mju_user_warning(lambda _: None)
        spec.option.timestep = h
        spec.option.gravity = bodies.gravity
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        off = mujoco.mjtDisableBit
        spec.option.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_AUTORESET
        body = spec.worldbody
        quaternion = np.empty(4)
        for i, name in enumerate(robot.joint_names):
            body = body.add_body(name=f"body {i + 1}")
            mujoco.mju_mat2Quat(quaternion, bodies.R[i].ravel())
            body.pos = bodies.t[i]
            body.quat = quaternion.copy()
            body.mass = max(bodies.mass[i], NOTHING)
            body.ipos = bodies.centre[i]
            inertia = bodies.inertia[i] + NOTHING * np.eye(3)
            body.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            body.explicitinertial = True
            slide = mujoco.mjtJoint.mjJNT_SLIDE
            hinge = mujoco.mjtJoint.mjJNT_HINGE
            kind = slide if bodies.prismatic[i] else hinge
            body.add_joint(name=name, type=kind, axis=bodies.axis[i])
        try:
            self.model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ConfigurationError(
                f"plant: MuJoCo cannot take {robot.name}: {described(error)}"
            ) from error
        self.model.dof_armature[:] = bodies.rotor
        self.data = mujoco.MjData(self.model)

    def step(self, x: Array, torque: Array) -> None:
        """Integrate a substep of the state x (s, n), q and q̇ first, with held torques (n,)."""
        data = self.data
        data.qpos[:] = x[0]
        data.qvel[:] = x[1]
        data.qfrc_applied[:] = torque
        self._mujoco.mj_step(self.model, data)
        x[0] = data.qpos
        x[1] = data.qvel


class DynamicPlant(Plant):
    """Arm with mass: the commanded q̈_c is the reference of its joint controller.

    With a low-level ``loop``, which takes velocities or positions, the reference is its motion.
    Raises ConfigurationError or InvalidInput if the arm has no inertias, its torques cannot hold it
    at the start, or a setting does not fit the robot.
    """

    follows = True

    def __init__(
        self,
        robot: Robot,
        dynamics: ArmDynamics,
        q0: Array,
        qd0: Array,
        Ts: float,
        limits: JointLimits | None = None,
        loop: LowLevelLoop | None = None,
    ) -> None:
        super().__init__(q0, qd0, Ts, "acceleration", Disturbances(), limits)
        n = robot.n
        self.robot = robot
        self.dynamics = dynamics
        self.transition = np.eye(4)
        rotor = per_joint("plant: rotor_inertia", dynamics.rotor_inertia, n)
        #: Pinocchio's model of the arm, and the model that its controller believes in.
        self.model = with_masses(robot, dynamics, rotor)
        self.believed = with_masses(
            robot, dynamics, rotor, dynamics.mass_factor, dynamics.payload_factor
        )
        require_inertia(robot, self.model, q0)
        limit = robot.limits.effort if dynamics.effort is None else dynamics.effort
        effort = per_joint("plant: effort", limit, n)
        require_holding(robot, self.model, q0, effort)
        speed = robot.qd_max.copy()
        if dynamics.speed is not None:
            speed = per_joint("plant: speed", dynamics.speed, n)
        viscous, coulomb, static, stribeck = dynamics.friction.arrays(n)
        h = self.Ts / dynamics.substeps
        drive = Drive(
            kind=KINDS[dynamics.controller],
            exact=int(dynamics.exact),
            rate=dynamics.rate,
            outer=OUTER * dynamics.rate if dynamics.controller == "position" else 0.0,
            weight=felt_inertia(self.believed, q0),
            effort=effort,
            speed=speed,
            viscous=viscous,
            coulomb=coulomb,
            static=static,
            stribeck=stribeck,
            has_friction=int(viscous.any() or coulomb.any() or static.any()),
            share=1.0 if dynamics.lag == 0.0 else -math.expm1(-h / dynamics.lag),
            at_once=int(dynamics.at_once),
            fourth_order=int(dynamics.integrator == "runge-kutta"),
        )
        bodies = body_arrays(robot, self.model), body_arrays(robot, self.believed)
        self.arm: Arm = blank(bodies, drive, dynamics.slots(h), dynamics.substeps, h)
        self.workspace = Workspace(self.arm)
        self._mujoco = None
        self._loop = loop
        self._compiled = load("vsconstraints.dynamics.kernels.substeps")
        if isinstance(dynamics, MujocoDynamics):
            self._mujoco = MujocoArm(robot, bodies[0], h)
        else:
            self.mover = self._compiled.MOVE, self.workspace.address
        if loop is not None:
            loop.lead(self.arm.memory.q_c, self.arm.memory.qd_c, self.mover)
            if self.mover[0]:
                self.mover = loop.kernels.MOVE_WITH_MASS, loop.workspace.address
        self._compiled.begin(self.workspace, self.x)

    def take_speeds(self) -> None:
        """See :class:`.Plant`."""
        if self._loop is not None:
            self._loop.take_speeds()

    def speed_rows(self) -> tuple[Array, Array]:
        """See :class:`.Plant`."""
        return super().speed_rows() if self._loop is None else self._loop.speed_rows()

    def follow(self) -> None:
        """Advance to the end of the current period."""
        compiled = self._compiled
        arm = self.arm
        workspace = self.workspace
        if self._loop is not None:
            self._loop.kernels.refer(self._loop.workspace, self.x)
        if self._mujoco is None:
            compiled.drive_period(workspace, self.x)
            return
        for i in range(arm.substeps):
            compiled.drive_substep(workspace, self.x, i == 0)
            self._mujoco.step(self.x, arm.memory.torque - arm.friction)
            compiled.end_substep(workspace, self.x)

    step = follow

    def check(self) -> None:
        """Raise SceneError if the arm's motion is unbounded, or its loop cannot be followed."""
        if self._loop is not None:
            self._loop.check()
        qd = self.x[1]
        speed = np.abs(qd)
        if not (speed < self._compiled.BOUND).all():
            worst = int(np.argmax(np.where(np.isfinite(qd), speed, np.inf)))
            raise SceneError(
                f"the arm's motion has no bounds: joint {worst + 1} moves at {qd[worst]:.3g} "
                "rad/s or m/s; fewer delays, less bandwidth, or more substeps may help"
            )

    def within(self, states: Array, periods: IntArray, share: float) -> tuple[Array, Array]:
        """Return q and q̇ (N, n) at a share of some periods.

        They lie on the cubic with q and q̇ at both ends.
        """
        begins = states[periods, :2].swapaxes(0, 1)
        ends = states[periods + 1, :2].swapaxes(0, 1)
        return cubic(tuple(begins), tuple(ends), self.Ts, share)

    def remarks(self) -> list[str]:
        """Return remarks on the torques for a reader of the results."""
        counts = self.arm.memory.at_limit
        adapted = [] if self._loop is None else self._loop.remarks()
        return adapted + [
            f"joint {j + 1} was commanded more torque than its {self.arm.drive.effort[j]:.4g} Nm "
            f"or N for {counts[j] * self.arm.h:.3g} s"
            for j in np.flatnonzero(counts)
        ]
