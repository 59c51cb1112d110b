"""Predictive safety filter, compiled.

It shifts the last plan in time, predicts rows and task along it, and finds the best plan there.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ..formulas.tracking import gains
from ..rows import Array, IntArray
from ..rows.tolerances import PULLING
from .compiler import IN_PLACE, compiled, in_place
from .from_state import start_from
from .laws import RESOLVER, load_law
from .least_distance import FORCE
from .linear import copy_vector
from .parts import call_int_pointer, load_step, struct_loader
from .plan_program import (
    ROW_SCALE_DISTANCE,
    Cost,
    Factor,
    Limits,
    Space,
    follow_block,
    move,
    plan_best,
)
from .resolving import finished, follow_alone, measurable
from .workspace import (
    F8,
    FAILED,
    I8,
    KP0,
    KP_SLOPE,
    KV_FACTOR,
    NEEDS_PYTHON,
    RELAXED_ROWS,
    REST_DAMPING,
    REST_STIFFNESS,
    SOLVED,
    STAGE,
    Answer,
    LawArrays,
    RowArrays,
    TaskArrays,
    zeros,
)

#: Parts of a prediction: φ, σ, L_gφ, J, b, e and q̈₀.
PHI, SIGMA, GRADIENT, JACOBIAN, B, ERROR, REST, PARTS = range(8)
#: Reported numbers: instants at which rows and task were predicted, instants requested, active rows
#: of the plan, and the code of its program.
PREDICTED, ASKED, ACTIVE, CODE, OUTCOMES = range(5)
#: Stages of a law (option 1). If Python predicts, it requests one at a time.
ALL, PROPOSE, BRAKE, CONCLUDE = range(4)


class PlanArrays(NamedTuple):
    """Arrays of a predictive law: H blocks, up to N instants, n joints, m rows, k features."""

    #: Addresses of the step in the loop and of the predicting step; 0 if Python predicts.
    loop: int
    step: int
    frozen: int  #: 1 if everything is predicted at the current time.
    #: Time constant [s] with which the current difference of σ̇ from the model is assumed to decay;
    #: 0 if at once.
    fading: float
    #: T_s, T and κ [s], λ relative to the mean of ‖J‖², and the margin as a share of the rows'
    #: scales.
    period: float
    length: float
    approach: float
    damping: float
    margin: float
    #: K_p(0), its slope, K_v/√K_p; d and (d/2)² of q̈₀.
    tracking: Annotated[Array, F8, 5]
    most: Annotated[Array, F8, "n"]  #: Greatest |q̈|.
    K: Annotated[Array, F8, "m"]  #: K of the rows, 0 for rows that give φ itself.
    weights: Annotated[Array, F8, "m"]  #: Weights of violations.
    now: Annotated[Array, F8, "2n + 1"]  #: t, q, q̇.
    #: First entries of the parts of a prediction, or −1; predictions; outputs of the step.
    at: Annotated[IntArray, I8, PARTS]
    seen: Annotated[Array, F8, "N", "outputs"]
    out: Annotated[Array, F8, "outputs"]
    #: Instants from now [s], their blocks, and the time since the block began [s]; the last instant
    #: is that of the brake.
    times: Annotated[Array, F8, "N"]
    block: Annotated[IntArray, I8, "N"]
    since: Annotated[Array, F8, "N"]
    states: Annotated[Array, F8, 2, "N", "n"]  #: q and q̇.
    plan: Annotated[Array, F8, "H", "n"]  #: Planned q̈.
    then: Annotated[Array, F8, "n"]  #: q̈ after the plan.
    made: Annotated[Array, F8, 1]  #: Time at which it was made, NaN if there is no plan.
    outcome: Annotated[IntArray, I8, OUTCOMES]  #: Reported numbers.
    braking: Annotated[Array, F8, 1]  #: Duration of the brake [s].
    #: See :class:`.Cost`.
    gains: Annotated[Array, F8, "H", 2]
    rest: Annotated[Array, F8, "H", 2]
    square: Annotated[Array, F8, "H", "n", "n"]
    pull: Annotated[Array, F8, "H", "n"]
    free: Annotated[Array, F8, "H", "n"]
    factor: Factor
    #: See :class:`.Limits`.
    value: Annotated[Array, F8, "N", "m"]
    gradient: Annotated[Array, F8, "N", "m", "n"]
    by_speed: Annotated[IntArray, I8, "m"]
    falls: Annotated[Array, F8, "N - 1"]
    left: Annotated[Array, F8, "N - 1", "m"]
    row_factor: Annotated[Array, F8, "N - 1", "m"]
    low: Annotated[Array, F8, "H", "n"]
    high: Annotated[Array, F8, "H", "n"]
    space: Space


load_plans = struct_loader(zeros(PlanArrays))


@in_place
def set_box(plans: PlanArrays, rows: RowArrays) -> None:
    """Write the bounds of all blocks; the current limits of the rows hold for the first block."""
    for k in range(plans.low.shape[0]):
        for j in range(plans.low.shape[1]):
            low = -plans.most[j]
            high = plans.most[j]
            if k == 0 and rows.qdd_max.size:
                low = min(max(low, rows.qdd_min[j]), rows.qdd_max[j])
                high = min(max(high, rows.qdd_min[j]), rows.qdd_max[j])
            plans.low[k, j] = low
            plans.high[k, j] = high


@in_place
def brake(plans: PlanArrays) -> None:
    """Plan to stop each joint as soon as its bounds allow."""
    H, n = plans.plan.shape
    for j in range(n):
        qd = plans.now[1 + n + j]
        for k in range(H):
            to_stop = -qd / plans.length
            plans.plan[k, j] = min(max(to_stop, plans.low[k, j]), plans.high[k, j])
            qd += plans.length * plans.plan[k, j]


@in_place
def carry_on(plans: PlanArrays) -> None:
    """Shift the last plan in time, by means over the new blocks; brake if there is no plan."""
    H, n = plans.plan.shape
    after = plans.now[0] - plans.made[0]
    if not 0.0 <= after < H * plans.length:
        brake(plans)
        return
    over = int(after / plans.length)
    into_block = after / plans.length - over
    for k in range(H):
        for j in range(n):
            old = k + over
            first = plans.plan[old, j] if old < H else plans.then[j]
            second = plans.plan[old + 1, j] if old + 1 < H else plans.then[j]
            mean = (1.0 - into_block) * first + into_block * second
            plans.plan[k, j] = min(max(mean, plans.low[k, j]), plans.high[k, j])


@in_place
def stopping_time(plans: PlanArrays) -> float:
    """Return the time [s] in which all joints can stop together after the plan.

    Return 0 if a joint that moves has no bound.
    """
    longest = 0.0
    free = False
    for j in range(plans.then.size):
        end = end_speed(plans, j)
        free |= plans.most[j] == math.inf and end != 0.0
        longest = max(longest, abs(end) / plans.most[j])
    return 0.0 if free else longest


@in_place
def end_speed(plans: PlanArrays, j: int) -> float:
    """Return the speed of a joint at the end of the plan."""
    qd: float = plans.now[1 + plans.then.size + j]
    for k in range(plans.plan.shape[0]):
        qd += plans.length * plans.plan[k, j]
    return qd


@in_place
def walk(plans: PlanArrays) -> int:
    """Write the states at all instants along the plan, and return their number."""
    H, n = plans.plan.shape
    N = plans.times.size - 1
    stop = stopping_time(plans)
    plans.times[N] = plans.times[N - 1] + stop
    plans.braking[0] = stop
    for k in range(H):
        follow_block(plans.length, plans.plan, plans.space.x, k, n)
    count = N + 1 if stop > 0.0 else N
    limits = limits_of(plans, count, plans.value[0])
    move(limits, plans.plan, plans.space.x, plans.space.moved)
    for t in range(count):
        brakes = t == N
        # displacement at the current speed: half as far while that is braked
        tau = plans.times[N - 1] + 0.5 * stop if brakes else plans.times[t]
        for j in range(n):
            q = plans.now[1 + j]
            qd = plans.now[1 + n + j]
            plans.states[0, t, j] = q + tau * qd + plans.space.moved[0, t, j]
            plans.states[1, t, j] = 0.0 if brakes else qd + plans.space.moved[1, t, j]
    plans.outcome[ASKED] = count
    return count


@in_place
def limits_of(plans: PlanArrays, count: int, scale: Array) -> Limits:
    """Return the limits at the first ``count`` instants."""
    return Limits(
        count,
        plans.block,
        plans.since,
        plans.braking[0],
        plans.value,
        plans.gradient,
        plans.by_speed,
        plans.falls,
        plans.left,
        plans.row_factor,
        scale,
        plans.low,
        plans.high,
    )


@in_place
def predict(plans: PlanArrays) -> int:
    """Evaluate the step along the plan.

    Return the number of states before the first that cannot be evaluated.
    """
    count = walk(plans)
    evaluate = load_step(plans.step).evaluate
    for t in range(count):
        time = plans.now[0] + (0.0 if plans.frozen else plans.times[t])
        arguments = (plans.step, time, plans.states[0, t], plans.states[1, t])
        if call_int_pointer(evaluate, arguments) != 0:
            return t
        copy_vector(plans.seen[t], plans.out)
    return count


@in_place
def linearise(plans: PlanArrays, count: int, rows: RowArrays, task: TaskArrays) -> None:
    """Write value and gradient of the rows along the plan.

    A row with K > 0 is linearised as σ(q), with ∂σ/∂q = L_gφ/K; a row on φ itself (``by_speed``) as
    φ(q̇), with ∂φ/∂q̇ = L_gφ. The plan so far has moved q or q̇ by ``space.moved`` at the instant t,
    and the row there is predicted to be x_t. With another plan, which moves it by Δ, the row is
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
        moved = plans.space.moved[1 if on_phi else 0]
        first = plans.seen[0, quantity]
        difference = current_value(plans, rows, i) - first
        drift = drift_while_fading(plans, rows, i, per_speed)
        for t in range(count):
            value = plans.seen[t, quantity] + difference
            if drift != 0.0:
                value -= drift * np.expm1(-plans.times[t] / plans.fading)
            for j in range(n):
                slope = per_speed * plans.seen[t, plans.at[GRADIENT] + i * n + j]
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
    N = plans.times.size - 1
    for t in range(count - 1):
        brakes = t + 1 == N
        interval = plans.times[t + 1] - plans.times[t]
        plans.falls[t] = 0.0 if brakes else np.exp(-interval / plans.approach)
        for i in range(m):
            plans.left[t, i] = 0.0
            if brakes:
                # a row violated now may return as slowly; the first state does not depend on the
                # plan
                remaining = np.exp(-plans.times[N] / plans.approach)
                outside = max(plans.value[0, i], 0.0) * remaining
                plans.left[t, i] = math.inf if plans.by_speed[i] else outside
            steepest = 0.0
            for j in range(plans.then.size):
                before = plans.falls[t] * abs(plans.gradient[t, i, j])
                steepest = max(steepest, abs(plans.gradient[t + 1, i, j]), before)
            plans.row_factor[t, i] = scale[i] / max(scale[i], ROW_SCALE_DISTANCE * steepest)


@in_place
def write_cost(plans: PlanArrays, count: int, task: TaskArrays) -> float:
    """Write the cost of the blocks that begin where the task is predicted; return λ.

    The residual of block k is J u − b with b as tracking with feedback demands it: another plan,
    which moves q by Δq and q̇ by Δq̇, has b − J (K_p Δq + K_v Δq̇), where b is the one without a plan.
    The prediction b_t includes the feedback of the plan so far, which ``space.moved`` removes. The
    cost holds ``square`` = JᵀJ and ``pull`` = Jᵀb, and :class:`.Cost` adds feedback by ``gains``.
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
    return plans.damping * (size if size > 0.0 else 1.0)


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
    for r in range(task.b.size):
        b = seen[t, at_b + r] + (task.b[r] - seen[0, at_b + r])
        for i in range(n):
            Ji = jacobian_entry(plans, task, t, r, i)
            total += Ji * Ji
            plans.pull[block, i] += Ji * b
            for j in range(n):
                plans.square[block, i, j] += Ji * jacobian_entry(plans, task, t, r, j)
    return total


@in_place
def add_feedback(plans: PlanArrays, task: TaskArrays, block: int, t: int) -> None:
    """Write K_p and K_v of a block, and remove their feedback of the plan so far from Jᵀb."""
    n = plans.plan.shape[1]
    squared = 0.0
    for r in range(task.b.size):
        squared += plans.seen[t, plans.at[ERROR] + r] ** 2
    Kp, Kv = gains(
        squared, plans.tracking[KP0], plans.tracking[KP_SLOPE], plans.tracking[KV_FACTOR]
    )
    plans.gains[block, 0] = Kp
    plans.gains[block, 1] = Kv
    for i in range(n):
        for j in range(n):
            feedback = Kp * plans.space.moved[0, t, j] + Kv * plans.space.moved[1, t, j]
            plans.pull[block, i] += plans.square[block, i, j] * feedback


@in_place
def add_rest(plans: PlanArrays, task: TaskArrays, block: int, t: int) -> None:
    """Write q̈₀ of a block without a plan, with its stiffness and damping."""
    damping = plans.tracking[REST_DAMPING]
    stiffness = plans.tracking[REST_STIFFNESS]
    plans.rest[block, 0] = stiffness
    plans.rest[block, 1] = damping
    at_rest = plans.at[REST]
    for j in range(plans.plan.shape[1]):
        free = task.rest[j]
        if at_rest >= 0:
            free += plans.seen[t, at_rest + j] - plans.seen[0, at_rest + j]
        feedback = stiffness * plans.space.moved[0, t, j] + damping * plans.space.moved[1, t, j]
        plans.free[block, j] = free + feedback


@in_place
def begin_of(plans: PlanArrays, block: int) -> int:
    """Return the instant at which a block begins, i.e. the end of the previous one."""
    # the first block contains one more instant, unless it is one period long
    first: int = plans.times.size - 2 - plans.plan.shape[0]
    return block + first if block > 0 else 0


@in_place
def mark_active(plans: PlanArrays, answer: Answer, active: int) -> None:
    """Mark the active rows of the plan, and report the number of active rows and bounds."""
    work = plans.space.work
    rows = plans.left.size
    most = 0.0
    answer.acted[:] = False
    for q in range(active):
        if plans.space.active[q] < rows + 2 * plans.plan.size:
            most = max(most, work[FORCE, q])
    plans.outcome[ACTIVE] = 0
    for q in range(active):
        row = plans.space.active[q]
        if row < rows + 2 * plans.plan.size and work[FORCE, q] > 0.0:
            plans.outcome[ACTIVE] += 1
            if row < rows and work[FORCE, q] > PULLING * most:
                answer.acted[row % plans.K.size] = True


@in_place
def store_plan(plans: PlanArrays) -> None:
    """Store the time of the plan and the acceleration after it."""
    stop = stopping_time(plans)
    plans.made[0] = plans.now[0]
    for j in range(plans.then.size):
        plans.then[j] = -end_speed(plans, j) / stop if stop > 0.0 else 0.0


@in_place
def decide(
    law: LawArrays, plans: PlanArrays, rows: RowArrays, task: TaskArrays, answer: Answer
) -> int:
    """Find the best plan where rows and task are predicted; write its first acceleration.

    Return the code of the law.
    """
    m = rows.phi.size
    qdd = answer.qdd
    count = plans.outcome[PREDICTED]
    answer.acted[:] = False
    answer.slack[:] = 0.0
    plans.outcome[CODE] = FAILED
    if count < 2:
        plans.made[0] = math.nan
        copy_vector(qdd, plans.plan[0])
        return FAILED
    linearise(plans, count, rows, task)
    limit(plans, count, rows.scale)
    damping = write_cost(plans, count, task)
    cost = Cost(
        plans.length, damping, plans.gains, plans.rest, plans.square, plans.pull, plans.free
    )
    limits = limits_of(plans, count, rows.scale)
    code, active = plan_best(cost, plans.factor, limits, plans.space, plans.weights)
    plans.outcome[CODE] = code
    planned = code in (SOLVED, RELAXED_ROWS)
    if planned:
        # the program meets the bounds only up to rounding
        for k in range(plans.low.shape[0]):
            for j in range(plans.low.shape[1]):
                plans.plan[k, j] = min(max(plans.space.u[k, j], plans.low[k, j]), plans.high[k, j])
    store_plan(plans)
    copy_vector(qdd, plans.plan[0])
    if not planned:
        return FAILED
    mark_active(plans, answer, active)
    unmet = 0.0
    for i in range(m):
        answer.slack[i] = plans.space.slack[i]
        unmet = max(unmet, answer.slack[i])
    if plans.outcome[ACTIVE] == 0 and unmet == 0.0:
        # no row is active: command exactly the unconstrained baseline, bit by bit
        follow_alone(law, task, answer)
    if count < plans.outcome[ASKED]:
        return FAILED
    return finished(law, rows, qdd, RELAXED_ROWS if unmet > 0.0 else SOLVED)


@compiled(RESOLVER, IN_PLACE, from_python=False)
def look_ahead(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.PredictiveControl`.

    Return ``FAILED`` if the written acceleration requires a message.
    """
    law = load_law(address)
    if not measurable(law, rows, task, answer):
        return NEEDS_PYTHON
    plans = load_plans(law.demand)
    stage = law.options[STAGE]
    if plans.loop != 0:
        start_from(plans.loop, plans.step, plans.now)
    if stage != CONCLUDE:
        set_box(plans, rows)
        if stage == BRAKE:
            brake(plans)
        else:
            carry_on(plans)
        if stage != ALL:
            walk(plans)
            return SOLVED
        count = predict(plans)
        if count < 2:
            brake(plans)
            count = predict(plans)
        plans.outcome[PREDICTED] = count
    return decide(law, plans, rows, task, answer)
