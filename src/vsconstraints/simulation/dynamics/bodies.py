"""The masses of an arm: its file's, stated rods in their place, what the tip carries, and what is believed of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ...compiled import load
from ...compiled.arm import BodyArrays
from ...errors import ConfigurationError, InvalidInput, shown
from ...robots.geometry import Vector3, vector
from ...robots.robot import Robot
from ...rows import Array

SINGULAR = 1e-9
"""Least eigenvalue of an arm's inertia, scaled to ones on its diagonal, that it can be divided by."""


@dataclass(frozen=True)
class Payload:
    """A solid ball at the tip; a point if its radius is zero.

    Attributes
    ----------
    mass
        [kg].
    centre
        In the tip's frame [m].
    radius
        [m].
    """

    mass: float
    centre: Vector3 = (0.0, 0.0, 0.0)
    radius: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mass", "radius"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise InvalidInput(f"plant.payload: {name} must be zero or more, not {shown(getattr(self, name))}")
        vector(self.centre, 3, "plant.payload: centre")

    def inertia(self) -> pin.Inertia:
        """In the tip's frame."""
        about = 0.4 * self.mass * self.radius**2
        return pin.Inertia(self.mass, np.array(self.centre, dtype=np.float64), about * np.eye(3))


@dataclass(frozen=True)
class Rods:
    """Links as solid cylinders, from each joint to the next and from the last to the tip.

    Attributes
    ----------
    mass_per_length
        [kg/m].
    radius
        [m].
    """

    mass_per_length: float
    radius: float

    def __post_init__(self) -> None:
        for name in ("mass_per_length", "radius"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise InvalidInput(f"plant.rods: {name} must be positive, not {shown(getattr(self, name))}")

    def inertia(self, end: Array) -> pin.Inertia:
        """Of the rod from the origin to ``end`` (3,) [m]."""
        length = float(np.linalg.norm(end))
        if length == 0.0:
            return pin.Inertia.Zero()
        mass, along = self.mass_per_length * length, np.outer(end, end) / length**2
        across = mass * (3.0 * self.radius**2 + length**2) / 12.0
        about = across * (np.eye(3) - along) + 0.5 * mass * self.radius**2 * along
        return pin.Inertia(mass, 0.5 * end, about)


@dataclass(frozen=True)
class Masses:
    """What an arm's dynamics are made of, beside its kinematics.

    Attributes
    ----------
    rods, payload
        See :class:`vsconstraints.simulation.dynamics.ArmDynamics`.
    rotor
        (n,) inertia of the motors [kg m²].
    gravity
        (3,) in the base frame [m/s²].
    factor, payload_factor
        What the links' and the payload's masses and inertias are multiplied by.
    """

    rods: Rods | None
    payload: Payload | None
    rotor: Array
    gravity: Array
    factor: float = 1.0
    payload_factor: float = 1.0

    def model(self, robot: Robot) -> pin.Model:
        """The robot's model with these masses.

        Raises
        ------
        ConfigurationError
            if the robot has no inertias and rods are not given, or has them and rods are.
        """
        model = pin.Model(robot.model)
        tip = model.frames[robot.frame_id("tip")]
        own = any(body.mass > 0.0 for body in list(model.inertias)[1:])
        if self.rods is None and not own:
            raise ConfigurationError(
                f"plant: the links of {robot.name} have no masses, which an arm with dynamics needs: give its URDF "
                "<inertial> elements, or plant.rods, which takes links for rods"
            )
        if self.rods is not None and own:
            raise ConfigurationError(f"plant: rods stand for missing inertias, and {robot.name} has its own")
        for i in range(1, model.njoints):
            body = model.inertias[i]
            if self.rods is not None:
                following = model.jointPlacements[i + 1] if i + 1 < model.njoints else tip.placement
                body = self.rods.inertia(np.array(following.translation))
            model.inertias[i] = pin.Inertia(
                self.factor * body.mass, np.array(body.lever), self.factor * np.array(body.inertia)
            )
        if self.payload is not None:
            ball = self.payload.inertia()
            ball = pin.Inertia(
                self.payload_factor * ball.mass, np.array(ball.lever), self.payload_factor * np.array(ball.inertia)
            )
            model.inertias[tip.parentJoint] = model.inertias[tip.parentJoint] + tip.placement.act(ball)
        model.armature[:] = self.rotor
        model.gravity.linear = self.gravity
        return model


def demand_inertia(robot: Robot, model: pin.Model, q: Array) -> None:
    """Raise ConfigurationError that names a joint, and the links without mass, unless M(q) can be divided by."""
    M = _inertia(model, q)
    scale = np.sqrt(np.maximum(np.diag(M), np.finfo(np.float64).tiny))
    values, vectors = np.linalg.eigh(M / np.outer(scale, scale))
    if values[0] > SINGULAR and (np.diag(M) > 0.0).all():
        return
    worst = int(np.argmax(np.abs(vectors[:, 0])))
    bare = [name for name, body in zip(robot.joint_names, list(model.inertias)[1:], strict=True) if not body.mass > 0.0]
    without = f"; no mass moves with {', '.join(bare)}" if bare else ""
    raise ConfigurationError(
        f"plant: joint {worst + 1} ({robot.joint_names[worst]}) of {robot.name} moves nothing with inertia at the "
        f"start, so that no acceleration follows from a torque{without}: complete the URDF's <inertial> elements, or "
        "give rotor_inertia"
    )


def demand_holding(robot: Robot, model: pin.Model, q: Array, effort: Array) -> None:
    """Raise ConfigurationError that names the joints unless their torques (n,) hold the arm at q (n,)."""
    weight = np.array(pin.computeGeneralizedGravity(model, model.createData(), q))
    short = [
        f"joint {j + 1} ({robot.joint_names[j]}) needs {abs(weight[j]):.4g}, and has {effort[j]:.4g}"
        for j in np.flatnonzero(np.abs(weight) > effort)
    ]
    if short:
        raise ConfigurationError(
            f"plant: the torques [Nm or N] cannot hold {robot.name} at its start: {'; '.join(short)}: effort, payload "
            "or the start must change"
        )


def felt_inertia(model: pin.Model, q: Array) -> Array:
    """(n,) inertia that each joint feels where the others are free, at q (n,): 1 / (M⁻¹)ⱼⱼ.

    Torques of these by accelerations never make more than n times the accelerations, whichever way the arm moves.
    """
    felt: Array = 1.0 / np.diag(np.linalg.inv(_inertia(model, q)))
    return felt


def _inertia(model: pin.Model, q: Array) -> Array:
    upper = np.triu(np.array(pin.crba(model, model.createData(), q)))
    M: Array = upper + np.triu(upper, 1).T
    return M


def body_arrays(robot: Robot, model: pin.Model) -> BodyArrays:
    """A model's bodies as compiled code takes them; their placements are zeros where there is no compiler."""
    n, packing = robot.n, load("packing")
    R, t, axes = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    if packing is not None:
        placements, joint_axes = packing.joints(robot)
        R[:], t[:], axes[:] = [pose.R for pose in placements], [pose.t for pose in placements], joint_axes
    bodies = list(model.inertias)[1:]
    return BodyArrays(
        R,
        t,
        axes,
        np.array(robot.prismatic, dtype=np.bool_),
        np.array([body.mass for body in bodies]),
        np.array([np.array(body.lever) for body in bodies]),
        np.array([np.array(body.inertia) for body in bodies]),
        np.array(model.armature, dtype=np.float64),
        np.array(model.gravity.linear, dtype=np.float64),
    )
