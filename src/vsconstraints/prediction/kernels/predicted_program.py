"""Program of a predictive law: rows and task as predicted along a plan, compiled."""

from __future__ import annotations

import math

import numpy as np

from ...compiled.codes import (
    ERROR,
    GRADIENT,
    JACOBIAN,
    KP0,
    KP_SLOPE,
    KV_FACTOR,
    PHI,
    REST,
    REST_DAMPING,
    REST_STIFFNESS,
    SIGMA,
    B,
)
from ...compiled.compiler import in_place
from ...compiled.workspace import RowArrays, TaskArrays
from ...formulas.tracking import gains
from ...rows import Array
from .plan_arrays import QD, Q
from .predictive_arrays import PlanArrays

#: Rows that change by more than their scale over this distance [rad or m] are divided by the same
#: factor. Far outside the image a row may be 10¹² times its scale: rounding then exceeds any
#: fraction of it, and no other row would count beside it.
ROW_SCALE_DISTANCE = 1e-2


@in_place
def linearise(plans: PlanArrays, count: int, rows: RowArrays) -> None:
    """Write value and gradient of the rows along the plan.

    A row with K > 0 is linearised as σ(q), with ∂σ/∂q = L_gφ/K; a row on φ itself (``by_speed``) as
    φ(q̇), with ∂φ/∂q̇ = L_gφ. The plan so far has moved q or q̇ by ``space.moved`` at the instant
    t, and the row there is predicted to be x_t. With another plan, which moves it by Δ, the row is
    x_t + gradient_t (Δ − moved_t). Hence value_t = x_t − gradient_t moved_t: the row without a
    plan.

    The current difference between a row and its prediction is assumed to persist. With ``fading``
    τ, the current difference d of σ̇ decays: after t it has changed σ by d τ (1 − e^(−t/τ)).
    """
    m, n = plans.gradient.shape[1:]
    for i in range(m):
        on_phi = plans.by_speed[i] != 0
        per_speed = 1.0 if on_phi else 1.0 / plans.K[i]
        quantity = plans.at[PHI if on_phi else SIGMA] + i
        at_gradient = plans.at[GRADIENT] + i * n
        moved = plans.space.moved[QD if on_phi else Q]
        first = plans.seen[0, quantity]
        difference = current_value(plans, rows, i) - first
        drift = drift_while_fading(plans, rows, i, per_speed)
        for t in range(count):
            predicted = plans.seen[t]
            value = predicted[quantity] + difference
            if drift != 0.0:
                value -= drift * np.expm1(-plans.times[t] / plans.fading)
            for j in range(n):
                slope = per_speed * predicted[at_gradient + j]
                plans.gradient[t, i, j] = slope
                value -= slope * moved[t, j]
            plans.value[t, i] = value


@in_place
def current_value(plans: PlanArrays, rows: RowArrays, i: int) -> float:
    """Return σ of row i now, or φ for a row on φ itself, with the margin.

    Where the rows do not give σ, it differs from its prediction as φ does.
    """
    if plans.by_speed[i] != 0:
        value = rows.phi[i]
    elif rows.sigma.size:
        value = rows.sigma[i]
    else:
        predicted_sigma = plans.seen[0, plans.at[SIGMA] + i]
        value = predicted_sigma + rows.phi[i] - plans.seen[0, plans.at[PHI] + i]
    return float(value + plans.margin * rows.scale[i])


@in_place
def drift_while_fading(plans: PlanArrays, rows: RowArrays, i: int, per_speed: float) -> float:
    """Return d τ of row i: how far the drift d of σ̇ moves σ while it fades; 0 without one.

    The model predicts σ̇ = (φ − σ)/K.
    """
    if plans.by_speed[i] != 0 or plans.fading <= 0.0 or rows.sigma_dot.size == 0:
        return 0.0
    predicted_phi = plans.seen[0, plans.at[PHI] + i]
    predicted_sigma = plans.seen[0, plans.at[SIGMA] + i]
    predicted_rate = per_speed * (predicted_phi - predicted_sigma)
    return float(plans.fading * (rows.sigma_dot[i] - predicted_rate))


@in_place
def limit(plans: PlanArrays, count: int, scale: Array) -> None:
    """Write decay of rows, allowed violations while braking, and factors.

    ``falls`` is the factor by which rows decrease from instant to instant, ``left`` how far they
    may be exceeded while braking, and ``row_factor`` the factor that a row is multiplied by.
    """
    m = plans.gradient.shape[1]
    at_stop = plans.times.size - 1  # the instant at the end of the brake
    for t in range(count - 1):
        brakes = t + 1 == at_stop
        interval = plans.times[t + 1] - plans.times[t]
        plans.falls[t] = 0.0 if brakes else np.exp(-interval / plans.approach)
        for i in range(m):
            plans.left[t, i] = left_while_braking(plans, i) if brakes else 0.0
            steepest = steepest_slope(plans, t, i)
            plans.row_factor[t, i] = scale[i] / max(scale[i], ROW_SCALE_DISTANCE * steepest)


@in_place
def left_while_braking(plans: PlanArrays, i: int) -> float:
    """Return how far row i may be exceeded at the end of the brake; infinity for a row on q̇.

    A row that is violated now may return as slowly. The first state does not depend on the plan.
    """
    if plans.by_speed[i] != 0:
        return math.inf
    at_stop = plans.times.size - 1
    remaining = np.exp(-plans.times[at_stop] / plans.approach)
    return float(max(plans.value[0, i], 0.0) * remaining)


@in_place
def steepest_slope(plans: PlanArrays, t: int, i: int) -> float:
    """Return the greatest slope of row i from instant t to the next, over all joints."""
    steepest = 0.0
    for j in range(plans.then.size):
        before = plans.falls[t] * abs(plans.gradient[t, i, j])
        after = abs(plans.gradient[t + 1, i, j])
        steepest = max(steepest, after, before)
    return steepest


@in_place
def write_cost(plans: PlanArrays, count: int, task: TaskArrays) -> float:
    """Write the cost of the blocks that begin where the task is predicted; return λ.

    The residual of block k is J u − b with b as tracking with feedback demands it: another plan,
    which moves q by Δq and q̇ by Δq̇, has b − J (K_p Δq + K_v Δq̇), where b is the one without a
    plan. The prediction b_t includes the feedback of the plan so far, which ``space.moved``
    removes. The cost holds ``square`` = JᵀJ and ``pull`` = Jᵀb, and :class:`.Cost` adds feedback by
    ``gains``.
    """
    H = plans.plan.shape[0]
    total = 0.0
    blocks = 0
    for block in range(H):
        t = begin_of(plans, block)
        plans.gains[block] = 0.0
        plans.rest[block] = 0.0
        plans.square[block] = 0.0
        plans.pull[block] = 0.0
        plans.free[block] = 0.0
        if t >= count:
            continue
        blocks += 1
        total = add_residual(plans, task, block, t, total)
        add_feedback(plans, task, block, t)
        if task.rest.size:
            add_rest(plans, task, block, t)
    size = total / blocks
    if not size > 0.0:
        size = 1.0
    return plans.damping * size


@in_place
def jacobian_entry(plans: PlanArrays, task: TaskArrays, t: int, row: int, joint: int) -> float:
    """Return an entry of J at the instant t: that of the task now, and predicted ones later."""
    if t == 0:
        return float(task.J[row, joint])
    n = plans.plan.shape[1]
    return float(plans.seen[t, plans.at[JACOBIAN] + row * n + joint])


@in_place
def add_residual(plans: PlanArrays, task: TaskArrays, block: int, t: int, total: float) -> float:
    """Add JᵀJ and Jᵀb_t of a block that begins at t; return the total of all ‖J‖².

    The current difference of b from its prediction is assumed to persist.
    """
    n = plans.plan.shape[1]
    seen = plans.seen
    at_b = plans.at[B]
    square = plans.square[block]
    for r in range(task.b.size):
        b = seen[t, at_b + r] + (task.b[r] - seen[0, at_b + r])
        for i in range(n):
            J_i = jacobian_entry(plans, task, t, r, i)
            total += J_i * J_i
            plans.pull[block, i] += J_i * b
            for j in range(n):
                J_j = jacobian_entry(plans, task, t, r, j)
                square[i, j] += J_i * J_j
    return total


@in_place
def add_feedback(plans: PlanArrays, task: TaskArrays, block: int, t: int) -> None:
    """Write K_p and K_v of a block, and remove their feedback of the plan so far from Jᵀb."""
    n = plans.plan.shape[1]
    moved = plans.space.moved
    at_error = plans.at[ERROR]
    squared = 0.0
    for r in range(task.b.size):
        squared += plans.seen[t, at_error + r] ** 2
    tracking = plans.tracking
    Kp, Kv = gains(squared, tracking[KP0], tracking[KP_SLOPE], tracking[KV_FACTOR])
    plans.gains[block, 0] = Kp
    plans.gains[block, 1] = Kv
    for i in range(n):
        for j in range(n):
            feedback = Kp * moved[Q, t, j] + Kv * moved[QD, t, j]
            plans.pull[block, i] += plans.square[block, i, j] * feedback


@in_place
def add_rest(plans: PlanArrays, task: TaskArrays, block: int, t: int) -> None:
    """Write q̈₀ of a block without a plan, with its stiffness and damping."""
    damping = plans.tracking[REST_DAMPING]
    stiffness = plans.tracking[REST_STIFFNESS]
    plans.rest[block, 0] = stiffness
    plans.rest[block, 1] = damping
    moved = plans.space.moved
    at_rest = plans.at[REST]
    for j in range(plans.plan.shape[1]):
        free = task.rest[j]
        if at_rest >= 0:
            free += plans.seen[t, at_rest + j] - plans.seen[0, at_rest + j]
        feedback = stiffness * moved[Q, t, j] + damping * moved[QD, t, j]
        plans.free[block, j] = free + feedback


@in_place
def begin_of(plans: PlanArrays, block: int) -> int:
    """Return the instant at which a block begins, i.e. the end of the previous one."""
    # the first block contains one more instant, unless it is one period long
    first: int = plans.times.size - 2 - plans.plan.shape[0]
    return block + first if block > 0 else 0
