"""The rotation vector of a rotation matrix, continuous in time, and how it moves."""

from __future__ import annotations

import math

from ..rows import Array
from .compiler import in_place
from .kinematics import turned

TURN = 2.0 * math.pi


@in_place
def length(x: Array) -> float:
    """‖x‖₂ of x (3,)."""
    total = 0.0
    for i in range(3):
        total += x[i] * x[i]
    return math.sqrt(total)


@in_place
def rotation_vector(R: Array, near: Array, continues: bool, w: Array) -> None:
    """Write θu of R (3, 3) to ``w`` (3,): see :func:`vsconstraints.geometry.rotation_vector`."""
    # the quaternion (w, real) by its largest component, which is accurate for every angle
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    largest, at = trace, -1
    for i in range(3):
        if R[i, i] > largest:
            largest, at = R[i, i], i
    real = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        if at < 0:
            w[i] = R[k, j] - R[j, k]
        elif i == at:
            w[i] = 1.0 - trace + 2.0 * largest
            real = R[k, j] - R[j, k]
        else:
            w[i] = R[i, at] + R[at, i]
    sine = length(w)
    theta = 2.0 * math.atan2(sine, abs(real))
    share = 0.0 if sine == 0.0 else theta / sine
    for i in range(3):
        w[i] *= -share if real < 0.0 else share
    factor = 1.0
    if continues:
        if theta < 1e-12:
            # no turn has no axis: that of the last sample counts, if it had made a whole turn
            before = length(near)
            turns = round(before / TURN)
            if before > math.pi:
                for i in range(3):
                    w[i] = near[i] * (TURN * turns / before)
        else:
            along = 0.0
            for i in range(3):
                along += near[i] * w[i]
            turns = round((along / theta - theta) / TURN)
            factor += TURN * turns / theta
    elif theta > math.pi - 1e-6:
        # next to half a turn the axis' sign is ambiguous: its largest component is made positive
        largest = w[0]
        for i in range(3):
            largest = w[i] if abs(w[i]) > abs(largest) else largest
        factor -= TURN / theta if largest < 0.0 else 0.0
    for i in range(3):
        w[i] *= factor


@in_place
def rotation_vector_rate(w: Array, omega: Array, w_dot: Array, L: Array, L_dot: Array) -> None:
    """Write ẇ = L ω (3,), L and its derivative (3, 3): see :func:`vsconstraints.geometry.rotation_vector_rate`."""
    theta = length(w)
    theta2 = theta * theta
    if theta < 0.1:
        c = 1.0 / 12.0 + theta2 * (1.0 / 720.0 + theta2 * (1.0 / 30240.0 + theta2 / 1209600.0))
        slope = 1.0 / 360.0 + theta2 * (1.0 / 7560.0 + theta2 * (1.0 / 201600.0 + theta2 / 5987520.0))
    else:
        half = 0.5 * theta
        cot = 1.0 / math.tan(half)
        c = (1.0 - half * cot) / theta2
        slope = ((0.5 * half * (1.0 + cot * cot) - 0.5 * cot) / theta2 - 2.0 * c / theta) / theta
    # L = I + ½[w]× + c [w]×², and [w]×² = w wᵀ − θ² I
    for i in range(3):
        for j in range(3):
            L[i, j] = c * w[i] * w[j]
        L[i, i] += 1.0 - c * theta2
    add_half_cross(w, L)
    turned(L, omega, w_dot)
    along = 0.0
    for i in range(3):
        along += w[i] * w_dot[i]
    c_dot = slope * along
    for i in range(3):
        for j in range(3):
            L_dot[i, j] = c_dot * w[i] * w[j] + c * (w_dot[i] * w[j] + w[i] * w_dot[j])
        L_dot[i, i] -= c_dot * theta2 + 2.0 * c * along
    add_half_cross(w_dot, L_dot)


@in_place
def add_half_cross(x: Array, L: Array) -> None:
    """Apply L ← L + ½[x]×."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        L[j, k] -= 0.5 * x[i]
        L[k, j] += 0.5 * x[i]
