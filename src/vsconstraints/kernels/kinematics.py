"""Kinematics of a serial chain in the base frame: where every joint is, and how it moves when q̈ = 0."""

from __future__ import annotations

import numpy as np

from ..rows import Array, IntArray
from .compiler import inner


@inner
def product(A: Array, B: Array, out: Array) -> None:
    """Write A B of two 3 × 3 matrices to ``out``."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@inner
def turned(A: Array, x: Array, out: Array) -> None:
    """Write A x to ``out`` (3,)."""
    for i in range(3):
        out[i] = A[i, 0] * x[0] + A[i, 1] * x[1] + A[i, 2] * x[2]


@inner
def turned_back(A: Array, x: Array, out: Array) -> None:
    """Write Aᵀ x to ``out`` (3,)."""
    for i in range(3):
        out[i] = A[0, i] * x[0] + A[1, i] * x[1] + A[2, i] * x[2]


@inner
def cross(a: Array, b: Array) -> tuple[float, float, float]:
    """A × b as three numbers."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner
def rodrigues(ux: float, uy: float, uz: float, s: float, c: float, R: Array) -> None:
    """Write I + s [u]× + (1 − c) [u]×² to ``R``: the turn about the unit vector u with sine s and cosine c."""
    g = 1.0 - c
    R[0, 0], R[0, 1], R[0, 2] = c + g * ux * ux, g * ux * uy - s * uz, g * ux * uz + s * uy
    R[1, 0], R[1, 1], R[1, 2] = g * ux * uy + s * uz, c + g * uy * uy, g * uy * uz - s * ux
    R[2, 0], R[2, 1], R[2, 2] = g * ux * uz - s * uy, g * uy * uz + s * ux, c + g * uz * uz


@inner
def point_motion(
    link: int,
    x: float,
    y: float,
    z: float,
    R: Array,
    p: Array,
    w: Array,
    v: Array,
    al: Array,
    a: Array,
    out: Array,
) -> None:
    """Write position, velocity and acceleration (3, 3) of a point (x, y, z) in a link's frame to ``out``."""
    rx = R[link, 0, 0] * x + R[link, 0, 1] * y + R[link, 0, 2] * z
    ry = R[link, 1, 0] * x + R[link, 1, 1] * y + R[link, 1, 2] * z
    rz = R[link, 2, 0] * x + R[link, 2, 1] * y + R[link, 2, 2] * z
    wx, wy, wz = w[link, 0], w[link, 1], w[link, 2]
    bx, by, bz = al[link, 0], al[link, 1], al[link, 2]
    sx, sy, sz = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
    out[0, 0], out[0, 1], out[0, 2] = p[link, 0] + rx, p[link, 1] + ry, p[link, 2] + rz
    out[1, 0], out[1, 1], out[1, 2] = v[link, 0] + sx, v[link, 1] + sy, v[link, 2] + sz
    out[2, 0] = a[link, 0] + by * rz - bz * ry + wy * sz - wz * sy
    out[2, 1] = a[link, 1] + bz * rx - bx * rz + wz * sx - wx * sz
    out[2, 2] = a[link, 2] + bx * ry - by * rx + wx * sy - wy * sx


@inner
def point_jacobian(link: int, point: Array, z: Array, p: Array, prismatic: IntArray, J: Array) -> None:
    """Write ∂(position)/∂q (3, n) of a point fixed to a link to ``J``."""
    for i in range(J.shape[1]):
        if i > link:
            J[0, i] = J[1, i] = J[2, i] = 0.0
        elif prismatic[i]:
            J[0, i], J[1, i], J[2, i] = z[i, 0], z[i, 1], z[i, 2]
        else:
            rx, ry, rz = point[0] - p[i, 0], point[1] - p[i, 1], point[2] - p[i, 2]
            J[0, i] = z[i, 1] * rz - z[i, 2] * ry
            J[1, i] = z[i, 2] * rx - z[i, 0] * rz
            J[2, i] = z[i, 0] * ry - z[i, 1] * rx


@inner
def chain(
    q: Array,
    qd: Array,
    F: Array,
    at: int,
    prismatic: IntArray,
    R: Array,
    p: Array,
    z: Array,
    w: Array,
    v: Array,
    al: Array,
    a: Array,
) -> None:
    """Write the motion of every joint's frame, after its joint has moved, in the base frame.

    Parameters
    ----------
    q, qd
        (n,) joint coordinates and speeds.
    F, at
        Numbers, among which begin there (n, 3, 3), (n, 3) and (n, 3): placement of joint i in the frame of joint i − 1
        (rotation, then translation), and its axis there.
    prismatic
        (n,) whether the joint moves along its axis.
    R, p, z
        (n, 3, 3), (n, 3), (n, 3): orientation, origin and axis.
    w, v, al, a
        (n, 3) angular velocity, velocity of the origin, angular acceleration and acceleration of the origin.
    """
    scratch = np.empty((3, 3, 3))
    turn, T, moved = scratch[0], scratch[1], scratch[2]
    n = len(q)
    for i in range(n):
        R0, t0, u0 = at + 9 * i, at + 9 * n + 3 * i, at + 12 * n + 3 * i
        ux, uy, uz = F[u0], F[u0 + 1], F[u0 + 2]
        if prismatic[i]:
            for j in range(3):
                for k in range(3):
                    T[j, k] = F[R0 + 3 * j + k]
        else:
            rodrigues(ux, uy, uz, np.sin(q[i]), np.cos(q[i]), turn)
            for j in range(3):
                for k in range(3):
                    T[j, k] = (
                        F[R0 + 3 * j] * turn[0, k] + F[R0 + 3 * j + 1] * turn[1, k] + F[R0 + 3 * j + 2] * turn[2, k]
                    )
        x, y, h = F[t0], F[t0 + 1], F[t0 + 2]
        if i == 0:
            p[0, 0], p[0, 1], p[0, 2] = x, y, h
            for j in range(3):
                w[0, j] = v[0, j] = al[0, j] = a[0, j] = 0.0
                for k in range(3):
                    R[0, j, k] = T[j, k]
        else:
            o = i - 1
            point_motion(o, x, y, h, R, p, w, v, al, a, moved)
            for j in range(3):
                p[i, j], v[i, j], a[i, j] = moved[0, j], moved[1, j], moved[2, j]
                w[i, j], al[i, j] = w[o, j], al[o, j]
                for k in range(3):
                    R[i, j, k] = R[o, j, 0] * T[0, k] + R[o, j, 1] * T[1, k] + R[o, j, 2] * T[2, k]
        # a turn about the axis leaves the axis
        zx = R[i, 0, 0] * ux + R[i, 0, 1] * uy + R[i, 0, 2] * uz
        zy = R[i, 1, 0] * ux + R[i, 1, 1] * uy + R[i, 1, 2] * uz
        zz = R[i, 2, 0] * ux + R[i, 2, 1] * uy + R[i, 2, 2] * uz
        z[i, 0], z[i, 1], z[i, 2] = zx, zy, zz
        wx, wy, wz = w[i, 0], w[i, 1], w[i, 2]
        # ω × z q̇: how the axis turns
        gx, gy, gz = (wy * zz - wz * zy) * qd[i], (wz * zx - wx * zz) * qd[i], (wx * zy - wy * zx) * qd[i]
        if prismatic[i]:
            dx, dy, dz = zx * q[i], zy * q[i], zz * q[i]
            bx, by, bz = al[i, 0], al[i, 1], al[i, 2]
            sx, sy, sz = wy * dz - wz * dy, wz * dx - wx * dz, wx * dy - wy * dx
            p[i, 0], p[i, 1], p[i, 2] = p[i, 0] + dx, p[i, 1] + dy, p[i, 2] + dz
            v[i, 0] += sx + zx * qd[i]
            v[i, 1] += sy + zy * qd[i]
            v[i, 2] += sz + zz * qd[i]
            a[i, 0] += by * dz - bz * dy + wy * sz - wz * sy + 2.0 * gx
            a[i, 1] += bz * dx - bx * dz + wz * sx - wx * sz + 2.0 * gy
            a[i, 2] += bx * dy - by * dx + wx * sy - wy * sx + 2.0 * gz
        else:
            al[i, 0], al[i, 1], al[i, 2] = al[i, 0] + gx, al[i, 1] + gy, al[i, 2] + gz
            w[i, 0], w[i, 1], w[i, 2] = wx + zx * qd[i], wy + zy * qd[i], wz + zz * qd[i]
