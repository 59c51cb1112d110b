"""An arm with mass under its own joint controller: what it is made of, and what is remembered and computed of it.

How its joints are driven is in :mod:`.drives`, how it moves in :mod:`.arm_motion`; both are written once, in operations
that compile, as :mod:`.samples` is. What differs is who computes inertia and bias of the arm:
:mod:`vsconstraints.compiled.dynamics` compiled, Pinocchio in NumPy (:mod:`vsconstraints.simulation.dynamics.plant`).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ..rows import Array, BoolArray, IntArray

TORQUE, POSITION, SPEED = range(3)
"""Controllers of the joints: computed torque; a speed loop with a position loop around it; the speed loop alone."""


class BodyArrays(NamedTuple):
    """The moving bodies of an arm, one per joint, and how each is placed on the one before.

    Attributes
    ----------
    R, t, axis, prismatic
        (n, 3, 3) and (n, 3) placement at q = 0, (n, 3) the joint's axis in it, (n,) whether it moves along the axis.
    mass, centre, inertia
        (n,) [kg], (n, 3) [m] and (n, 3, 3) about the centre of mass [kg m²], in the body's frame.
    rotor
        (n,) inertia of the motors as the joints feel it [kg m²].
    gravity
        (3,) in the base frame [m/s²].
    """

    R: Array
    t: Array
    axis: Array
    prismatic: BoolArray
    mass: Array
    centre: Array
    inertia: Array
    rotor: Array
    gravity: Array


class Motion(NamedTuple):
    """M(q) (n, n), its Cholesky factor L, and the bias h(q, q̇) (n,): M q̈ + h = τ. ``work`` (n, 32) is scratch."""

    M: Array
    L: Array
    bias: Array
    work: Array


class Drive(NamedTuple):
    """How the joints are driven.

    Attributes
    ----------
    kind
        One of :data:`TORQUE`, :data:`POSITION` and :data:`SPEED`.
    exact
        Whether (1 or 0) the controller believes in the true model.
    rate, outer
        ω of its critically damped loops, and κ of the position loop around the speed loop [1/s].
    weight
        (n,) inertia that the speed loop takes each joint to have [kg m²].
    effort, speed
        (n,) greatest torque, and greatest speed that a reference may have; infinite where there is none.
    viscous, coulomb, static, stribeck
        (n,) friction: per speed, at speed, at rest, and the speed at which the last two have met by 63 %.
    rubs
        Whether (1 or 0) there is any friction.
    share
        How much of the way to what is asked for the torque goes in a substep: 1 − exp(−h/τ).
    at_once
        Whether (1 or 0) what is asked for acts without dead time and lag, and is no longer held for a substep.
    fourth_order
        Whether (1 or 0) the motion is integrated by Runge and Kutta's method of that order.
    """

    kind: int
    exact: int
    rate: float
    outer: float
    weight: Array
    effort: Array
    speed: Array
    viscous: Array
    coulomb: Array
    static: Array
    stribeck: Array
    rubs: int
    share: float
    at_once: int
    fourth_order: int


class Memory(NamedTuple):
    """What a driven arm remembers; (n,) each.

    Attributes
    ----------
    q_c, qd_c
        Reference of the controller: the command integrated.
    integral
        Of the speed loop's error.
    gravity
        What the controller believes that the arm weighs on the joints.
    torque
        What the gears give.
    under_way
        (d + 1, n) what was asked for in the last substeps, round and round.
    at
        (1,) where the next one is put.
    at_limit
        (n,) how many substeps asked for more torque than there is.
    """

    q_c: Array
    qd_c: Array
    integral: Array
    gravity: Array
    torque: Array
    under_way: Array
    at: IntArray
    at_limit: IntArray


class Arm(NamedTuple):
    """An arm, what its controller believes of it, and how it is integrated.

    Attributes
    ----------
    true, believed
        Bodies as they are, and as the controller believes them to be.
    motion, expected
        Inertia and bias of both.
    drive, memory
        Controller, friction and gears.
    substeps, h
        Of a period, and how long each is [s].
    asked
        (n,) torques that the controller asks for.
    acceleration, after, friction, speed
        (n,) scratch.
    stages
        (4, n) scratch.
    """

    true: BodyArrays
    believed: BodyArrays
    motion: Motion
    expected: Motion
    drive: Drive
    memory: Memory
    substeps: int
    h: float
    asked: Array
    acceleration: Array
    after: Array
    friction: Array
    speed: Array
    stages: Array


class Engine(Protocol):
    """What computes an arm's mechanics where nothing is compiled."""

    def evaluate(self, bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
        """Write M(q), its factor, and h(q, q̇)."""

    def move(self, arm: Arm, q: Array, qd: Array, command: Array) -> None:
        """As :func:`.substep`."""


def evaluate(engine: Engine, bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
    """Write inertia and bias of bodies at q and q̇ (n,); compiled code has a form of its own."""
    engine.evaluate(bodies, q, qd, motion)


def move(engine: Engine, arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Move an arm through a substep; compiled, by :func:`.substep`."""
    engine.move(arm, q, qd, command)


def blank(bodies: tuple[BodyArrays, BodyArrays], drive: Drive, slots: int, substeps: int, h: float) -> Arm:
    """An arm of which nothing has been computed yet; its gears remember so many ``slots``."""
    n = len(drive.effort)

    def zeros(*shape: int) -> Array:
        return np.zeros(shape)

    true, expected = (Motion(zeros(n, n), zeros(n, n), zeros(n), zeros(n, 32)) for _ in range(2))
    q_c, qd_c, integral, gravity, torque, asked, qdd, after, friction, speed = zeros(10, n)
    counts = np.zeros(1, dtype=np.int64), np.zeros(n, dtype=np.int64)
    memory = Memory(q_c, qd_c, integral, gravity, torque, zeros(slots, n), *counts)
    return Arm(
        *bodies, true, expected, drive, memory, substeps, h, asked, qdd, after, friction, speed, stages=zeros(4, n)
    )
