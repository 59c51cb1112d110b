"""The rows of all constraints with a compiled form."""

from __future__ import annotations

import math

from ..rows import Array, IntArray
from .compiler import in_place
from .curves import curve, curve_curvature
from .image import interaction, pulled
from .kinematics import point_jacobian
from .layout import (
    AT_BLOCKS,
    AT_BODIES,
    AT_CAMERA,
    BLOCK,
    BLOCKS,
    COUNT,
    FIRST,
    JOINTS_LINEAR,
    K_AT,
    KIND,
    MOTION,
    PARAMETERS,
    SPHERE,
    TOLD,
    WHICH,
)
from .target import displacement


@in_place
def write_rows(
    t: float,
    q: Array,
    qd: Array,
    I: IntArray,  # noqa: E741
    F: Array,
    seen: Array,
    points: Array,
    jacobians: Array,
    motion: Array,
    prismatic: IntArray,
    matrices: Array,
    vectors: Array,
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
    jacobians
        (9, n): that of the camera's twist relative to the target, and scratch for those of points.
    motion, prismatic
        (n + 1, 6, 3) and (n,): see :func:`vsconstraints.kernels.kinematics.chain`.
    matrices, vectors
        (2, 3, 3) and (3, 3), scratch.
    m, out
        The number of rows, and where φ (m,), L_gφ (m, n), L_fφ (m,) and σ (m,) go, one after the other.
    """
    n, eye = len(q), I[AT_CAMERA] + 24
    o_Lf = m + m * n
    Jc, J_point = jacobians[:6], jacobians[6:]
    shift, y, g, pull = matrices[0], matrices[1], vectors[0], vectors[1:]
    for number in range(I[BLOCKS]):
        block = I[AT_BLOCKS] + BLOCK * number
        kind, first, at = I[block + KIND], I[block + FIRST], I[block + PARAMETERS]
        K = F[I[block + K_AT]]
        if kind > SPHERE:
            linear_rows(kind, first, I[block + COUNT], K, q, qd, F, at, m, out)
            continue
        size = 3 if kind == SPHERE else 2
        for c in range(3):
            g[c] = 0.0
            for j in range(3):
                shift[c, j] = 0.0
        if I[block + MOTION] >= 0:
            displacement(F, I[block + MOTION], size, t, shift)
        for r in range(I[block + COUNT]):
            row, i = first + r, I[I[block + WHICH] + r]
            # position, velocity and acceleration relative to what is forbidden, as far as its motion is told
            for c in range(3):
                told = 1.0 if c == 0 or I[block + TOLD] else 0.0
                for j in range(size):
                    at_rest = points[i, c, j] if kind == SPHERE else F[eye + j] * seen[i, 2 * c + j]
                    y[c, j] = at_rest - told * shift[c, j]
            if kind == SPHERE:
                value, bend = sphere(F, at, y, g)
                point_jacobian(I[I[AT_BODIES] + i], points[i, 0], motion, prismatic, J_point)
            else:
                u, v = y[0, 0] + F[eye + 2], y[0, 1] + F[eye + 3]
                value, g[0], g[1] = curve(kind, F, at, u, v)
                bend = curve_curvature(kind, F, at, u, v, y[1, 0], y[1, 1])
                interaction(K * g[0] * F[eye], K * g[1] * F[eye + 1], seen[i, 0], seen[i, 1], seen[i, 6], pull)
            rate = 0.0
            for j in range(size):
                rate += g[j] * y[1, j]
                bend += g[j] * y[2, j]
            out[row] = value + K * rate
            out[o_Lf + row] = rate + K * bend
            out[o_Lf + m + row] = value
            for j in range(n):
                if kind == SPHERE:
                    total = 0.0
                    for c in range(3):
                        total += K * g[c] * J_point[c, j]
                else:
                    total = pulled(pull, Jc, j)
                out[m + row * n + j] = total


@in_place
def linear_rows(
    kind: int, first: int, count: int, K: float, q: Array, qd: Array, F: Array, at: int, m: int, out: Array
) -> None:
    """Write rows that are linear in q or q̇, of which there begin the gradients (count, n + 1), each with a constant."""
    n = len(q)
    for row in range(first, first + count):
        value, rate = F[at + n], 0.0
        for j in range(n):
            g = F[at + j]
            value += g * (q[j] if kind == JOINTS_LINEAR else qd[j])
            rate += g * qd[j] if kind == JOINTS_LINEAR else 0.0
            out[m + row * n + j] = K * g if kind == JOINTS_LINEAR else g
        out[row] = value + K * rate
        out[m + m * n + row] = rate
        out[m + m * n + m + row] = value
        at += n + 1


@in_place
def sphere(F: Array, at: int, y: Array, g: Array) -> tuple[float, float]:
    """Value and curvature along ẏ of r − ‖y − c‖, where there begin c and r; ``g`` gets the gradient.

    ``y`` (3, 3) is position, velocity and acceleration.
    """
    squared = speed = radial = 0.0
    for j in range(3):
        g[j] = y[0, j] - F[at + j]
        squared += g[j] * g[j]
        speed += y[1, j] * y[1, j]
        radial += g[j] * y[1, j]
    d = math.sqrt(squared)
    near = max(d, 1e-9)
    radial /= near
    for j in range(3):
        g[j] = -g[j] / d if d > 0.0 else -1.0 if j == 2 else 0.0
    return F[at + 3] - d, (radial * radial - speed) / near
