"""The rows of all constraints with a compiled form."""

from __future__ import annotations

import numpy as np

from ..rows import Array, IntArray
from .compiler import inner
from .curves import curve, curve_curvature
from .image import interaction_rows
from .kinematics import point_jacobian
from .layout import (
    AT_BLOCKS,
    AT_CAMERA,
    AT_LINKS,
    BLOCK,
    BLOCKS,
    COUNT,
    FIRST,
    HEART,
    JOINTS_LINEAR,
    K_AT,
    KIND,
    MOTION,
    PARAMETERS,
    SPHERE,
    WHICH,
)
from .target import displacement


@inner
def write_rows(
    t: float,
    q: Array,
    qd: Array,
    I: IntArray,  # noqa: E741
    F: Array,
    seen: Array,
    points: Array,
    Jc: Array,
    J_base: Array,
    z: Array,
    p: Array,
    prismatic: IntArray,
    m: int,
    out: Array,
) -> None:
    """Write φ, L_gφ, L_fφ and σ.

    Parameters
    ----------
    t, q, qd
        Time [s], coordinates and speeds (n,).
    I, F
        See :mod:`vsconstraints.kernels.layout`.
    seen
        (M, 7) the markers: see :func:`vsconstraints.kernels.image.marker_motion`.
    points
        (P, 3, 3) position, velocity and acceleration of the robot points.
    Jc
        (6, n) of the camera's twist relative to the target.
    J_base
        (3, n) scratch.
    z, p, prismatic
        (n, 3), (n, 3), (n,): axes, origins and kinds of the joints.
    m, out
        The number of rows, and where φ (m,), L_gφ (m, n), L_fφ (m,) and σ (m,) go, one after the other.
    """
    n, at_camera = len(q), I[AT_CAMERA]
    fu, fv, ou, ov = F[at_camera + 24], F[at_camera + 25], F[at_camera + 26], F[at_camera + 27]
    o_Lf, o_sigma = m + m * n, 2 * m + m * n
    L, pull, shift = np.empty((2, 6)), np.empty(6), np.zeros((3, 3))
    for number in range(I[BLOCKS]):
        block = I[AT_BLOCKS] + BLOCK * number
        kind, first, count, at = I[block + KIND], I[block + FIRST], I[block + COUNT], I[block + PARAMETERS]
        K = F[I[block + K_AT]]
        moves = I[block + MOTION] >= 0
        if kind <= HEART:
            if moves:
                displacement(F, I[block + MOTION], 2, t, shift)
            for r in range(count):
                i = I[I[block + WHICH] + r]
                x, y, Z = seen[i, 0], seen[i, 1], seen[i, 6]
                u, vv = fu * x + ou, fv * y + ov
                ud, vd, udd, vdd = fu * seen[i, 2], fv * seen[i, 3], fu * seen[i, 4], fv * seen[i, 5]
                if moves:
                    u, vv, ud, vd = u - shift[0, 0], vv - shift[0, 1], ud - shift[1, 0], vd - shift[1, 1]
                    udd, vdd = udd - shift[2, 0], vdd - shift[2, 1]
                value, gu, gv = curve(kind, F, at, u, vv)
                rate = gu * ud + gv * vd
                row = first + r
                out[o_sigma + row], out[row] = value, value + K * rate
                out[o_Lf + row] = rate + K * (gu * udd + gv * vdd + curve_curvature(kind, F, at, u, vv, ud, vd))
                interaction_rows(x, y, Z, L)
                for j in range(6):
                    pull[j] = K * (gu * fu * L[0, j] + gv * fv * L[1, j])
                for j in range(n):
                    total = 0.0
                    for i6 in range(6):
                        total += pull[i6] * Jc[i6, j]
                    out[m + row * n + j] = total
        elif kind == SPHERE:
            if moves:
                displacement(F, I[block + MOTION], 3, t, shift)
            radius = F[at + 3]
            for r in range(count):
                i = I[I[block + WHICH] + r]
                row = first + r
                dx, dy, dz = points[i, 0, 0] - F[at], points[i, 0, 1] - F[at + 1], points[i, 0, 2] - F[at + 2]
                vx, vy, vz = points[i, 1, 0], points[i, 1, 1], points[i, 1, 2]
                ax, ay, az = points[i, 2, 0], points[i, 2, 1], points[i, 2, 2]
                if moves:
                    dx, dy, dz = dx - shift[0, 0], dy - shift[0, 1], dz - shift[0, 2]
                    vx, vy, vz = vx - shift[1, 0], vy - shift[1, 1], vz - shift[1, 2]
                    ax, ay, az = ax - shift[2, 0], ay - shift[2, 1], az - shift[2, 2]
                d = np.sqrt(dx * dx + dy * dy + dz * dz)
                if d > 0.0:
                    gx, gy, gz = -dx / d, -dy / d, -dz / d
                else:
                    gx, gy, gz = 0.0, 0.0, -1.0
                rate = gx * vx + gy * vy + gz * vz
                near = max(d, 1e-9)
                radial = (dx * vx + dy * vy + dz * vz) / near
                bend = -(vx * vx + vy * vy + vz * vz - radial * radial) / near
                out[o_sigma + row], out[row] = radius - d, radius - d + K * rate
                out[o_Lf + row] = rate + K * (gx * ax + gy * ay + gz * az + bend)
                link = I[I[AT_LINKS] + i]
                point_jacobian(link, points[i, 0], z, p, prismatic, J_base)
                for j in range(n):
                    out[m + row * n + j] = K * (gx * J_base[0, j] + gy * J_base[1, j] + gz * J_base[2, j])
        else:
            # linear in q or q̇: rows G and constants h
            x1 = q if kind == JOINTS_LINEAR else qd
            for r in range(count):
                row, start = first + r, at + (n + 1) * r
                value, rate = F[start + n], 0.0
                for j in range(n):
                    g = F[start + j]
                    value += g * x1[j]
                    rate += g * qd[j]
                    out[m + row * n + j] = K * g if kind == JOINTS_LINEAR else g
                out[o_sigma + row] = value
                if kind == JOINTS_LINEAR:
                    out[row], out[o_Lf + row] = value + K * rate, rate
                else:
                    out[row], out[o_Lf + row] = value, 0.0
