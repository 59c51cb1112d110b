"""Inertia and bias of an arm, compiled, and its motion through a period: see :mod:`.arm_motion`.

All is expressed in the base frame, twists and momenta at its origin. So momenta of bodies are summed as they are: those
of the bodies behind a joint, projected on its axis, give the bias (recursive Newton–Euler), and the inertia where the
joint alone moves them (composite rigid bodies). Pinocchio's ``crba`` and ``nonLinearEffects``, which only Python can
call (:mod:`vsconstraints.simulation.dynamics.engine`), give the same:
``test_inertia_and_bias_are_pinocchios`` in ``tests/test_dynamics.py``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..formulas.rotation import turn_about
from ..formulas.vectors import along_with, cross, dot, matrix, plus, product, times, turned, vector
from ..rows import Array
from . import arm, arm_motion, drives
from .arm import Arm, BodyArrays, Drive, Motion
from .compiler import IN_PLACE, compiled, compiles, in_place, overload, register_formulas
from .parts import address, checked, struct_loader

for function in (
    drives.ask_torque,
    drives.speed_error,
    drives.refer,
    drives.give_torque,
    drives.weigh,
    arm_motion.factor,
    arm_motion.solve,
    arm_motion.accelerate,
    arm_motion.know_motion,
    arm_motion.dry_friction,
    arm_motion.rub,
    arm_motion.substep,
    arm_motion.runge_kutta,
    arm_motion.bounded,
    arm_motion.drive_period,
):
    in_place(function)
register_formulas()


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
    arm_motion.factor(motion.M, motion.L)


class CompiledEngine:
    """The mechanics of this module where it runs in Python."""

    def evaluate(self, bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
        """As :func:`evaluate`."""
        evaluate(bodies, q, qd, motion)

    def move(self, arm: Arm, q: Array, qd: Array, command: Array) -> None:
        """As :func:`.substep`."""
        arm_motion.substep(self, arm, q, qd, command)


@overload(arm.evaluate)
def _evaluate(engine: Any, bodies: Any, q: Any, qd: Any, motion: Any) -> Any:
    def here(engine: Any, bodies: Any, q: Any, qd: Any, motion: Any) -> Any:
        evaluate(bodies, q, qd, motion)

    return here


@overload(arm.move)
def _move(engine: Any, arm: Any, q: Any, qd: Any, command: Any) -> Any:
    def here(engine: Any, arm: Any, q: Any, qd: Any, command: Any) -> Any:
        arm_motion.substep(engine, arm, q, qd, command)

    return here


def _example() -> Arm:
    """An arm of the types that all have; the numbers do not matter."""
    one = np.zeros(1)
    flat, flag = np.zeros((1, 1, 1)), np.zeros(1, dtype=np.bool_)
    bodies = BodyArrays(flat, flat[0], flat[0], flag, one, flat[0], flat, one, one)
    return arm.blank((bodies, bodies), Drive(0, 0, 1.0, 1.0, *(one,) * 7, 0, 1.0, 1, 0), 1, 1, 1.0)


load_arm = struct_loader(_example())

ENGINE: Any = 0 if compiles() else CompiledEngine()
"""Compiled code has no object for it."""


@checked(Arm)
@compiled("int64(int64, float64[:, ::1])", IN_PLACE)
def drive_period(arm_address: int, x: Array) -> int:
    """As :func:`vsconstraints.compiled.arm_motion.drive_period`."""
    return arm_motion.drive_period(ENGINE, load_arm(arm_address), x)


MOVE = address(drive_period)
"""Where the function begins that moves an arm through a period."""
