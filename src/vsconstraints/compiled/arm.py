"""An arm with mass: its bodies and its drive, inertia and bias, and the accelerations that follow.

All is expressed in the base frame, twists and momenta at its origin. So momenta of bodies are summed as they are: those
of the bodies behind a joint, projected on its axis, give the bias (recursive Newton–Euler), and the inertia where the
joint alone moves them (composite rigid bodies). Pinocchio's ``crba`` and ``nonLinearEffects``, which compiled code
cannot call, give the same: ``test_inertia_and_bias_are_pinocchios`` in ``tests/test_dynamics.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..formulas.rotation import turn_about
from ..formulas.vectors import along_with, cross, dot, matrix, plus, product, times, turned, vector
from ..rows import Array, BoolArray, IntArray
from .compiler import in_place, register_formulas

register_formulas()

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
    has_friction
        Whether (1 or 0) there is any friction.
    share
        Fraction of the way to the commanded torque that is covered in a substep: 1 − exp(−h/τ).
    at_once
        Whether (1 or 0) the commanded torque acts without dead time and lag, and changes within a substep.
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
    has_friction: int
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
        (d + 1, n) commanded in the last substeps, a ring buffer.
    at
        (1,) where the next one is put.
    at_limit
        (n,) substeps in which the torque limit was exceeded.
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
    commanded
        (n,) torques that the controller commands.
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
    commanded: Array
    acceleration: Array
    after: Array
    friction: Array
    speed: Array
    stages: Array


def blank(bodies: tuple[BodyArrays, BodyArrays], drive: Drive, slots: int, substeps: int, h: float) -> Arm:
    """An arm of which nothing has been computed yet; its gears remember so many ``slots``."""
    n = len(drive.effort)

    def zeros(*shape: int) -> Array:
        return np.zeros(shape)

    true, expected = (Motion(zeros(n, n), zeros(n, n), zeros(n), zeros(n, 32)) for _ in range(2))
    q_c, qd_c, integral, gravity, torque, commanded, qdd, after, friction, speed = zeros(10, n)
    counts = np.zeros(1, dtype=np.int64), np.zeros(n, dtype=np.int64)
    memory = Memory(q_c, qd_c, integral, gravity, torque, zeros(slots, n), *counts)
    return Arm(
        *bodies, true, expected, drive, memory, substeps, h, commanded, qdd, after, friction, speed, stages=zeros(4, n)
    )


@in_place
def factor(M: Array, L: Array) -> None:
    """Write the Cholesky factor of M (n, n), of which the lower half counts, with the inverses of its diagonal."""
    for j in range(len(M)):
        rest = M[j, j]
        for k in range(j):
            rest -= L[j, k] * L[j, k]
        # NaN where M is not positive definite: whoever looks at the speeds sees it
        inverse = 1.0 / math.sqrt(rest) if rest > 0.0 else math.nan
        L[j, j] = inverse
        for i in range(j + 1, len(M)):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = rest * inverse


@in_place
def solve(L: Array, x: Array) -> None:
    """Set x ← M⁻¹ x (n,) by the factor of :func:`factor`."""
    n = len(x)
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] *= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] *= L[i, i]


@in_place
def accelerate(motion: Motion, torque: Array, friction: Array, qdd: Array) -> None:
    """Write q̈ = M⁻¹(τ − τ_f − h) (n,)."""
    for j in range(len(qdd)):
        qdd[j] = torque[j] - friction[j] - motion.bias[j]
    solve(motion.L, qdd)


@in_place
def evaluate(bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
    """Write M(q) (its lower half), h(q, q̇) and the factor of M."""
    n, work = len(q), motion.work
    R, o = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (0.0, 0.0, 0.0)
    omega, alpha = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    # of the body's frame; gravity is an acceleration of the base upwards
    a = times(-1.0, vector(bodies.gravity))
    for i in range(n):
        axis, placement, along = vector(bodies.axis[i]), matrix(bodies.R[i]), 0.0
        r = turned(R, vector(bodies.t[i]))
        if bodies.prismatic[i]:
            along = q[i]
        else:
            placement = product(placement, turn_about(axis, math.sin(q[i]), math.cos(q[i])))
        R = product(R, placement)
        z = turned(R, axis)
        r = along_with(r, along, z)
        o = plus(o, r)
        # the body before carries the frame's origin
        a = plus(a, plus(cross(alpha, r), cross(omega, cross(omega, r))))
        if bodies.prismatic[i]:
            a = along_with(a, 2.0 * qd[i], cross(omega, z))
            S, turn = z, (0.0, 0.0, 0.0)
        else:
            alpha = along_with(alpha, qd[i], cross(omega, z))
            omega = along_with(omega, qd[i], z)
            S, turn = cross(o, z), z
        m, arm_c = bodies.mass[i], turned(R, vector(bodies.centre[i]))
        c = plus(o, arm_c)
        force = times(m, plus(a, plus(cross(alpha, arm_c), cross(omega, cross(omega, arm_c)))))
        # I in the base's axes, by its columns
        local = matrix(bodies.inertia[i])
        half = product(R, local)
        xx, xy, xz = dot(half[0], R[0]), dot(half[0], R[1]), dot(half[0], R[2])
        yy, yz, zz = dot(half[1], R[1]), dot(half[1], R[2]), dot(half[2], R[2])
        spin = (
            xx * omega[0] + xy * omega[1] + xz * omega[2],
            xy * omega[0] + yy * omega[1] + yz * omega[2],
            xz * omega[0] + yz * omega[1] + zz * omega[2],
        )
        moment = plus(
            plus(
                (
                    xx * alpha[0] + xy * alpha[1] + xz * alpha[2],
                    xy * alpha[0] + yy * alpha[1] + yz * alpha[2],
                    xz * alpha[0] + yz * alpha[1] + zz * alpha[2],
                ),
                cross(omega, spin),
            ),
            cross(c, force),
        )
        row = work[i]
        row[0], row[1], row[2] = S
        row[3], row[4], row[5] = turn
        row[6], row[7], row[8] = force
        row[9], row[10], row[11] = moment
        # mass, first moment and inertia about the base's origin
        row[12] = m
        row[13], row[14], row[15] = m * c[0], m * c[1], m * c[2]
        row[16] = xx + m * (c[1] * c[1] + c[2] * c[2])
        row[17] = xy - m * c[0] * c[1]
        row[18] = xz - m * c[0] * c[2]
        row[19] = yy + m * (c[0] * c[0] + c[2] * c[2])
        row[20] = yz - m * c[1] * c[2]
        row[21] = zz + m * (c[0] * c[0] + c[1] * c[1])
    for i in range(n - 1, -1, -1):
        row = work[i]
        if i + 1 < n:
            for k in range(6, 22):
                row[k] += work[i + 1, k]
        S, turn = (row[0], row[1], row[2]), (row[3], row[4], row[5])
        motion.bias[i] = dot(S, (row[6], row[7], row[8])) + dot(turn, (row[9], row[10], row[11]))
        p = (row[13], row[14], row[15])
        # momentum of all behind the joint where it alone moves, with speed 1
        P = plus(times(row[12], S), cross(turn, p))
        L = plus(
            (
                row[16] * turn[0] + row[17] * turn[1] + row[18] * turn[2],
                row[17] * turn[0] + row[19] * turn[1] + row[20] * turn[2],
                row[18] * turn[0] + row[20] * turn[1] + row[21] * turn[2],
            ),
            cross(p, S),
        )
        for j in range(i + 1):
            other = work[j]
            motion.M[i, j] = dot((other[0], other[1], other[2]), P) + dot((other[3], other[4], other[5]), L)
        motion.M[i, i] += bodies.rotor[i]
    factor(motion.M, motion.L)
