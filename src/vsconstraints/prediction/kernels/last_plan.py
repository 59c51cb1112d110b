"""Plan of the last sample, carried over to the current one, and the states along it, compiled."""

from __future__ import annotations

import math

from ...compiled.compiler import in_place
from ...compiled.laws import within
from ...compiled.linear import clip
from ...compiled.workspace import RowArrays
from .plan_arrays import QD, Q
from .plan_cost import follow_block
from .plan_rows import move
from .predictive_arrays import ASKED, FOUND, PlanArrays, limits_of


@in_place
def set_box(plans: PlanArrays, rows: RowArrays) -> None:
    """Write the bounds of all blocks; the current limits of the rows hold for the first block."""
    for k in range(plans.low.shape[0]):
        for j in range(plans.low.shape[1]):
            low = -plans.most[j]
            high = plans.most[j]
            if k == 0:
                low = within(rows, j, low)
                high = within(rows, j, high)
            plans.low[k, j] = low
            plans.high[k, j] = high


@in_place
def in_box(plans: PlanArrays, k: int, j: int, qdd: float) -> float:
    """Return the acceleration of joint j in block k nearest to q̈ within the bounds."""
    nearest: float = clip(qdd, plans.low[k, j], plans.high[k, j])
    return nearest


@in_place
def brake(plans: PlanArrays) -> None:
    """Plan to stop each joint as soon as its bounds allow."""
    H, n = plans.plan.shape
    plans.outcome[FOUND] = 0
    for j in range(n):
        qd = plans.now[1 + n + j]
        for k in range(H):
            to_stop = -qd / plans.length
            qdd = in_box(plans, k, j, to_stop)
            plans.plan[k, j] = qdd
            qd += plans.length * qdd


@in_place
def carry_on(plans: PlanArrays) -> None:
    """Shift the last plan in time; brake if there is no plan.

    Each new block overlaps two old ones. Its acceleration is the mean of theirs, weighted by the
    overlap.
    """
    H, n = plans.plan.shape
    after = plans.now[0] - plans.made[0]
    if not 0.0 <= after < H * plans.length:
        brake(plans)
        return
    over = int(after / plans.length)
    into_block = after / plans.length - over
    for k in range(H):
        old = k + over
        for j in range(n):
            first = planned(plans, old, j)
            second = planned(plans, old + 1, j)
            mean = (1.0 - into_block) * first + into_block * second
            plans.plan[k, j] = in_box(plans, k, j, mean)


@in_place
def planned(plans: PlanArrays, k: int, j: int) -> float:
    """Return the acceleration of joint j in block k of the plan, or after its end."""
    qdd: float = plans.plan[k, j] if k < plans.plan.shape[0] else plans.then[j]
    return qdd


@in_place
def stopping_time(plans: PlanArrays) -> float:
    """Return the time [s] in which all joints can stop together after the plan.

    Return 0 if a joint that moves has no bound.
    """
    longest = 0.0
    can_stop = True
    for j in range(plans.then.size):
        most = plans.most[j]
        end = end_speed(plans, j)
        if most == math.inf and end != 0.0:
            can_stop = False
        longest = max(longest, abs(end) / most)
    return longest if can_stop else 0.0


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
    x = plans.space.x
    moved = plans.space.moved
    states = plans.states
    at_stop = plans.times.size - 1  # the instant at the end of the brake
    stop = stopping_time(plans)
    end_of_plan = plans.times[at_stop - 1]
    plans.times[at_stop] = end_of_plan + stop
    plans.braking[0] = stop
    for k in range(H):
        follow_block(plans.length, plans.plan, x, k, n)
    count = at_stop + 1 if stop > 0.0 else at_stop
    limits = limits_of(plans, count, plans.value[0])
    move(limits, plans.plan, x, moved)
    for t in range(count):
        brakes = t == at_stop
        # displacement at the current speed: half as far while that is braked
        tau = end_of_plan + 0.5 * stop if brakes else plans.times[t]
        for j in range(n):
            q = plans.now[1 + j]
            qd = plans.now[1 + n + j]
            states[Q, t, j] = q + tau * qd + moved[Q, t, j]
            states[QD, t, j] = 0.0 if brakes else qd + moved[QD, t, j]
    plans.outcome[ASKED] = count
    return count


@in_place
def store_end(plans: PlanArrays) -> None:
    """Store the time at which the plan is made, and the acceleration after it."""
    stop = stopping_time(plans)
    plans.made[0] = plans.now[0]
    for j in range(plans.then.size):
        plans.then[j] = -end_speed(plans, j) / stop if stop > 0.0 else 0.0
