"""The rows of forbidden half-spaces, boxes, cylinders and capsules, after the step itself.

They are apart so that only who has such regions compiles them. The chain is gone through once more: that takes less
than carrying it from one compiled function to another.
"""

from __future__ import annotations

import numpy as np

from ..constraints import formulas
from ..rows import Array, IntArray
from .compiler import compiled, inner
from .kinematics import chain, point_jacobian, point_motion
from .layout import (
    AT_CHAIN,
    AT_LINKS,
    AT_POINTS,
    AT_PRISMATIC,
    AT_REGIONS,
    BLOCK,
    BOX,
    COUNT,
    CYLINDER,
    FIRST,
    HALF_SPACE,
    JOINTS,
    K_AT,
    KIND,
    MOTION,
    PARAMETERS,
    REGIONS,
    ROWS,
    WHICH,
)
from .target import displacement

half_space, box = inner(formulas.half_space), inner(formulas.box)
cylinder, capsule = inner(formulas.cylinder), inner(formulas.capsule)


@inner
def region(kind: int, F: Array, at: int, x: Array, v: Array) -> tuple[float, float, float, float, float]:
    """Distance, its derivatives and its bend at a point x (3,) with velocity v (3,) in the region's frame.

    The region's lengths begin at ``at``.
    """
    if kind == HALF_SPACE:
        return half_space(x[0], x[1], x[2], v[0], v[1], v[2])
    if kind == BOX:
        return box(x[0], x[1], x[2], F[at], F[at + 1], F[at + 2], v[0], v[1], v[2])
    if kind == CYLINDER:
        return cylinder(x[0], x[1], x[2], F[at], F[at + 1], v[0], v[1], v[2])
    return capsule(x[0], x[1], x[2], F[at], F[at + 1], v[0], v[1], v[2])


@compiled("void(float64, float64[::1], float64[::1], int64[::1], float64[::1], float64[::1], float64[::1])")
def add_rows(t: float, q: Array, qd: Array, I: IntArray, F: Array, memory: Array, out: Array) -> None:  # noqa: E741
    """Write φ, L_gφ, L_fφ and σ of all regions to ``out``.

    Arguments are those of :func:`vsconstraints.kernels.step.evaluate_step`, which has to have accepted them.
    """
    n, m = I[JOINTS], I[ROWS]
    prismatic = I[I[AT_PRISMATIC] : I[AT_PRISMATIC] + n]
    R, motions, J, small = np.empty((n, 3, 3)), np.empty((6, n, 3)), np.empty((3, n)), np.zeros((9, 3))
    p, z, w, v, al, a = motions[0], motions[1], motions[2], motions[3], motions[4], motions[5]
    # of a point: position, velocity and acceleration; there and velocity in the region's frame; the gradient
    point, shift, local, slope = small[:3], small[3:6], small[6:8], small[8]
    chain(q, qd, F, I[AT_CHAIN], prismatic, R, p, z, w, v, al, a)
    o_Lf, o_sigma = m + m * n, 2 * m + m * n
    for number in range(I[REGIONS]):
        block = I[AT_REGIONS] + BLOCK * number
        at, K, moves = I[block + PARAMETERS], F[I[block + K_AT]], I[block + MOTION] >= 0
        if moves:
            displacement(F, I[block + MOTION], 3, t, shift)
        for r in range(I[block + COUNT]):
            i, row = I[I[block + WHICH] + r], I[block + FIRST] + r
            link, here = I[I[AT_LINKS] + i], I[AT_POINTS] + 3 * i
            if link < 0:
                # fixed to the base
                for j in range(3):
                    point[0, j], point[1, j], point[2, j] = F[here + j], 0.0, 0.0
            else:
                point_motion(link, F[here], F[here + 1], F[here + 2], R, p, w, v, al, a, point)
            point_jacobian(link, point[0], z, p, prismatic, J)
            if moves:
                for j in range(9):
                    point[j // 3, j % 3] -= shift[j // 3, j % 3]
            # parameters: the region's orientation and origin, margin, lengths
            for j in range(3):
                local[0, j] = local[1, j] = 0.0
                for k in range(3):
                    turn = F[at + 3 * k + j]
                    local[0, j] += turn * (point[0, k] - F[at + 9 + k])
                    local[1, j] += turn * point[1, k]
            distance, nx, ny, nz, bend = region(I[block + KIND], F, at + 13, local[0], local[1])
            sigma, rate, drift = F[at + 12] - distance, 0.0, 0.0
            for j in range(3):
                slope[j] = -(F[at + 3 * j] * nx + F[at + 3 * j + 1] * ny + F[at + 3 * j + 2] * nz)
                rate += slope[j] * point[1, j]
                drift += slope[j] * point[2, j]
            out[o_sigma + row], out[row], out[o_Lf + row] = sigma, sigma + K * rate, rate + K * (drift - bend)
            for j in range(n):
                out[m + row * n + j] = K * (slope[0] * J[0, j] + slope[1] * J[1, j] + slope[2] * J[2, j])
