"""Table ``plant`` of a scenario: masses of an arm, its joint controller and the latter's model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal, get_args

import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError, InvalidInput, format_value, unknown_name
from ..robots.geometry import Vector3, require_sign, vector
from ..robots.limits import per_joint
from ..rows import Array

Number = float | Sequence[float]  #: One number for all joints, or n of them.
#: Controller that drives the joints.
JointController = Literal["computed-torque", "position", "speed"]
Integrator = Literal["verlet", "runge-kutta"]  #: Integration of the motion within a substep.

MAX_SUBSTEPS = 1000

OUTER = 0.25  #: Rate κ of the position loop, relative to that of the speed loop inside it.


@dataclass(frozen=True)
class Payload:
    """Solid ball at the tip; a point mass if its radius is zero."""

    mass: float  #: Mass [kg].
    centre: Vector3 = (0.0, 0.0, 0.0)  #: Centre in the tip's frame [m].
    radius: float = 0.0  #: Radius [m].

    def __post_init__(self) -> None:
        require_sign(self, "plant.payload: ", zero_or_more=("mass", "radius"))
        vector(self.centre, 3, "plant.payload: centre")

    def inertia(self) -> pin.Inertia:
        """Return the inertia in the tip's frame."""
        about = 0.4 * self.mass * self.radius**2
        return pin.Inertia(self.mass, np.array(self.centre, dtype=np.float64), about * np.eye(3))


@dataclass(frozen=True)
class Rods:
    """Links as solid cylinders, from each joint to the next and from the last to the tip."""

    mass_per_length: float  #: [kg/m].
    radius: float  #: Radius [m].

    def __post_init__(self) -> None:
        require_sign(self, "plant.rods: ", positive=("mass_per_length", "radius"))

    def inertia(self, end: Array) -> pin.Inertia:
        """Return the inertia of the rod from the origin to ``end`` (3,) [m]."""
        length = float(np.linalg.norm(end))
        if length == 0.0:
            return pin.Inertia.Zero()
        mass = self.mass_per_length * length
        along = np.outer(end, end) / length**2
        across = mass * (3.0 * self.radius**2 + length**2) / 12.0
        about = across * (np.eye(3) - along) + 0.5 * mass * self.radius**2 * along
        return pin.Inertia(mass, 0.5 * end, about)


@dataclass(frozen=True)
class Friction:
    """Friction of the joints, τ_f = f_v q̇ + (f_c + (f_s − f_c) exp(−(q̇/v_s)²)) sign q̇.

    At rest, friction is the torque that holds the joint, up to f_s.
    """

    viscous: Number = 0.0  #: f_v [Nm s/rad or N s/m].
    coulomb: Number = 0.0  #: f_c [Nm or N].
    #: f_s, static friction according to Stribeck, not less than f_c; f_c if not given.
    static: Number | None = None
    stribeck_speed: Number = 0.05  #: v_s [rad/s or m/s].

    def __post_init__(self) -> None:
        several = "viscous", "coulomb", "static"
        require_sign(self, "plant: friction: ", zero_or_more=several, positive=("stribeck_speed",))

    def arrays(self, n: int) -> tuple[Array, Array, Array, Array]:
        """Return f_v, f_c, f_s and v_s (n,).

        Raises InvalidInput if static friction is less than Coulomb's.
        """
        values = (
            self.viscous,
            self.coulomb,
            self.coulomb if self.static is None else self.static,
            self.stribeck_speed,
        )
        names = ("viscous", "coulomb", "static", "stribeck_speed")
        viscous, coulomb, static, speed = (
            per_joint(f"plant: friction: {name}", value, n)
            for name, value in zip(names, values, strict=True)
        )
        if (static < coulomb).any():
            raise InvalidInput(
                f"plant.friction: static must not be less than coulomb, which is "
                f"{format_value(self.coulomb)}: not "
                f"{format_value(self.static)}"
            )
        return viscous, coulomb, static, speed


@dataclass(frozen=True)
class ArmDynamics:
    """Arm with mass: M(q) q̈ + h(q, q̇) = τ − τ_f.

    The controller ``"computed-torque"`` applies τ = M̂ (q̈_c + 2ω (q̇_c − q̇) + ω² (q_c − q)) + ĥ
    with its believed model, where q̇_c and q_c are the integrals of the command. With ``"speed"``,
    each joint has an independent, critically damped PI loop that follows q̇_c: τ = m̂ (2ω e + ω²
    ∫e) + ĝ, e = q̇_c − q̇. ``"position"`` adds a position loop around it, whose output κ (q_c − q),
    κ = ω/4, is added to e. In these loops m̂ is the inertia of the joint at the start if the others
    are free, and ĝ the weight at the beginning of each period.
    """

    made_by: ClassVar[str] = "vsconstraints.dynamics.plant:DynamicPlant"
    controller: JointController = "computed-torque"
    bandwidth: float = 20.0  #: ω / 2π [Hz].
    #: Number of substeps per sampling period. In each, the controller outputs one torque, and the
    #: motion is integrated once.
    substeps: int = 10
    payload: Payload | None = None  #: Load of the tip, in addition to the arm's own links.
    #: Believed masses and inertias of the links, relative to the true ones.
    mass_factor: float = 1.0
    #: Believed mass and inertia of the payload, relative to the true ones.
    payload_factor: float = 1.0
    #: Friction in the joints, which the controller does not know.
    friction: Friction = field(default_factory=Friction)
    #: Largest torque of each joint [Nm or N]; the robot's own if None.
    effort: Number | None = None
    #: Largest speed of the controller's reference [rad/s or m/s]; the robot's own if None.
    speed: Number | None = None
    #: Delay until a commanded torque begins to act, a multiple of the substep [s].
    dead_time: float = 0.0
    lag: float = 0.0  #: Time constant of the torque's response after that delay [s].
    #: Inertia of the motors, as the joints feel it behind their gears [kg m²].
    rotor_inertia: Number = 0.0
    #: ``"verlet"``: second order, with one evaluation of inertia and bias per substep; torques that
    #: act at once are those of a continuous controller. ``"runge-kutta"``: fourth order, with four
    #: evaluations; torques are held for a substep.
    integrator: Integrator = "verlet"
    rods: Rods | None = None  #: Rods that replace the links of an arm without inertias.
    gravity: Vector3 = (0.0, 0.0, -9.81)  #: Gravitational acceleration in the base frame [m/s²].

    def __post_init__(self) -> None:
        for name, known in (("controller", JointController), ("integrator", Integrator)):
            if getattr(self, name) not in get_args(known):
                raise unknown_name(f"plant: {name}", getattr(self, name), get_args(known))
        if int(self.substeps) != self.substeps or not 1 <= self.substeps <= MAX_SUBSTEPS:
            raise InvalidInput(
                f"plant: substeps must be a whole number from 1 to {MAX_SUBSTEPS}, not "
                f"{format_value(self.substeps)}"
            )
        require_sign(
            self,
            "plant: ",
            positive=("bandwidth", "mass_factor", "effort", "speed"),
            zero_or_more=("payload_factor", "dead_time", "lag", "rotor_inertia"),
        )
        if len(self.gravity) != 3 or not np.isfinite(self.gravity).all():
            raise InvalidInput(
                f"plant: gravity must be 3 finite numbers, not {format_value(self.gravity)}"
            )

    @property
    def exact(self) -> bool:
        """True if the controller's model is the true one."""
        return self.mass_factor == 1.0 and (self.payload is None or self.payload_factor == 1.0)

    @property
    def at_once(self) -> bool:
        """True if torques act at once and change within a substep."""
        return self.dead_time == 0.0 and self.lag == 0.0 and self.integrator == "verlet"

    @property
    def rate(self) -> float:
        """Rate ω [rad/s]."""
        return 2.0 * math.pi * self.bandwidth

    def slots(self, h: float) -> int:
        """Count the torques that are pending or acting, in substeps of h [s].

        Raises ConfigurationError if the dead time is not a multiple of the substep.
        """
        count = self.dead_time / h
        if abs(count - round(count)) > 1e-6:
            raise ConfigurationError(
                f"plant: dead_time must be a multiple of the substep, {h:g} s, not "
                f"{self.dead_time} s"
            )
        return round(count) + 1


@dataclass(frozen=True)
class MujocoDynamics(ArmDynamics):
    """The same arm and controller, simulated by MuJoCo: slower, but an independent check.

    Torques are held for a substep, and MuJoCo integrates with the fourth-order Runge-Kutta method.
    """

    at_once = False
