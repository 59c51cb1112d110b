"""Pixels and robot points at many instants, without their motion."""

from __future__ import annotations

from ..rows import Array, BoolArray, IntArray
from ..scene import MINIMUM_DEPTH
from .compiler import IN_PLACE, compiled
from .kinematics import ORIGIN, matrix_at, poses, product, turned, turned_back
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
)
from .target import target_pose

SIGNATURE = (
    "void(float64[::1], float64[:, ::1], int64[::1], float64[::1], float64[:, :, ::1], "
    "float64[:, :, ::1], float64[:, :, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1], boolean[::1])"
)


@compiled(SIGNATURE, IN_PLACE)
def look(
    t: Array,
    q: Array,
    I: IntArray,  # noqa: E741
    F: Array,
    R: Array,
    motion: Array,
    matrices: Array,
    vectors: Array,
    pixels: Array,
    points: Array,
    seen: BoolArray,
) -> None:
    """Write pixels (N, M, 2) and robot points (N, P, 3) at times t (N,) and coordinates q (N, n).

    ``seen`` (N,) says whether all markers are in front of the camera; where they are not, the pixels do not count. The
    arrays between F and pixels are scratch: see :class:`vsconstraints.kernels.packing.Packed`.
    """
    n, M, P = I[JOINTS], I[MARKERS], I[POINTS]
    prismatic = I[I[AT_PRISMATIC] : I[AT_PRISMATIC] + n]
    at = I[AT_CAMERA]
    camera, mounted, camera_R, target_R, moved = matrices[4], matrices[5], matrices[6], matrices[7], matrices[8]
    eye, target_t, there, X = vectors[3], vectors[4], vectors[5], vectors[6]
    matrix_at(F, at, camera)
    matrix_at(F, at + 12, mounted)
    matrix_at(F, at, camera_R)
    for i in range(3):
        eye[i], target_t[i] = F[at + 9 + i], 0.0
        for j in range(3):
            target_R[i, j] = 1.0 if i == j else 0.0
    for k in range(len(t)):
        poses(q[k], F, I[AT_CHAIN], prismatic, R, motion, matrices, vectors)
        if I[FIXED_CAMERA]:
            product(R[n], mounted, target_R)
            turned(R[n], F[at + 21 : at + 24], target_t)
            for i in range(3):
                target_t[i] += motion[n, ORIGIN, i]
        else:
            product(R[n], camera, camera_R)
            turned(R[n], F[at + 9 : at + 12], eye)
            for i in range(3):
                eye[i] += motion[n, ORIGIN, i]
            if I[MOVING_TARGET]:
                target_pose(F, I[AT_TARGET], t[k], moved, target_R, target_t, X)
        seen[k] = True
        for i in range(M):
            here = I[AT_MARKERS] + 3 * i
            turned(target_R, F[here : here + 3], there)
            for j in range(3):
                there[j] += target_t[j] - eye[j]
            turned_back(camera_R, there, X)
            if not X[2] >= MINIMUM_DEPTH:
                seen[k] = False
            for j in range(2):
                pixels[k, i, j] = F[at + 24 + j] * X[j] / X[2] + F[at + 26 + j]
        for i in range(P):
            here, body = I[AT_POINTS] + 3 * i, I[I[AT_BODIES] + i]
            turned(R[body], F[here : here + 3], X)
            for j in range(3):
                points[k, i, j] = motion[body, ORIGIN, j] + X[j]
