"""One control step up to the controller: kinematics, what the camera sees, rows and task, in one compiled function.

What does not change from step to step is packed into two arrays, integers and floats, by
:mod:`vsconstraints.kernels.packing`, which also makes the arrays that are scratch; what comes out is written to one
array.
"""

from __future__ import annotations

import numpy as np

from ..rows import Array, IntArray
from ..scene import MINIMUM_DEPTH
from .compiler import IN_PLACE, compiled
from .constraint_rows import write_rows
from .image import marker_motion
from .kinematics import (
    AXIS,
    ORIGIN,
    carried,
    chain,
    matrix_at,
    point_jacobian,
    product,
    turned,
    turned_back,
)
from .layout import (
    AT_BODIES,
    AT_CAMERA,
    AT_CHAIN,
    AT_MARKERS,
    AT_POINTS,
    AT_PRISMATIC,
    AT_TARGET,
    FIXED_CAMERA,
    JOINTS,
    MARKERS,
    MOVING_TARGET,
    POINTS,
    ROWS,
    SIZE,
    TOLD_OF_TARGET,
)
from .target import relative_motion, target_pose
from .visual_task import write_task

ARGUMENTS = (
    "(int64[::1], float64[::1], float64[::1], float64[:, :, ::1], float64[:, :, ::1], float64[:, :, ::1], "
    "float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, ::1], "
    "float64[::1], float64, float64[::1], float64[::1])"
)
"""Of the step, and of what adds rows to it afterwards."""


@compiled(f"int64{ARGUMENTS}", IN_PLACE)
def evaluate_step(
    I: IntArray,  # noqa: E741 - integers and floats
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
) -> int:
    """Write everything a controller needs to ``out``; see :class:`vsconstraints.kernels.packing.Packed` for all arrays.

    Returns 0, or 1 if q or q̇ has another size, a number is not finite, or a marker is not in front of the camera:
    then nothing in ``out`` counts, and ``memory`` is as it was.
    """
    n, M, P, m, k = I[JOINTS], I[MARKERS], I[POINTS], I[ROWS], I[SIZE]
    if q.size != n or qd.size != n or not abs(t) < np.inf:
        return 1
    # who calls the entry point without a look at the types may bring others
    if n > 1 and (q.strides[0] != q.itemsize or qd.strides[0] != qd.itemsize):
        return 1
    for i in range(n):
        if not (np.isfinite(q[i]) and np.isfinite(qd[i])):
            return 1
    prismatic = I[I[AT_PRISMATIC] : I[AT_PRISMATIC] + n]
    Jc, J_base = jacobians[:6], jacobians[6:]
    chain(q, qd, F, I[AT_CHAIN], prismatic, R, motion, matrices, vectors)
    tip_R, tip = R[n], motion[n]

    # --- the camera: its pose in the base frame ---
    at = I[AT_CAMERA]
    placed, camera_R, origin, target_R, moved = matrices[4], matrices[5], matrices[6], matrices[7], matrices[8]
    r, s, target_t, X = vectors[0], vectors[1], vectors[2], vectors[3]
    matrix_at(F, at, placed)
    placed_t = F[at + 9 : at + 12]
    if I[FIXED_CAMERA]:
        # as if the tip carried it: its motion is that of the target, reversed
        matrix_at(F, at, camera_R)
        for i in range(3):
            r[i] = placed_t[i] - tip[ORIGIN, i]
    else:
        product(tip_R, placed, camera_R)
        turned(tip_R, placed_t, r)
    carried(r, tip, s, origin)
    eye = origin[0]

    # --- the frame that the markers are given in, and how the camera moves relative to it ---
    omega = vectors[4]
    for i in range(3):
        target_t[i] = omega[i] = 0.0
        for j in range(3):
            moved[i, j], target_R[i, j] = 0.0, 1.0 if i == j else 0.0
    if I[MOVING_TARGET]:
        target_pose(F, I[AT_TARGET], t, moved, target_R, target_t, omega)
        told = 1.0 if I[TOLD_OF_TARGET] else 0.0
        for i in range(3):
            omega[i] = told * F[I[AT_TARGET] + 8 + i]
            r[i] = eye[i] - F[I[AT_TARGET] + 11 + i] - moved[0, i]
            moved[1, i] *= told
            moved[2, i] *= told
    twist = vectors[5:9]
    relative_motion(tip, origin, moved, omega, r, s, vectors[9:13], twist, camera_R)
    sign = -1.0 if I[FIXED_CAMERA] else 1.0
    for i in range(4):
        for j in range(3):
            twist[i, j] *= sign
    point_jacobian(n, eye, motion, prismatic, J_base)
    for j in range(n):
        joint = motion[j + 1]
        for i in range(3):
            along = about = 0.0
            for c in range(3):
                along += camera_R[c, i] * J_base[c, j]
                about += camera_R[c, i] * joint[AXIS, c]
            Jc[i, j], Jc[3 + i, j] = sign * along, 0.0 if prismatic[j] else sign * about
    if I[FIXED_CAMERA]:
        matrix_at(F, at + 12, placed)
        product(tip_R, placed, target_R)
        turned(tip_R, F[at + 21 : at + 24], target_t)
        for i in range(3):
            target_t[i] += tip[ORIGIN, i]

    # --- the image ---
    o_J = 3 * m + m * n
    o_pixels = o_J + k * n + 2 * k
    o_points = o_pixels + 2 * M
    o_camera = o_points + 3 * P
    for i in range(M):
        here = I[AT_MARKERS] + 3 * i
        turned(target_R, F[here : here + 3], r)
        for j in range(3):
            r[j] += target_t[j] - eye[j]
        turned_back(camera_R, r, X)
        if not X[2] >= MINIMUM_DEPTH:
            return 1
        marker_motion(X, twist, vectors[9:12], seen[i])
        for j in range(2):
            out[o_pixels + 2 * i + j] = F[at + 24 + j] * seen[i, j] + F[at + 26 + j]

    # --- robot points ---
    for i in range(P):
        here, body = I[AT_POINTS] + 3 * i, I[I[AT_BODIES] + i]
        turned(R[body], F[here : here + 3], r)
        carried(r, motion[body], s, points[i])
        for j in range(3):
            out[o_points + 3 * i + j] = points[i, 0, j]

    write_rows(t, q, qd, I, F, seen, points, jacobians, motion, prismatic, matrices[9:], vectors[9:], m, out)
    # --- the camera relative to the target, for the task and for whoever logs it ---
    for i in range(3):
        r[i] = eye[i] - target_t[i]
        for j in range(3):
            total = 0.0
            for c in range(3):
                total += target_R[c, i] * camera_R[c, j]
            out[o_camera + 3 * i + j] = total
    turned_back(target_R, r, out[o_camera + 9 :])
    write_task(t, qd, I, F, memory, out[o_camera:], twist, seen, Jc, matrices, vectors[9:], rates, k, out[o_J:o_pixels])
    return 0
