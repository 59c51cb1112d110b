"""Predictive safety filter, compiled.

It shifts the last plan in time, predicts rows and task along it, and finds the best plan there.
"""

from __future__ import annotations

import math

from ...compiled.codes import FAILED, FEWEST_INSTANTS, NEEDS_PYTHON, RELAXED_ROWS, SOLVED, STAGE
from ...compiled.compiler import IN_PLACE, compiled, in_place
from ...compiled.from_state import start_from
from ...compiled.laws import RESOLVER, load_law
from ...compiled.least_distance import FORCE
from ...compiled.linear import copy_vector
from ...compiled.parts import call_int_pointer, load_step
from ...compiled.resolving import finished, follow_alone, measurable
from ...compiled.workspace import Answer, LawArrays, RowArrays, TaskArrays
from ...rows.tolerances import PULLING
from .last_plan import brake, carry_on, in_box, set_box, store_end, walk
from .plan_arrays import QD, Cost, Q
from .plan_program import plan_best
from .predicted_program import limit, linearise, write_cost
from .predictive_arrays import (
    ACTIVE,
    ALL,
    ASKED,
    BRAKE,
    CODE,
    CONCLUDE,
    FOUND,
    PREDICTED,
    PlanArrays,
    limits_of,
    load_plans,
)


@in_place
def predict(plans: PlanArrays) -> int:
    """Evaluate the step along the plan.

    Return the number of states before the first that cannot be evaluated.
    """
    count = walk(plans)
    evaluate = load_step(plans.step).evaluate
    for t in range(count):
        later = 0.0 if plans.frozen else plans.times[t]
        arguments = (plans.step, plans.now[0] + later, plans.states[Q, t], plans.states[QD, t])
        if call_int_pointer(evaluate, arguments) != 0:
            return t
        copy_vector(plans.seen[t], plans.out)
    return count


@in_place
def mark_active(plans: PlanArrays, answer: Answer, active: int) -> None:
    """Mark the active rows of the plan, and report the number of active rows and bounds."""
    forces = plans.space.work[FORCE]
    rows = plans.left.size
    rows_and_bounds = rows + 2 * plans.plan.size
    greatest = 0.0
    answer.acted[:] = False
    for q in range(active):
        if plans.space.active[q] < rows_and_bounds:
            greatest = max(greatest, forces[q])
    plans.outcome[ACTIVE] = 0
    for q in range(active):
        row = plans.space.active[q]
        if row >= rows_and_bounds or not forces[q] > 0.0:
            continue
        plans.outcome[ACTIVE] += 1
        if row < rows and forces[q] > PULLING * greatest:
            answer.acted[row % plans.K.size] = True


@in_place
def adopt(plans: PlanArrays) -> None:
    """Make the plan that the program found the current one.

    The program meets the bounds only up to rounding.
    """
    H, n = plans.plan.shape
    plans.outcome[FOUND] = 1
    for k in range(H):
        for j in range(n):
            plans.plan[k, j] = in_box(plans, k, j, plans.space.u[k, j])


@in_place
def report_slack(plans: PlanArrays, answer: Answer) -> float:
    """Write the slack of each row to the answer, and return the greatest."""
    greatest = 0.0
    for i in range(answer.slack.size):
        slack = plans.space.slack[i]
        answer.slack[i] = slack
        greatest = max(greatest, slack)
    return greatest


@in_place
def decide(
    law: LawArrays, plans: PlanArrays, rows: RowArrays, task: TaskArrays, answer: Answer
) -> int:
    """Find the best plan where rows and task are predicted; write its first acceleration.

    Return the code of the law.
    """
    qdd = answer.qdd
    count = plans.outcome[PREDICTED]
    answer.acted[:] = False
    answer.slack[:] = 0.0
    plans.outcome[CODE] = FAILED
    if count < FEWEST_INSTANTS:
        plans.made[0] = math.nan
        copy_vector(qdd, plans.plan[0])
        return FAILED
    linearise(plans, count, rows)
    limit(plans, count, rows.scale)
    damping = write_cost(plans, count, task)
    cost = Cost(
        length=plans.length,
        damping=damping,
        gains=plans.gains,
        rest=plans.rest,
        square=plans.square,
        pull=plans.pull,
        free=plans.free,
    )
    limits = limits_of(plans, count, rows.scale)
    code, active = plan_best(cost, plans.factor, limits, plans.space, plans.weights)
    plans.outcome[CODE] = code
    is_planned = code in (SOLVED, RELAXED_ROWS)
    if is_planned:
        adopt(plans)
    store_end(plans)
    copy_vector(qdd, plans.plan[0])
    if not is_planned:
        return FAILED
    mark_active(plans, answer, active)
    unmet = report_slack(plans, answer)
    if plans.outcome[ACTIVE] == 0 and unmet == 0.0:
        # no row is active: command exactly the unconstrained baseline, bit by bit
        follow_alone(law, task, answer)
    if count < plans.outcome[ASKED]:
        return FAILED
    return finished(law, rows, qdd, RELAXED_ROWS if unmet > 0.0 else SOLVED)


@compiled(RESOLVER, IN_PLACE, from_python=False)
def look_ahead(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.PredictiveControl`.

    If Python predicts, the stages ``PROPOSE`` and ``BRAKE`` write only a plan and the states along
    it, and return ``SOLVED``; ``CONCLUDE`` computes the command. ``FAILED`` is returned if the
    written acceleration requires a message, ``NEEDS_PYTHON`` if a number is out of range.
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
        if count < FEWEST_INSTANTS:
            brake(plans)
            count = predict(plans)
        plans.outcome[PREDICTED] = count
    return decide(law, plans, rows, task, answer)
