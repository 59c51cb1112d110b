"""An arm with mass as a plant of the closed loop."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...compiled import load
from ...compiled.arm import POSITION, SPEED, TORQUE, Arm, Drive, Engine, blank
from ...compiled.arm_motion import BOUND, begin, drive_period
from ...compiled.structures import pack_struct
from ...errors import SceneError
from ...formulas.limits import JointLimits
from ...robots.robot import Robot
from ...rows import Array, IntArray
from ..plant import Plant, without_limits
from .bodies import Masses, body_arrays, demand_holding, demand_inertia, felt_inertia
from .engine import PinocchioEngine
from .settings import OUTER, ArmDynamics, MujocoDynamics, per_joint

KINDS = {"computed-torque": TORQUE, "position": POSITION, "speed": SPEED}


@dataclass(frozen=True)
class Start:
    """Where a robot starts (n,), how fast (n,), and with which sampling time [s]."""

    q: Array
    qd: Array
    Ts: float


class DynamicPlant(Plant):
    """An arm with mass, its joint controller, friction and gears; see :class:`.ArmDynamics`.

    Attributes
    ----------
    x
        (4, n) q, q̇, q̈_c, and zeros: what disturbs the command follows from the motion here.
    arm
        All that the motion within a period is made of.
    frozen_arm, mover
        Where compiled code finds it, and the number and address by which loops are told.
    model, believed
        Pinocchio's model of the arm as it is, and as its controller believes it to be.

    Raises
    ------
    ConfigurationError, InvalidInput
        if the arm has no inertias, its torques cannot hold it at the start, or a setting does not fit the robot.
    """

    follows = True

    def __init__(self, robot: Robot, dynamics: ArmDynamics, start: Start, limits: JointLimits | None = None) -> None:
        n, self.Ts, self.robot, self.dynamics = robot.n, float(start.Ts), robot, dynamics
        self._limits = without_limits(self.Ts) if limits is None else limits
        self._offset, self._noise, self._seed, self._random = np.zeros(n), 0.0, (0,), np.random.default_rng(0)
        self.transition = np.eye(4)
        self.x = np.zeros((4, n))
        self.x[0], self.x[1] = start.q, start.qd
        rotor = per_joint("rotor_inertia", dynamics.rotor_inertia, n)
        gravity = np.array(dynamics.gravity, dtype=np.float64)
        masses = Masses(dynamics.rods, dynamics.payload, rotor, gravity)
        self.model = masses.model(robot)
        self.believed = Masses(
            dynamics.rods, dynamics.payload, rotor, gravity, dynamics.mass_factor, dynamics.payload_factor
        ).model(robot)
        demand_inertia(robot, self.model, start.q)
        own = robot.limits.of_joint("effort", n)
        effort = own if dynamics.effort is None else per_joint("effort", dynamics.effort, n)
        demand_holding(robot, self.model, start.q, effort)
        speed = robot.qd_max.copy() if dynamics.speed is None else per_joint("speed", dynamics.speed, n)
        friction = dynamics.friction.arrays(n)
        h = self.Ts / dynamics.substeps
        drive = Drive(
            KINDS[dynamics.controller],
            int(dynamics.exact),
            dynamics.rate,
            OUTER * dynamics.rate if dynamics.controller == "position" else 0.0,
            felt_inertia(self.believed, start.q),
            effort,
            speed,
            *friction,
            int(any(part.any() for part in friction[:3])),
            1.0 if dynamics.lag == 0.0 else -math.expm1(-h / dynamics.lag),
            int(dynamics.at_once),
            int(dynamics.integrator == "runge-kutta"),
        )
        bodies = body_arrays(robot, self.model), body_arrays(robot, self.believed)
        self.arm: Arm = blank(bodies, drive, dynamics.slots(h), dynamics.substeps, h)
        engine: Engine = PinocchioEngine(self)
        self._kernels = None
        if isinstance(dynamics, MujocoDynamics):
            from .mujoco import MujocoEngine

            engine = MujocoEngine(self)
        else:
            self._kernels = load("dynamics")
        self.engine = engine
        if self._kernels is not None:
            self.frozen_arm = pack_struct(self.arm)
            self.mover = self._kernels.MOVE, int(self.frozen_arm.ctypes.data)
        begin(engine, self.arm, self.x[0], self.x[1])

    def follow(self) -> None:
        """Go to the end of the period that has begun."""
        if self._kernels is not None and self.mover[0]:
            self._kernels.drive_period(self.mover[1], self.x)
        else:
            drive_period(self.engine, self.arm, self.x)

    step = follow

    def check(self) -> None:
        """Raise SceneError if the arm's motion has gone out of bounds."""
        qd = self.x[1]
        if not (np.abs(qd) < BOUND).all():
            worst = int(np.argmax(np.where(np.isfinite(qd), np.abs(qd), np.inf)))
            raise SceneError(
                f"the arm's motion has no bounds: joint {worst + 1} moves at {qd[worst]:.3g} rad/s or m/s; fewer "
                "delays, less bandwidth, or more substeps may help"
            )

    def within(self, states: Array, periods: IntArray, share: float) -> tuple[Array, Array]:
        """Q and q̇ (N, n) a share of a period after its beginning: of the cubic with q and q̇ at both ends."""
        T, s = self.Ts, share
        (q0, v0), (q1, v1) = states[periods, :2].swapaxes(0, 1), states[periods + 1, :2].swapaxes(0, 1)
        q = q0 + s * s * (3.0 - 2.0 * s) * (q1 - q0) + T * s * (1.0 - s) * ((1.0 - s) * v0 - s * v1)
        qd = 6.0 * s * (1.0 - s) * (q1 - q0) / T + (1.0 - s) * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1
        return q, qd

    def remarks(self) -> list[str]:
        """What a reader of the results should know of the torques."""
        counts = self.arm.memory.at_limit
        return [
            f"joint {j + 1} was asked for more torque than its {self.arm.drive.effort[j]:.4g} Nm or N for "
            f"{counts[j] * self.arm.h:.3g} s"
            for j in np.flatnonzero(counts)
        ]
