"""Goal governor, compiled: predicted response to a fixed reference, and moves of the reference."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ..formulas.tracking import JUST_BEFORE, gains, held_gains, held_rest, retargeted
from ..rows import Array, IntArray
from .compiler import IN_PLACE, compiled, in_place
from .from_state import start_from
from .laws import RESOLVER, load_law, share_without_baseline
from .linear import copy_vector
from .parts import call_int_pointer, load_step, share, struct_loader
from .resolving import valid
from .workspace import (
    F8,
    I8,
    KP0,
    KP_SLOPE,
    KV_FACTOR,
    NEEDS_PYTHON,
    REST_DAMPING,
    REST_STIFFNESS,
    SOLVED,
    STAGE,
    TOLERANCE,
    Answer,
    LawArrays,
    RowArrays,
    TaskArrays,
    zeros,
)

#: Entries of ``counts``: goal of the reference (−1 before the first sample), current goal, 1 if a
#: moved reference is being tested, and next state to evaluate (−1 if none).
GOAL, PRESENT, MOVES, NEXT, COUNTS = range(5)
#: Entries of ``times``: end of the goal, previous sample and predicted state [s]; ∞ if a response
#: is known, −∞ if none is.
UNTIL, LAST, AHEAD, KNOWN, TIMES = range(5)
#: Entries of ``settings``: v, δ and ζ; α and κ of a barrier, α = 0 if there is none.
SPEED, MARGIN, INFLUENCE, ALPHA, SHARPNESS, SETTINGS = range(6)
#: Stages of a law (option 1). If Python predicts, it requests one at a time.
ALL, BEGIN, GO_ON, LOST, CONCLUDE = range(5)
#: The attraction of the goal decreases where the reference is within ``speed`` times this of it
#: [s].
SETTLING = 0.1
NEWTON = 2  #: Newton steps from the end of a response to its state of rest.
#: Weight in the softmin, relative to the nearest row's, below which a row's gradient is omitted.
NEGLIGIBLE = 1e-6


class GovernorArrays(NamedTuple):
    """Arrays of a goal governor: k features, n joints, m rows, N predicted accelerations."""

    #: Addresses of the step in the loop and of the predicting step, 0 if Python predicts; and of
    #: the underlying law, 0 if Python calls it. ``frozen``: 1 if everything is predicted at the
    #: current time.
    loop: int
    step: int
    law: int
    frozen: int
    settings: Annotated[Array, F8, SETTINGS]
    tracking: Annotated[Array, F8, 5]  #: K_p(0), its slope, K_v/√K_p; d and (d/2)² of q̈₀.
    K: Annotated[Array, F8, "m"]  #: K of the rows, 0 for rows that give φ itself.
    periods: Annotated[Array, F8, "N"]  #: Duration of each acceleration [s].
    now: Annotated[Array, F8, "1 + 2n"]  #: t, q, q̇.
    times: Annotated[Array, F8, TIMES]
    counts: Annotated[IntArray, I8, COUNTS]
    #: s_ref minus the feature's value at the goal, and a candidate reference; b and error of the
    #: task whose goal is at the reference.
    reference: Annotated[Array, F8, "k"]
    trial: Annotated[Array, F8, "k"]
    b: Annotated[Array, F8, "k"]
    error: Annotated[Array, F8, "k"]
    state: Annotated[Array, F8, 3, "n"]  #: Predicted q and q̇, and scratch.
    rest: Annotated[Array, F8, "n"]  #: Scratch.
    #: Response: the least −σ of each row on the way and at rest; σ, L_gφ and Jᵀ at rest. σ is
    #: divided by the row's scale.
    least: Annotated[Array, F8, "m"]
    sigma: Annotated[Array, F8, "m"]
    Lg: Annotated[Array, F8, "m", "n"]
    Jt: Annotated[Array, F8, "n", "k"]
    #: Barrier: ∂s/∂s_ref and ∂ṡ/∂s_ref at the predicted state; at each row's nearest state, Jᵀ and
    #: Jᵀ (∂σ/∂s_ref)ᵀ.
    rise: Annotated[Array, F8, 2]
    nearest_Jt: Annotated[Array, F8, "m", "n", "k"]
    slope: Annotated[Array, F8, "m", "n"]
    #: Task whose goal is at the reference, and the answer of the underlying law to it.
    moved: TaskArrays
    answer: Answer


load_governor = struct_loader(zeros(GovernorArrays))


@in_place
def nearest(own: GovernorArrays) -> float:
    """Return D, the least distance of the response to any row."""
    least: float = own.times[KNOWN]
    for i in range(own.least.size):
        least = min(least, own.least[i])
    return least


@in_place
def hold_back(own: GovernorArrays, law: LawArrays, period: float) -> None:
    """Change the candidate reference by as little as the barrier requires, within the speed limit.

    The barrier requires ∇h (s_trial − s_ref) ≥ −α h T.
    """
    gradient = own.b
    one = own.error
    r = own.reference
    least = nearest(own)
    speed = own.settings[SPEED]
    total = along = squared = length = gradient[:] = 0.0
    for i in range(own.least.size):
        weight = np.exp(-own.settings[SHARPNESS] * (own.least[i] - least))
        total += weight
        if weight > NEGLIGIBLE:
            Jt = own.nearest_Jt[i]
            slope = own.slope[i]
            call_int_pointer(
                law.track, (law.scratch, Jt, slope, law.options[TOLERANCE], own.rest[:0], one)
            )
            for j in range(r.size):
                gradient[j] -= weight * one[j]
    for j in range(r.size if total > 0.0 else 0):
        gradient[j] /= total
        along += gradient[j] * (own.trial[j] - r[j])
        squared += gradient[j] * gradient[j]
    if squared > 0.0:
        h = least - own.settings[MARGIN] - np.log(total) / own.settings[SHARPNESS]
        share = max(-own.settings[ALPHA] * h * period - along, 0.0) / squared
        for j in range(r.size):
            own.trial[j] += share * gradient[j]
            length += (own.trial[j] - r[j]) ** 2
        for j in range(r.size if np.sqrt(length) > period * speed else 0):
            own.trial[j] = r[j] + (own.trial[j] - r[j]) * period * speed / np.sqrt(length)


@in_place
def move(own: GovernorArrays, law: LawArrays, period: float) -> None:
    """Write the candidate reference after a period [s].

    It is moved by v Δ ρ or, with a barrier, by the part of v a that the barrier allows.
    """
    r = own.reference
    outwards = own.error
    influence = own.settings[INFLUENCE]
    squared = 0.0
    margin = own.settings[MARGIN]
    speed = own.settings[SPEED]
    step = period * speed * min(max((nearest(own) - margin) / (influence - margin), 0.0), 1.0)
    barrier = own.settings[ALPHA] > 0.0
    step = period * speed if barrier and nearest(own) > -math.inf else step
    copy_vector(own.trial, r)
    own.counts[MOVES] = 0
    for i in range(r.size):
        squared += r[i] * r[i]
    size = max(np.sqrt(squared), SETTLING * speed)
    strength = step * np.sqrt(squared) / size / (influence - margin)
    for i in range(r.size):
        own.trial[i] -= step * r[i] / size
    if barrier and step > 0.0:
        hold_back(own, law, period)
    for i in range(own.sigma.size if step > 0.0 and not barrier else 0):
        if not (-own.sigma[i] < influence and own.K[i] > 0.0):
            continue
        # ∇sσ for the smallest joint motion that moves the feature in this way
        call_int_pointer(
            law.track,
            (law.scratch, own.Jt, own.Lg[i], law.options[TOLERANCE], own.rest[:0], outwards),
        )
        squared = 0.0
        for j in range(r.size):
            squared += outwards[j] * outwards[j]
        share = strength * (influence + own.sigma[i]) / np.sqrt(squared) if squared > 0.0 else 0.0
        for j in range(r.size):
            own.trial[j] -= share * outwards[j]
    for i in range(r.size):
        own.counts[MOVES] |= own.trial[i] != r[i]


@in_place
def start(own: GovernorArrays) -> None:
    """Begin to predict the response to the candidate reference from the current state."""
    if own.loop != 0:
        start_from(own.loop, own.step, own.now)
    copy_vector(own.state[0], own.now[1:])
    copy_vector(own.state[1], own.now[1 + own.rest.size :])
    own.times[AHEAD] = own.now[0]
    own.times[KNOWN] = math.inf
    own.counts[NEXT] = 0
    own.least[:] = math.inf
    own.rise[:] = 0.0


@in_place
def aim(
    own: GovernorArrays, task: TaskArrays, reference: Array, h: float
) -> tuple[float, float, float]:
    """Write error and b of the task whose goal is at the reference; return K_p, K_v and h.

    q̈ is held for h [s].
    """
    far = near = 0.0
    for i in range(own.b.size):
        own.error[i] = task.error[i] - reference[i]
        far += task.error[i] * task.error[i]
        near += own.error[i] * own.error[i]
    now = gains(far, own.tracking[KP0], own.tracking[KP_SLOPE], own.tracking[KV_FACTOR])
    Kp, Kv = gains(near, own.tracking[KP0], own.tracking[KP_SLOPE], own.tracking[KV_FACTOR])
    # with a barrier the reference may be far away, and far goals are tracked more slowly
    h *= np.sqrt(own.tracking[KP0] / Kp) if own.settings[ALPHA] > 0.0 else 1.0
    then = held_gains(Kp, Kv, h)
    for i in range(own.b.size):
        own.b[i] = retargeted(task.b[i], task.error[i], task.error_rate[i], reference[i], now, then)
    return then[0], then[1], h


@in_place
def note_slope(own: GovernorArrays, i: int, rows: RowArrays, task: TaskArrays) -> None:
    """Write the dependence of a row's σ on s_ref at the nearest state so far.

    ``rise`` contains ∂s/∂s_ref and ∂ṡ/∂s_ref, and L_gφ = K ∂σ/∂q.
    """
    share = own.rise[0] / own.K[i] if own.K[i] > 0.0 else own.rise[1]
    for j in range(own.slope.shape[1]):
        own.slope[i, j] = share * rows.Lg[i, j] / rows.scale[i]
        for row in range(own.b.size):
            own.nearest_Jt[i, j, row] = task.J[row, j]


@in_place
def advance(own: GovernorArrays, law: LawArrays, rows: RowArrays, task: TaskArrays) -> None:
    """Take rows and task at a predicted state, and write the next state, if any.

    q̈ is that of eq. (42), held for a period.
    """
    k = own.counts[NEXT]
    N = own.periods.size
    q = own.state[0]
    qd = own.state[1]
    qdd = own.state[2]
    n = q.size
    at_rest = k == N + NEWTON
    if 0 < k <= N or at_rest:
        for i in range(own.least.size):
            own.sigma[i] = rows.sigma[i] / rows.scale[i]
            if own.settings[ALPHA] > 0.0 and -own.sigma[i] < own.least[i]:
                note_slope(own, i, rows, task)
            own.least[i] = min(own.least[i], -own.sigma[i])
    if at_rest:
        for j in range(n):
            for i in range(own.b.size):
                own.Jt[j, i] = task.J[i, j]
            for i in range(own.least.size):
                own.Lg[i, j] = rows.Lg[i, j]
        own.counts[NEXT] = -1
        return
    h = own.periods[min(k, N - 1)]
    rest = own.rest[: task.rest.size if k < N else 0]
    Kp, Kv, h = aim(own, task, own.trial, h)
    for i in range(own.b.size if k >= N else 0):
        own.b[i] = -own.error[i]
    for j in range(rest.size):
        rest[j] = held_rest(
            task.rest[j], qd[j], own.tracking[REST_DAMPING], own.tracking[REST_STIFFNESS], h
        )
    call_int_pointer(law.track, (law.scratch, task.J, own.b, law.options[TOLERANCE], rest, qdd))
    for j in range(n):
        q[j] += h * (qd[j] + 0.5 * h * qdd[j]) if k < N else qdd[j]
        qd[j] = qd[j] + h * qdd[j] if k < N else 0.0
    if k < N:
        own.times[AHEAD] = min(own.times[AHEAD] + h, own.times[UNTIL])
        rise = own.rise[0]
        rate = own.rise[1]
        bend = Kp * (1.0 - rise) - Kv * rate
        own.rise[0] = rise + h * (rate + 0.5 * h * bend)
        own.rise[1] = rate + h * bend
    else:
        own.rise[0] = 1.0
        own.rise[1] = 0.0
    own.counts[NEXT] = k + 1


@in_place
def go_on(
    own: GovernorArrays, law: LawArrays, found: bool, rows: RowArrays, task: TaskArrays
) -> None:
    """Continue with rows and task at a predicted state, if they are found there.

    A moved reference that is not acceptable is discarded.
    """
    counts = own.counts
    acceptable = found
    if found:
        advance(own, law, rows, task)
        acceptable = not counts[MOVES] or nearest(own) >= 0.5 * own.settings[MARGIN]
    if counts[MOVES] and not acceptable:
        counts[MOVES] = 0
        copy_vector(own.trial, own.reference)
        start(own)
    elif not found:
        own.times[KNOWN] = -math.inf
        counts[NEXT] = -1
    elif counts[NEXT] < 0:
        copy_vector(own.reference, own.trial)


@in_place
def fits(own: GovernorArrays, rows: RowArrays, task: TaskArrays) -> bool:
    """True if rows and task have the governor's sizes."""
    m, n = own.Lg.shape
    k = own.b.size
    right = rows.Lg.shape[0] == m and rows.Lg.shape[1] == n and rows.scale.size == m
    right &= task.J.shape[0] == k and task.J.shape[1] == n and task.b.size == k
    return (
        right
        and task.error.size == k
        and task.error_rate.size == k
        and (task.rest.size == 0 or task.rest.size == n)
    )


@compiled(RESOLVER, IN_PLACE, from_python=False)
def govern(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.GoalGovernor`.

    Return the code of the underlying law, if that is compiled. With the governor's own
    ``NEEDS_PYTHON`` nothing is stored. A second call at the same time makes the same decision.
    """
    law = load_law(address)
    own = load_governor(law.demand)
    stage = law.options[STAGE]
    counts = own.counts
    times = own.times
    if not fits(own, rows, task) or (own.law != 0 and not valid(law, rows, task, answer)):
        return NEEDS_PYTHON
    law.scratch.taken[0] = 0
    if stage in (ALL, BEGIN):
        if own.loop != 0:
            step = load_step(own.loop)
            counts[PRESENT], own.now[0], following = (
                step.last[0].goal,
                step.time[0],
                step.last[0].goal + 1,
            )
            until = (
                step.goals[following].from_time - JUST_BEFORE
                if following < len(step.goals)
                else math.inf
            )
            times[UNTIL] = own.now[0] if own.frozen else until
        if counts[GOAL] < 0:
            counts[GOAL], times[LAST] = counts[PRESENT], own.now[0]
            copy_vector(own.reference, task.error)
        # Python expresses the reference relative to another goal
        if counts[GOAL] != counts[PRESENT]:
            return NEEDS_PYTHON
        move(own, law, max(own.now[0] - times[LAST], 0.0))
        times[LAST] = own.now[0]
        start(own)
    if stage == ALL:
        step = load_step(own.step)
        if not fits(own, step.rows, step.task):
            return NEEDS_PYTHON
        while counts[NEXT] >= 0:
            state = own.step, times[AHEAD], own.state[0], own.state[1]
            go_on(own, law, call_int_pointer(step.evaluate, state) == 0, step.rows, step.task)
    elif stage in (GO_ON, LOST):
        go_on(own, law, stage == GO_ON and rows.sigma.size == own.sigma.size, rows, task)
    if stage in (ALL, CONCLUDE):
        aim(own, task, own.reference, 0.0)
        if own.law != 0:
            share(own.moved, (task.J, own.b, own.error, task.error_rate, task.rest))
            # the unconstrained baseline is not the command of the moved task
            share_without_baseline(own.answer, answer)
            resolver = load_law(own.law).resolver
            return call_int_pointer(resolver, (own.law, rows, own.moved, own.answer))
    return SOLVED
