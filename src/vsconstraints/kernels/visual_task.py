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
    k: int,
    out: Array,
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
    k, out
        The number of features, and where J (k, n), b (k,) and the error (k,) go, one after the other.
    """
    n, M = len(qd), I[MARKERS]
    b, error = k * n, k * n + k
    goals, size_of_goal = I[GOALS], 13 + 14 * M
    goal = 0
    for g in range(goals):
        if F[I[AT_GOALS] + g * size_of_goal] <= t + 1e-9:
            goal = g
    at = I[AT_GOALS] + goal * size_of_goal
    # memory: time, goal, error (k), ∂s/∂t (k), J (k, n)
    continues = memory[1] == goal
    rates = np.empty((3, k))
    rate_s, drift_s, partial = rates[0], rates[1], rates[2]
    if I[FEATURE] == CAMERA_POSE:
        matrices, vectors = np.empty((4, 3, 3)), np.empty((5, 3))
        goal_R, E, L3, L3d = matrices[0], matrices[1], matrices[2], matrices[3]
        there, e, wv, lin, near = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
        for i in range(3):
            there[i] = relative_t[i] - F[at + 10 + i]
            near[i] = memory[5 + i]
            for j in range(3):
                goal_R[i, j] = F[at + 1 + 3 * i + j]
        for i in range(3):
            for j in range(3):
                E[i, j] = (
                    goal_R[0, i] * relative_R[0, j] + goal_R[1, i] * relative_R[1, j] + goal_R[2, i] * relative_R[2, j]
                )
        turned_back(goal_R, there, e)
        rotation_vector(E, near, continues, wv)
        rotation_vector_rate(wv, cw, L3, L3d)
        sx, sy, sz = cross(cw, cv)
        lin[0], lin[1], lin[2] = cdv[0] + sx, cdv[1] + sy, cdv[2] + sz
        for i in range(3):
            out[error + i], out[error + 3 + i] = e[i], wv[i]
            rate_s[i] = E[i, 0] * cv[0] + E[i, 1] * cv[1] + E[i, 2] * cv[2]
            rate_s[3 + i] = L3[i, 0] * cw[0] + L3[i, 1] * cw[1] + L3[i, 2] * cw[2]
            drift_s[i] = E[i, 0] * lin[0] + E[i, 1] * lin[1] + E[i, 2] * lin[2]
            drift_s[3 + i] = L3[i, 0] * cdw[0] + L3[i, 1] * cdw[1] + L3[i, 2] * cdw[2]
            drift_s[3 + i] += L3d[i, 0] * cw[0] + L3d[i, 1] * cw[1] + L3d[i, 2] * cw[2]
            for j in range(n):
                out[i * n + j] = E[i, 0] * Jc[0, j] + E[i, 1] * Jc[1, j] + E[i, 2] * Jc[2, j]
                out[(3 + i) * n + j] = L3[i, 0] * Jc[3, j] + L3[i, 1] * Jc[4, j] + L3[i, 2] * Jc[5, j]
        for i in range(k):
            total = 0.0
            for j in range(n):
                total += out[i * n + j] * qd[j]
            partial[i] = rate_s[i] - total
    else:
        share = 0.0 if I[INTERACTION] == CURRENT else 1.0 if I[INTERACTION] == DESIRED else 0.5
        wanted, Ls = at + 13, at + 13 + 2 * M
        L = np.empty((2, 6))
        for i in range(M):
            interaction_rows(seen[i, 0], seen[i, 1], seen[i, 6], L)
            for c in range(2):
                row = 2 * i + c
                out[error + row] = seen[i, c] - F[wanted + row]
                rate_s[row] = seen[i, 2 + c]
                total = 0.0
                for j in range(n):
                    entry = 0.0
                    for i6 in range(6):
                        entry += L[c, i6] * Jc[i6, j]
                    total += entry * qd[j]
                    out[row * n + j] = entry
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
                        out[row * n + j] = (1.0 - share) * out[row * n + j] + share * entry
                        rate_s[row] += out[row * n + j] * qd[j]
    before_error, before_partial, before_J = 2, 2 + k, 2 + 2 * k
    Ts = t - memory[0]
    differences = continues and Ts > 0.0
    norm = 0.0
    for i in range(k):
        if I[DRIFT_DIFFERENCES]:
            drift_s[i] = 0.0
            if differences:
                total = partial[i] - memory[before_partial + i]
                for j in range(n):
                    total += (out[i * n + j] - memory[before_J + i * n + j]) * qd[j]
                drift_s[i] = total / Ts
        if I[VELOCITY_DIFFERENCES] and differences:
            rate_s[i] = (out[error + i] - memory[before_error + i]) / Ts
        norm += out[error + i] * out[error + i]
    at = I[AT_GAINS]
    Kp = F[at] * np.exp(-F[at + 1] / F[at] * np.sqrt(norm))
    Kv = F[at + 2] * np.sqrt(Kp)
    for i in range(k):
        out[b + i] = -Kp * out[error + i] - Kv * rate_s[i] - drift_s[i]
        memory[before_error + i], memory[before_partial + i] = out[error + i], partial[i]
        for j in range(n):
            memory[before_J + i * n + j] = out[i * n + j]
    memory[0], memory[1] = t, goal
