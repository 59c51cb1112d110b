"""Pixels and robot points at many instants, without their motion."""

from __future__ import annotations

import numpy as np

from ..rows import Array, BoolArray, IntArray
from ..scene import MINIMUM_DEPTH
from .compiler import compiled
from .kinematics import chain, point_motion, product, turned, turned_back
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
)
from .target import target_pose

SIGNATURE = (
    "void(float64[::1], float64[:, ::1], int64[::1], float64[::1], "
    "float64[:, :, ::1], float64[:, :, ::1], boolean[::1])"
)


@compiled(SIGNATURE)
def look(t: Array, q: Array, I: IntArray, F: Array, pixels: Array, points: Array, seen: BoolArray) -> None:  # noqa: E741
    """Write pixels (N, M, 2) and robot points (N, P, 3) at times t (N,) and coordinates q (N, n).

    ``seen`` (N,) says whether all markers are in front of the camera; where they are not, the pixels do not count.
    """
    n, M, P = I[JOINTS], I[MARKERS], I[POINTS]
    prismatic = I[I[AT_PRISMATIC] : I[AT_PRISMATIC] + n]
    R, motions = np.empty((n, 3, 3)), np.empty((6, n, 3))
    p, z, w, v, al, a = motions[0], motions[1], motions[2], motions[3], motions[4], motions[5]
    at = I[AT_CAMERA]
    C_R, C_t = F[at : at + 9].reshape(3, 3), F[at + 9 : at + 12]
    tip_R, tip_t = F[at + 12 : at + 21].reshape(3, 3), F[at + 21 : at + 24]
    fu, fv, ou, ov = F[at + 24], F[at + 25], F[at + 26], F[at + 27]
    still = np.zeros(n)
    camera_R, target_R, target_t, eye = np.empty((3, 3)), np.eye(3), np.zeros(3), np.empty(3)
    moved, there, X = np.empty((3, 3)), np.empty(3), np.empty(3)
    last = n - 1
    for k in range(len(t)):
        chain(q[k], still, F, I[AT_CHAIN], prismatic, R, p, z, w, v, al, a)
        if I[FIXED_CAMERA]:
            for i in range(3):
                eye[i] = C_t[i]
                for j in range(3):
                    camera_R[i, j] = C_R[i, j]
            product(R[last], tip_R, target_R)
            turned(R[last], tip_t, target_t)
            for i in range(3):
                target_t[i] += p[last, i]
        else:
            product(R[last], C_R, camera_R)
            turned(R[last], C_t, eye)
            for i in range(3):
                eye[i] += p[last, i]
            if I[MOVING_TARGET]:
                target_pose(F, I[AT_TARGET], t[k], moved, target_R, target_t)
        seen[k] = True
        for i in range(M):
            here = I[AT_MARKERS] + 3 * i
            turned(target_R, F[here : here + 3], there)
            for j in range(3):
                there[j] += target_t[j] - eye[j]
            turned_back(camera_R, there, X)
            if not X[2] >= MINIMUM_DEPTH:
                seen[k] = False
            pixels[k, i, 0], pixels[k, i, 1] = fu * X[0] / X[2] + ou, fv * X[1] / X[2] + ov
        for i in range(P):
            link, here = I[I[AT_LINKS] + i], I[AT_POINTS] + 3 * i
            if link < 0:
                for j in range(3):
                    points[k, i, j] = F[here + j]
            else:
                point_motion(link, F[here], F[here + 1], F[here + 2], R, p, w, v, al, a, moved)
                for j in range(3):
                    points[k, i, j] = moved[0, j]
