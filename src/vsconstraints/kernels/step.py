"""One control step up to the controller: kinematics, what the camera sees, rows and task, in one compiled function.

What does not change from step to step is packed into two arrays, integers and floats, by
:mod:`vsconstraints.kernels.packing`; what comes out is written to one array.
"""

from __future__ import annotations

import numpy as np

from ..rows import Array, IntArray
from ..scene import MINIMUM_DEPTH
from .compiler import compiled
from .constraint_rows import write_rows
from .image import marker_motion
from .kinematics import chain, cross, point_jacobian, point_motion, product, turned, turned_back
from .layout import (
    AT_CAMERA,
    AT_CHAIN,
    AT_LINKS,
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
)
from .target import target_pose
from .visual_task import write_task


@compiled("int64(float64, float64[::1], float64[::1], int64[::1], float64[::1], float64[::1], float64[::1])")
def evaluate_step(t: float, q: Array, qd: Array, I: IntArray, F: Array, memory: Array, out: Array) -> int:  # noqa: E741 - integers and floats
    """Write everything a controller needs to ``out``; see :class:`vsconstraints.kernels.packing.Packed` for its parts.

    Returns 0, or 1 if a marker is not in front of the camera or a number is not finite: then nothing in ``out`` counts,
    and ``memory`` is as it was.
    """
    n, M, P, m, k = I[JOINTS], I[MARKERS], I[POINTS], I[ROWS], I[SIZE]
    for i in range(n):
        if not (np.isfinite(q[i]) and np.isfinite(qd[i])):
            return 1
    # few arrays, and whole ones: making one, or a view of another shape, takes as long as some thirty products
    prismatic = I[I[AT_PRISMATIC] : I[AT_PRISMATIC] + n]
    R, motions, jacobians = np.empty((n, 3, 3)), np.empty((6, n, 3)), np.empty((9, n))
    p, z, w, v, al, a = motions[0], motions[1], motions[2], motions[3], motions[4], motions[5]
    Jc, J_base = jacobians[:6], jacobians[6:]
    matrices, vectors = np.empty((6, 3, 3)), np.empty((13, 3))
    chain(q, qd, F, I[AT_CHAIN], prismatic, R, p, z, w, v, al, a)
    last = n - 1

    # --- the camera: pose in the base frame, pose in the target's frame, and its motion relative to the target ---
    at = I[AT_CAMERA]
    C_R, C_t = matrices[0], vectors[0]
    for i in range(3):
        C_t[i] = F[at + 9 + i]
        for j in range(3):
            C_R[i, j] = F[at + 3 * i + j]
    fu, fv, ou, ov = F[at + 24], F[at + 25], F[at + 26], F[at + 27]
    camera_R, origin = matrices[1], matrices[2]
    sign = 1.0
    if I[FIXED_CAMERA]:
        sign = -1.0
        camera_R[:] = C_R
        arm, from_link = vectors[1], vectors[2]
        for i in range(3):
            from_link[i] = C_t[i] - p[last, i]
        turned_back(R[last], from_link, arm)
        point_motion(last, arm[0], arm[1], arm[2], R, p, w, v, al, a, origin)
    else:
        product(R[last], C_R, camera_R)
        point_motion(last, C_t[0], C_t[1], C_t[2], R, p, w, v, al, a, origin)
    point_jacobian(last, origin[0], z, p, prismatic, J_base)
    for j in range(n):
        for i in range(3):
            Jc[i, j] = sign * (
                camera_R[0, i] * J_base[0, j] + camera_R[1, i] * J_base[1, j] + camera_R[2, i] * J_base[2, j]
            )
            Jc[3 + i, j] = 0.0
        if not prismatic[j]:
            for i in range(3):
                Jc[3 + i, j] = sign * (camera_R[0, i] * z[j, 0] + camera_R[1, i] * z[j, 1] + camera_R[2, i] * z[j, 2])
    velocity, acceleration, turning, spin = vectors[1], vectors[2], vectors[3], vectors[4]
    target_R, target_t = matrices[3], vectors[5]
    for i in range(3):
        target_t[i] = 0.0
        for j in range(3):
            target_R[i, j] = 1.0 if i == j else 0.0
        velocity[i], turning[i] = origin[1, i], w[last, i]
    if I[MOVING_TARGET]:
        at = I[AT_TARGET]
        moved = matrices[4]
        target_pose(F, at, t, moved, target_R, target_t)
        omega, centre = F[at + 8 : at + 11], F[at + 11 : at + 14]
        away = np.empty(3)
        for i in range(3):
            away[i] = origin[0, i] - centre[i] - moved[0, i]
        # velocity of the target's body at the camera's origin
        bx, by, bz = cross(omega, away)
        velocity[0] -= moved[1, 0] + bx
        velocity[1] -= moved[1, 1] + by
        velocity[2] -= moved[1, 2] + bz
        drift = np.empty(3)
        for i in range(3):
            drift[i] = origin[1, i] - moved[1, i]
        bx, by, bz = cross(omega, drift)
        cx, cy, cz = cross(w[last], velocity)
        acceleration[0] = origin[2, 0] - moved[2, 0] - bx - cx
        acceleration[1] = origin[2, 1] - moved[2, 1] - by - cy
        acceleration[2] = origin[2, 2] - moved[2, 2] - bz - cz
        bx, by, bz = cross(w[last], omega)
        spin[0], spin[1], spin[2] = al[last, 0] + bx, al[last, 1] + by, al[last, 2] + bz
        for i in range(3):
            turning[i] -= omega[i]
    else:
        cx, cy, cz = cross(turning, velocity)
        acceleration[0], acceleration[1], acceleration[2] = origin[2, 0] - cx, origin[2, 1] - cy, origin[2, 2] - cz
        for i in range(3):
            spin[i] = al[last, i]
    cv, cw, cdv, cdw = vectors[6], vectors[7], vectors[8], vectors[9]
    turned_back(camera_R, velocity, cv)
    turned_back(camera_R, turning, cw)
    turned_back(camera_R, acceleration, cdv)
    turned_back(camera_R, spin, cdw)
    if sign < 0.0:
        for i in range(3):
            cv[i], cw[i], cdv[i], cdw[i] = -cv[i], -cw[i], -cdv[i], -cdw[i]
    # frame that the markers are given in: base, the moving target, or the tip
    if I[FIXED_CAMERA]:
        at = I[AT_CAMERA]
        product(R[last], F[at + 12 : at + 21].reshape(3, 3), target_R)
        turned(R[last], F[at + 21 : at + 24], target_t)
        for i in range(3):
            target_t[i] += p[last, i]
    eye = vectors[10]
    for i in range(3):
        eye[i] = C_t[i] if I[FIXED_CAMERA] else origin[0, i]

    # --- the image ---
    seen = np.empty((M, 7))
    at = I[AT_MARKERS]
    there, X = vectors[11], vectors[12]
    for i in range(M):
        x, y, h = F[at + 3 * i], F[at + 3 * i + 1], F[at + 3 * i + 2]
        for j in range(3):
            there[j] = target_R[j, 0] * x + target_R[j, 1] * y + target_R[j, 2] * h + target_t[j] - eye[j]
        turned_back(camera_R, there, X)
        if not X[2] >= MINIMUM_DEPTH:
            return 1
        marker_motion(X, cv, cw, cdv, cdw, seen[i])

    # --- parts of out ---
    o_J, o_error = 3 * m + m * n, 3 * m + m * n + k * n + k
    o_pixels = o_error + k
    o_points = o_pixels + 2 * M
    o_camera = o_points + 3 * P
    for i in range(M):
        out[o_pixels + 2 * i], out[o_pixels + 2 * i + 1] = fu * seen[i, 0] + ou, fv * seen[i, 1] + ov

    # --- robot points ---
    points = np.empty((P, 3, 3))
    at = I[AT_POINTS]
    for i in range(P):
        link = I[I[AT_LINKS] + i]
        if link < 0:
            # fixed to the base
            points[i, 1:] = 0.0
            points[i, 0] = F[at + 3 * i : at + 3 * i + 3]
        else:
            here = at + 3 * i
            point_motion(link, F[here], F[here + 1], F[here + 2], R, p, w, v, al, a, points[i])
        for j in range(3):
            out[o_points + 3 * i + j] = points[i, 0, j]

    write_rows(t, q, qd, I, F, seen, points, Jc, J_base, z, p, prismatic, m, out)
    # --- the camera relative to the target, for the task and for whoever logs it ---
    relative_R, relative_t = matrices[5], vectors[12]
    for i in range(3):
        there[i] = eye[i] - target_t[i]
        for j in range(3):
            relative_R[i, j] = (
                target_R[0, i] * camera_R[0, j] + target_R[1, i] * camera_R[1, j] + target_R[2, i] * camera_R[2, j]
            )
            out[o_camera + 3 * i + j] = relative_R[i, j]
    turned_back(target_R, there, relative_t)
    for i in range(3):
        out[o_camera + 9 + i] = relative_t[i]

    write_task(t, qd, I, F, memory, relative_R, relative_t, cv, cw, cdv, cdw, seen, Jc, k, out[o_J:o_pixels])
    return 0
