"""The rotation vector of a rotation matrix, continuous in time, and how it moves."""

from __future__ import annotations

import numpy as np

from ..rows import Array
from .compiler import inner


@inner
def rotation_vector(R: Array, near: Array, continues: bool, w: Array) -> None:
    """Write θu of R (3, 3) to ``w`` (3,): see :func:`vsconstraints.geometry.rotation_vector`."""
    # the quaternion by its largest component, which is accurate for every angle
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    k, largest = -1, trace
    for i in range(3):
        if R[i, i] > largest:
            k, largest = i, R[i, i]
    q = np.empty(4)
    if k < 0:
        q[3] = 1.0 + trace
        q[0], q[1], q[2] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q[k] = 1.0 - trace + 2.0 * R[k, k]
        q[i], q[j] = R[i, k] + R[k, i], R[j, k] + R[k, j]
        q[3] = R[j, i] - R[i, j]
    if q[3] < 0.0:
        q *= -1.0
    sine = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    theta = 2.0 * np.arctan2(sine, q[3])
    for i in range(3):
        w[i] = 0.0 if sine == 0.0 else q[i] * (theta / sine)
    if not continues:
        # next to half a turn the axis' sign is ambiguous: its largest component is made positive
        if theta > np.pi - 1e-6:
            at = 0
            for i in range(3):
                if abs(w[i]) > abs(w[at]):
                    at = i
            if w[at] < 0.0:
                for i in range(3):
                    w[i] *= 1.0 - 2.0 * np.pi / theta
        return
    if theta < 1e-12:
        length = np.sqrt(near[0] ** 2 + near[1] ** 2 + near[2] ** 2)
        if length > np.pi:
            turns = np.round(length / (2.0 * np.pi))
            for i in range(3):
                w[i] = near[i] * (2.0 * np.pi * turns / length)
        return
    along = (near[0] * w[0] + near[1] * w[1] + near[2] * w[2]) / theta
    turns = np.round((along - theta) / (2.0 * np.pi))
    for i in range(3):
        w[i] += 2.0 * np.pi * turns * w[i] / theta


@inner
def rotation_vector_rate(w: Array, omega: Array, L: Array, L_dot: Array) -> None:
    """Write L_θu and its derivative (3, 3) along ω: see :func:`vsconstraints.geometry.rotation_vector_rate`."""
    theta2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    theta = np.sqrt(theta2)
    if theta < 0.1:
        c = 1.0 / 12.0 + theta2 * (1.0 / 720.0 + theta2 * (1.0 / 30240.0 + theta2 / 1209600.0))
        slope = 1.0 / 360.0 + theta2 * (1.0 / 7560.0 + theta2 * (1.0 / 201600.0 + theta2 / 5987520.0))
    else:
        half = 0.5 * theta
        cot = np.cos(half) / np.sin(half)
        c = (1.0 - half * cot) / theta2
        slope = ((-0.5 * cot + 0.5 * half * (1.0 + cot * cot)) / theta2 - 2.0 * c / theta) / theta
    # [w]×² = w wᵀ − θ² I
    for i in range(3):
        for j in range(3):
            L[i, j] = c * w[i] * w[j]
        L[i, i] += 1.0 - c * theta2
    L[0, 1] -= 0.5 * w[2]
    L[0, 2] += 0.5 * w[1]
    L[1, 0] += 0.5 * w[2]
    L[1, 2] -= 0.5 * w[0]
    L[2, 0] -= 0.5 * w[1]
    L[2, 1] += 0.5 * w[0]
    d0 = L[0, 0] * omega[0] + L[0, 1] * omega[1] + L[0, 2] * omega[2]
    d1 = L[1, 0] * omega[0] + L[1, 1] * omega[1] + L[1, 2] * omega[2]
    d2 = L[2, 0] * omega[0] + L[2, 1] * omega[1] + L[2, 2] * omega[2]
    d = (d0, d1, d2)
    along = w[0] * d0 + w[1] * d1 + w[2] * d2
    c_dot = slope * along
    for i in range(3):
        for j in range(3):
            L_dot[i, j] = c_dot * w[i] * w[j] + c * (d[i] * w[j] + w[i] * d[j])
        L_dot[i, i] -= c_dot * theta2 + 2.0 * c * along
    L_dot[0, 1] -= 0.5 * d2
    L_dot[0, 2] += 0.5 * d1
    L_dot[1, 0] += 0.5 * d2
    L_dot[1, 2] -= 0.5 * d0
    L_dot[2, 0] -= 0.5 * d1
    L_dot[2, 1] += 0.5 * d0
