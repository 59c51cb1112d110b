"""The tracking task: from a visual feature to J_s q̈ = b."""

from __future__ import annotations

import numpy as np

from ..rows import Array, IntArray
from .compiler import inner
from .image import interaction_rows
from .kinematics import cross, turned_back
from .layout import (
    AT_GAINS,
    AT_GOALS,
    CAMERA_POSE,
    CURRENT,
    DESIRED,
    DRIFT_DIFFERENCES,
    FEATURE,
    GOALS,
    INTERACTION,
    MARKERS,
    VELOCITY_DIFFERENCES,
)
from .rotation import rotation_vector, rotation_vector_rate


@inner
def write_task(
    t: float,
    qd: Array,
    I: IntArray,  # noqa: E741
    F: Array,
    memory: Array,
    relative_R: Array,
    relative_t: Array,
    cv: Array,
    cw: Array,
    cdv: Array,
    cdw: Array,
    seen: Array,
    Jc: Array,
    J: Array,
    b: Array,
    error: Array,
) -> None:
    """Write J_s, b and the feature's error, and remember them: see :class:`vsconstraints.tracking.VisualTask`.

    Parameters
    ----------
    t, qd
        Time [s] and speeds (n,).
    I, F
        See :mod:`vsconstraints.kernels.layout`.
    memory
        Time, goal, error (k), ∂s/∂t (k) and J (k, n) of the last sample.
    relative_R, relative_t
        (3, 3) and (3,): pose of the camera in the target's frame.
    cv, cw, cdv, cdw
        (3,) its twist relative to the target and the twist's derivative, in the camera frame.
    seen, Jc
        As for :func:`vsconstraints.kernels.constraint_rows.write_rows`.
    J, b, error
        (k, n), (k,), (k,): outputs.
    """
    n, M, k = len(qd), I[MARKERS], len(error)
    there = np.empty(3)
    goals, size_of_goal = I[GOALS], 13 + 14 * M
    goal = 0
    for g in range(goals):
        if F[I[AT_GOALS] + g * size_of_goal] <= t + 1e-9:
            goal = g
    at = I[AT_GOALS] + goal * size_of_goal
    # memory: time, goal, error (k), ∂s/∂t (k), J (k, n)
    continues = memory[1] == goal
    rate_s, drift_s, partial = np.empty(k), np.empty(k), np.empty(k)
    if I[FEATURE] == CAMERA_POSE:
        goal_R, goal_t = F[at + 1 : at + 10].reshape(3, 3), F[at + 10 : at + 13]
        E, e, L3, L3d = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
        for i in range(3):
            there[i] = relative_t[i] - goal_t[i]
            for j in range(3):
                E[i, j] = (
                    goal_R[0, i] * relative_R[0, j] + goal_R[1, i] * relative_R[1, j] + goal_R[2, i] * relative_R[2, j]
                )
        turned_back(goal_R, there, e)
        wv = np.empty(3)
        rotation_vector(E, memory[5:8], continues, wv)
        rotation_vector_rate(wv, cw, L3, L3d)
        sx, sy, sz = cross(cw, cv)
        lin = np.empty(3)
        lin[0], lin[1], lin[2] = cdv[0] + sx, cdv[1] + sy, cdv[2] + sz
        for i in range(3):
            error[i], error[3 + i] = e[i], wv[i]
            rate_s[i] = E[i, 0] * cv[0] + E[i, 1] * cv[1] + E[i, 2] * cv[2]
            rate_s[3 + i] = L3[i, 0] * cw[0] + L3[i, 1] * cw[1] + L3[i, 2] * cw[2]
            drift_s[i] = E[i, 0] * lin[0] + E[i, 1] * lin[1] + E[i, 2] * lin[2]
            drift_s[3 + i] = L3[i, 0] * cdw[0] + L3[i, 1] * cdw[1] + L3[i, 2] * cdw[2]
            drift_s[3 + i] += L3d[i, 0] * cw[0] + L3d[i, 1] * cw[1] + L3d[i, 2] * cw[2]
            for j in range(n):
                J[i, j] = E[i, 0] * Jc[0, j] + E[i, 1] * Jc[1, j] + E[i, 2] * Jc[2, j]
                J[3 + i, j] = L3[i, 0] * Jc[3, j] + L3[i, 1] * Jc[4, j] + L3[i, 2] * Jc[5, j]
        for i in range(k):
            total = 0.0
            for j in range(n):
                total += J[i, j] * qd[j]
            partial[i] = rate_s[i] - total
    else:
        share = 0.0 if I[INTERACTION] == CURRENT else 1.0 if I[INTERACTION] == DESIRED else 0.5
        wanted, Ls = at + 13, at + 13 + 2 * M
        L = np.empty((2, 6))
        for i in range(M):
            interaction_rows(seen[i, 0], seen[i, 1], seen[i, 6], L)
            for c in range(2):
                row = 2 * i + c
                error[row] = seen[i, c] - F[wanted + row]
                rate_s[row] = seen[i, 2 + c]
                total = 0.0
                for j in range(n):
                    entry = 0.0
                    for i6 in range(6):
                        entry += L[c, i6] * Jc[i6, j]
                    total += entry * qd[j]
                    J[row, j] = entry
                partial[row] = seen[i, 2 + c] - total
                drift_s[row] = seen[i, 4 + c]
                if share > 0.0:
                    desired = 0.0
                    for i6 in range(6):
                        desired += F[Ls + 6 * row + i6] * (cdv[i6] if i6 < 3 else cdw[i6 - 3])
                    drift_s[row] = (1.0 - share) * drift_s[row] + share * desired
                    rate_s[row] = partial[row]
                    for j in range(n):
                        entry = 0.0
                        for i6 in range(6):
                            entry += F[Ls + 6 * row + i6] * Jc[i6, j]
                        J[row, j] = (1.0 - share) * J[row, j] + share * entry
                        rate_s[row] += J[row, j] * qd[j]
    before_error, before_partial = memory[2 : 2 + k], memory[2 + k : 2 + 2 * k]
    before_J = memory[2 + 2 * k : 2 + 2 * k + k * n].reshape(k, n)
    Ts = t - memory[0]
    differences = continues and Ts > 0.0
    norm = 0.0
    for i in range(k):
        if I[DRIFT_DIFFERENCES]:
            drift_s[i] = 0.0
            if differences:
                total = partial[i] - before_partial[i]
                for j in range(n):
                    total += (J[i, j] - before_J[i, j]) * qd[j]
                drift_s[i] = total / Ts
        if I[VELOCITY_DIFFERENCES] and differences:
            rate_s[i] = (error[i] - before_error[i]) / Ts
        norm += error[i] * error[i]
    at = I[AT_GAINS]
    Kp = F[at] * np.exp(-F[at + 1] / F[at] * np.sqrt(norm))
    Kv = F[at + 2] * np.sqrt(Kp)
    for i in range(k):
        b[i] = -Kp * error[i] - Kv * rate_s[i] - drift_s[i]
        before_error[i], before_partial[i] = error[i], partial[i]
        for j in range(n):
            before_J[i, j] = J[i, j]
    memory[0], memory[1] = t, goal
