"""Kinematics of a serial chain in the base frame: where every joint is, and how it moves when q̈ = 0.

Bodies are counted from 0, the base, which does not move; body i is what joint i moves. Vectors are written by loops
over their components, since the time of compilation goes with the expressions in the source, and scratch is given by
the caller, since making an array takes as long as some thirty products.
"""

from __future__ import annotations

import numpy as np

from ..rows import Array, IntArray
from .compiler import in_place

ORIGIN, AXIS, ANGULAR_VELOCITY, VELOCITY, ANGULAR_ACCELERATION, ACCELERATION = range(6)
"""Rows of a body's motion (6, 3): origin p, axis z of its joint, ω, v of the origin, ω̇, and v̇ of the origin."""


@in_place
def product(A: Array, B: Array, out: Array) -> None:
    """Write A B of two 3 × 3 matrices to ``out``."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += A[i, k] * B[k, j]
            out[i, j] = total


@in_place
def turned(A: Array, x: Array, out: Array) -> None:
    """Write A x to ``out`` (3,)."""
    for i in range(3):
        total = 0.0
        for k in range(3):
            total += A[i, k] * x[k]
        out[i] = total


@in_place
def turned_back(A: Array, x: Array, out: Array) -> None:
    """Write Aᵀ x to ``out`` (3,)."""
    for i in range(3):
        total = 0.0
        for k in range(3):
            total += A[k, i] * x[k]
        out[i] = total


@in_place
def cross(a: Array, b: Array, out: Array) -> None:
    """Write a × b to ``out`` (3,), which is neither of them."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = a[j] * b[k] - a[k] * b[j]


@in_place
def matrix_at(F: Array, at: int, out: Array) -> None:
    """Copy a 3 × 3 matrix that begins there."""
    for i in range(3):
        for j in range(3):
            out[i, j] = F[at + 3 * i + j]


@in_place
def turn_about(axis: Array, s: float, c: float, R: Array) -> None:
    """Write I + s [u]× + (1 − c) [u]×² to ``R``: the turn about the unit vector u with sine s and cosine c."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        shared, turning = (1.0 - c) * axis[i] * axis[j], s * axis[k]
        R[i, i] = c + (1.0 - c) * axis[i] * axis[i]
        R[i, j], R[j, i] = shared - turning, shared + turning


@in_place
def carried(r: Array, body: Array, s: Array, out: Array) -> None:
    """Write position, velocity and acceleration (3, 3) of the point at ``r`` (3,) from a body's origin to ``out``.

    ``s`` (3,) gets ω × r.
    """
    cross(body[ANGULAR_VELOCITY], r, s)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[0, i] = body[ORIGIN, i] + r[i]
        out[1, i] = body[VELOCITY, i] + s[i]
        out[2, i] = body[ACCELERATION, i] + body[ANGULAR_ACCELERATION, j] * r[k] - body[ANGULAR_ACCELERATION, k] * r[j]
        out[2, i] += body[ANGULAR_VELOCITY, j] * s[k] - body[ANGULAR_VELOCITY, k] * s[j]


@in_place
def point_jacobian(body: int, point: Array, motion: Array, prismatic: IntArray, J: Array) -> None:
    """Write ∂(position)/∂q (3, n) of a point fixed to a body to ``J``."""
    for m in range(J.shape[1]):
        joint = motion[m + 1]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            if m >= body:
                J[i, m] = 0.0
            elif prismatic[m]:
                J[i, m] = joint[AXIS, i]
            else:
                J[i, m] = joint[AXIS, j] * (point[k] - joint[ORIGIN, k]) - joint[AXIS, k] * (
                    point[j] - joint[ORIGIN, j]
                )


@in_place
def poses(
    q: Array,
    F: Array,
    at: int,
    prismatic: IntArray,
    R: Array,
    motion: Array,
    matrices: Array,
    vectors: Array,
) -> None:
    """Write orientation, origin and axis of every body, after its joint has moved, in the base frame.

    Parameters
    ----------
    q
        (n,) joint coordinates.
    F, at
        Numbers, among which begin there (n, 3, 3), (n, 3) and (n, 3): placement of joint i in the body before it
        (rotation, then translation), and its axis there.
    prismatic
        (n,) whether the joint moves along its axis.
    R, motion
        (n + 1, 3, 3) and (n + 1, 6, 3), of which the first, those of the base, are not touched.
    matrices, vectors
        (3, 3, 3) and (1, 3) at least, scratch.
    """
    placed, turn, T, r = matrices[0], matrices[1], matrices[2], vectors[0]
    n = len(q)
    for i in range(n):
        t0, u0 = at + 9 * n + 3 * i, at + 12 * n + 3 * i
        body, before, axis = motion[i + 1], motion[i], F[u0 : u0 + 3]
        matrix_at(F, at + 9 * i, placed)
        if prismatic[i]:
            product(R[i], placed, R[i + 1])
        else:
            turn_about(axis, np.sin(q[i]), np.cos(q[i]), turn)
            product(placed, turn, T)
            product(R[i], T, R[i + 1])
        # a turn about the axis leaves the axis
        turned(R[i + 1], axis, body[AXIS])
        turned(R[i], F[t0 : t0 + 3], r)
        along = q[i] if prismatic[i] else 0.0
        for j in range(3):
            body[ORIGIN, j] = before[ORIGIN, j] + r[j] + along * body[AXIS, j]


@in_place
def chain(
    q: Array,
    qd: Array,
    F: Array,
    at: int,
    prismatic: IntArray,
    R: Array,
    motion: Array,
    matrices: Array,
    vectors: Array,
) -> None:
    """Write pose and motion of every body in the base frame; parameters as for :func:`poses`.

    ``qd`` (n,) are the speeds; of matrices and vectors three are scratch.
    """
    poses(q, F, at, prismatic, R, motion, matrices, vectors)
    moved, r, s, bend = matrices[0], vectors[0], vectors[1], vectors[2]
    for i in range(len(q)):
        body, before = motion[i + 1], motion[i]
        along, about = qd[i] if prismatic[i] else 0.0, 0.0 if prismatic[i] else qd[i]
        for j in range(3):
            r[j] = body[ORIGIN, j] - before[ORIGIN, j]
        carried(r, before, s, moved)
        # ω × z q̇: how the axis turns
        cross(before[ANGULAR_VELOCITY], body[AXIS], bend)
        for j in range(3):
            body[ANGULAR_VELOCITY, j] = before[ANGULAR_VELOCITY, j] + about * body[AXIS, j]
            body[ANGULAR_ACCELERATION, j] = before[ANGULAR_ACCELERATION, j] + about * bend[j]
            body[VELOCITY, j] = moved[1, j] + along * body[AXIS, j]
            body[ACCELERATION, j] = moved[2, j] + 2.0 * along * bend[j]
