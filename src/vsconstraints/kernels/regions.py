"""The rows of forbidden half-spaces, boxes, cylinders and capsules, after the step itself.

They are apart so that only who has such regions compiles them.
"""

from __future__ import annotations

from ..formulas import regions as formulas
from ..rows import Array, IntArray
from .compiler import IN_PLACE, compiled, in_place
from .kinematics import matrix_at, point_jacobian, turned
from .layout import (
    AT_BODIES,
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
    TOLD,
    WHICH,
)
from .step import ARGUMENTS
from .target import displacement

half_space, half_space_curvature = in_place(formulas.half_space), in_place(formulas.half_space_curvature)
box, box_curvature = in_place(formulas.box), in_place(formulas.box_curvature)
cylinder, cylinder_curvature = in_place(formulas.cylinder), in_place(formulas.cylinder_curvature)
capsule, capsule_curvature = in_place(formulas.capsule), in_place(formulas.capsule_curvature)


@in_place
def region(kind: int, F: Array, at: int, x: Array, v: Array) -> tuple[float, float, float, float, float]:
    """Depth, its derivatives and its curvature at a point x (3,) with velocity v (3,) in the region's frame.

    The region's lengths begin at ``at``.
    """
    if kind == HALF_SPACE:
        bent = half_space_curvature(x[0], x[1], x[2], v[0], v[1], v[2])
        depth, dx, dy, dz = half_space(x[0], x[1], x[2])
    elif kind == BOX:
        bent = box_curvature(x[0], x[1], x[2], F[at], F[at + 1], F[at + 2], v[0], v[1], v[2])
        depth, dx, dy, dz = box(x[0], x[1], x[2], F[at], F[at + 1], F[at + 2])
    elif kind == CYLINDER:
        bent = cylinder_curvature(x[0], x[1], x[2], F[at], F[at + 1], v[0], v[1], v[2])
        depth, dx, dy, dz = cylinder(x[0], x[1], x[2], F[at], F[at + 1])
    else:
        bent = capsule_curvature(x[0], x[1], x[2], F[at], F[at + 1], v[0], v[1], v[2])
        depth, dx, dy, dz = capsule(x[0], x[1], x[2], F[at], F[at + 1])
    return depth, dx, dy, dz, bent


@compiled(f"void{ARGUMENTS}", IN_PLACE)
def add_rows(
    I: IntArray,  # noqa: E741
    F: Array,
    memory: Array,
    R: Array,
    motion: Array,
    matrices: Array,
    vectors: Array,
    jacobians: Array,
    seen: Array,
    points: Array,
    rates: Array,
    out: Array,
    t: float,
    q: Array,
    qd: Array,
) -> None:
    """Write φ, L_gφ, L_fφ and σ of all regions to ``out``.

    Arguments are those of :func:`vsconstraints.kernels.step.evaluate_step`, as it has left them.
    """
    n, m = I[JOINTS], I[ROWS]
    prismatic, J = I[I[AT_PRISMATIC] : I[AT_PRISMATIC] + n], jacobians[6:]
    shift, turn, local, slope = matrices[0], matrices[1], vectors[:2], vectors[2]
    o_Lf, o_sigma = m + m * n, 2 * m + m * n
    for number in range(I[REGIONS]):
        block = I[AT_REGIONS] + BLOCK * number
        at, K = I[block + PARAMETERS], F[I[block + K_AT]]
        # parameters: the region's orientation and origin, margin, lengths
        matrix_at(F, at, turn)
        for j in range(9):
            shift[j // 3, j % 3] = 0.0
        if I[block + MOTION] >= 0:
            displacement(F, I[block + MOTION], 3, t, shift)
        told = 1.0 if I[block + TOLD] else 0.0
        for r in range(I[block + COUNT]):
            i, row = I[I[block + WHICH] + r], I[block + FIRST] + r
            point_jacobian(I[I[AT_BODIES] + i], points[i, 0], motion, prismatic, J)
            for j in range(3):
                local[0, j] = local[1, j] = 0.0
                for k in range(3):
                    local[0, j] += turn[k, j] * (points[i, 0, k] - shift[0, k] - F[at + 9 + k])
                    local[1, j] += turn[k, j] * (points[i, 1, k] - told * shift[1, k])
            depth, slope[0], slope[1], slope[2], bend = region(I[block + KIND], F, at + 13, local[0], local[1])
            sigma, rate, drift = F[at + 12] + depth, 0.0, 0.0
            for j in range(3):
                rate += slope[j] * local[1, j]
            # from here on in the base frame
            turned(turn, slope, local[0])
            for j in range(3):
                drift += local[0, j] * (points[i, 2, j] - told * shift[2, j])
            out[o_sigma + row], out[row], out[o_Lf + row] = sigma, sigma + K * rate, rate + K * (drift + bend)
            for j in range(n):
                total = 0.0
                for k in range(3):
                    total += local[0, k] * J[k, j]
                out[m + row * n + j] = K * total
