"""The tracking task: from a visual feature to J_s q̈ = b."""

from __future__ import annotations

import math

from ..rows import Array, IntArray
from .compiler import in_place
from .image import interaction, pulled
from .kinematics import cross, matrix_at, product, turned
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


@in_place
def write_task(
    t: float,
    qd: Array,
    I: IntArray,  # noqa: E741
    F: Array,
    memory: Array,
    camera: Array,
    twist: Array,
    seen: Array,
    Jc: Array,
    matrices: Array,
    vectors: Array,
    rates: Array,
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
    camera
        (12,) R (3, 3) and t (3,): pose of the camera in the target's frame.
    twist
        (4, 3) v, ω, v̇ and ω̇ of the camera relative to the target, in the camera frame.
    seen, Jc
        As for :func:`vsconstraints.kernels.constraint_rows.write_rows`; (6, n).
    matrices, vectors, rates
        (5, 3, 3), (6, 3) and (3, k), scratch.
    k, out
        The number of features, and where J (k, n), b (k,) and the error (k,) go, one after the other.
    """
    n, M = len(qd), I[MARKERS]
    b, error = k * n, k * n + k
    goal, at = 0, I[AT_GOALS]
    for g in range(I[GOALS]):
        if F[I[AT_GOALS] + g * (13 + 14 * M)] <= t + 1e-9:
            goal, at = g, I[AT_GOALS] + g * (13 + 14 * M)
    continues = memory[1] == goal
    rate_s, drift_s, partial = rates[0], rates[1], rates[2]
    if I[FEATURE] == CAMERA_POSE:
        camera_features(F, at, memory, continues, camera, twist, Jc, matrices, vectors, rates, out, error)
    else:
        image_features(I, F, at, twist, seen, Jc, qd, vectors, rates, out, error)
    # what does not come from the robot, and what replaces ṡ where J_s is not that of the current image
    for i in range(k):
        moving = 0.0
        for j in range(n):
            moving += out[i * n + j] * qd[j]
        if I[FEATURE] == CAMERA_POSE:
            partial[i] = rate_s[i] - moving
        elif I[INTERACTION] != CURRENT:
            rate_s[i] = partial[i] + moving
    before_error, before_partial, before_J = 2, 2 + k, 2 + 2 * k
    Ts = t - memory[0]
    differences = continues and Ts > 0.0
    squared = 0.0
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
        squared += out[error + i] * out[error + i]
    at = I[AT_GAINS]
    Kp = F[at] * math.exp(-F[at + 1] / F[at] * math.sqrt(squared))
    Kv = F[at + 2] * math.sqrt(Kp)
    for i in range(k):
        out[b + i] = -Kp * out[error + i] - Kv * rate_s[i] - drift_s[i]
        memory[before_error + i], memory[before_partial + i] = out[error + i], partial[i]
        for j in range(n):
            memory[before_J + i * n + j] = out[i * n + j]
    memory[0], memory[1] = t, goal


@in_place
def camera_features(
    F: Array,
    at: int,
    memory: Array,
    continues: bool,
    camera: Array,
    twist: Array,
    Jc: Array,
    matrices: Array,
    vectors: Array,
    rates: Array,
    out: Array,
    error: int,
) -> None:
    """Write J_s, the error, ṡ and J̇_s q̇ + ∂ṡ/∂t of (t, θu): see :class:`vsconstraints.features.CameraPose`."""
    n = Jc.shape[1]
    goal_R, camera_R, E, L, L_dot = matrices[0], matrices[1], matrices[2], matrices[3], matrices[4]
    there, e, w, near, w_dot, linear = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], vectors[5]
    matrix_at(camera, 0, camera_R)
    for i in range(3):
        there[i], near[i] = camera[9 + i] - F[at + 10 + i], memory[5 + i]
        # transposed, so that the product is goal_Rᵀ camera_R
        for j in range(3):
            goal_R[j, i] = F[at + 1 + 3 * i + j]
    product(goal_R, camera_R, E)
    turned(goal_R, there, e)
    rotation_vector(E, near, continues, w)
    rotation_vector_rate(w, twist[1], w_dot, L, L_dot)
    cross(twist[1], twist[0], linear)
    for i in range(3):
        out[error + i], out[error + 3 + i], rates[0, 3 + i] = e[i], w[i], w_dot[i]
        rates[0, i] = rates[1, i] = rates[1, 3 + i] = 0.0
        for c in range(3):
            rates[0, i] += E[i, c] * twist[0, c]
            rates[1, i] += E[i, c] * (twist[2, c] + linear[c])
            rates[1, 3 + i] += L[i, c] * twist[3, c] + L_dot[i, c] * twist[1, c]
        for j in range(n):
            along = about = 0.0
            for c in range(3):
                along += E[i, c] * Jc[c, j]
                about += L[i, c] * Jc[3 + c, j]
            out[i * n + j], out[(3 + i) * n + j] = along, about


@in_place
def image_features(
    I: IntArray,  # noqa: E741
    F: Array,
    at: int,
    twist: Array,
    seen: Array,
    Jc: Array,
    qd: Array,
    scratch: Array,
    rates: Array,
    out: Array,
    error: int,
) -> None:
    """Write J_s, the error, ṡ, J̇_s q̇ + ∂ṡ/∂t and ∂s/∂t of markers: see :class:`vsconstraints.features.ImagePoints`."""
    n, M = Jc.shape[1], I[MARKERS]
    share = 0.0 if I[INTERACTION] == CURRENT else 1.0 if I[INTERACTION] == DESIRED else 0.5
    pull, desired = scratch[:2], scratch[2:]
    for row in range(2 * M):
        i, c = row // 2, row % 2
        out[error + row] = seen[i, c] - F[at + 13 + row]
        interaction(1.0 - c, 1.0 * c, seen[i, 0], seen[i, 1], seen[i, 6], pull)
        drift = 0.0
        for j in range(3):
            desired[0, j], desired[1, j] = F[at + 13 + 2 * M + 6 * row + j], F[at + 16 + 2 * M + 6 * row + j]
            drift += ((1.0 - share) * pull[0, j] + share * desired[0, j]) * twist[2, j]
            drift += ((1.0 - share) * pull[1, j] + share * desired[1, j]) * twist[3, j]
        moving = 0.0
        for j in range(n):
            entry = pulled(pull, Jc, j)
            moving += entry * qd[j]
            out[row * n + j] = (1.0 - share) * entry + share * pulled(desired, Jc, j) if share > 0.0 else entry
        rates[0, row], rates[2, row] = seen[i, 2 + c], seen[i, 2 + c] - moving
        rates[1, row] = drift if share > 0.0 else seen[i, 4 + c]
