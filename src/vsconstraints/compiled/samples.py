"""What a sample of a closed loop leaves: it is scored and kept, and the robot goes on.

Written once, in operations that compile: the compiled loop calls these functions compiled, any
other one as they are.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from ..formulas.limits import JointLimits, actuator_box, at_end, between
from ..formulas.motion import angle, reached
from ..formulas.tracking import goal_at
from ..rows import Array, BoolArray, IntArray
from .workspace import BOOL, F8, I8, Answer, RowArrays, TaskArrays

#: What comes in a sample: rows and task; the law; tracking alone; what is kept, and the robot's
#: motion.
STEP, LAW, ALONE, MOVE = range(4)
#: From which share of u⁺ on a row counts as slowed: less is what solvers' tolerances make.
NOTICED = 1e-3


class Goals(NamedTuple):
    """What is wanted: when each goal begins, its pixels and its pose, NaN where it has none, and
    its tolerance.

    That is distance [m], angle [rad], pixels and joints' speed; the first two count if ``by_pose``,
    and else the third.
    """

    begins: Annotated[Array, F8, "goals"]
    pixels: Annotated[Array, F8, "goals", "M", 2]
    R: Annotated[Array, F8, "goals", 3, 3]
    t: Annotated[Array, F8, "goals", 3]
    tolerance: Annotated[Array, F8, "goals", 4]
    by_pose: Annotated[BoolArray, BOOL, 1]


class PlantArrays(NamedTuple):
    """See :class:`vsconstraints.simulation.plant.Plant`: transition, state and scratch for it, and
    d_c (N or 1, n).

    ``limits`` are those of the actuators, (0,) each where there are none, and ``last`` is the
    command before.
    """

    transition: Annotated[Array, F8, "s", "s"]
    x: Annotated[Array, F8, "s", "n"]
    after: Annotated[Array, F8, "s", "n"]
    push: Annotated[Array, F8, "N", "n"]
    limits: JointLimits
    last: Annotated[Array, F8, "n"]


class Kept(NamedTuple):
    """Samples as :class:`vsconstraints.simulation.Trajectory` has them; shorter arrays are filled
    round and round.

    ``states`` are those of the plant at the beginning of each period. The camera's errors and
    poses, and the features' error, are kept for as long as it takes to detect rest, even where
    nothing else is.
    """

    states: Annotated[Array, F8, "N", "s", "n"]
    error: Annotated[Array, F8, "N", "k"]
    camera_error: Annotated[Array, F8, "poses", 2]
    feature_error: Annotated[Array, F8, "poses"]
    camera_R: Annotated[Array, F8, "poses", 3, 3]
    camera_t: Annotated[Array, F8, "poses", 3]
    pixels: Annotated[Array, F8, "N", "M", 2]
    points: Annotated[Array, F8, "N", "P", 3]
    phi: Annotated[Array, F8, "N", "m"]
    sigma: Annotated[Array, F8, "N", "m"]
    active: Annotated[BoolArray, BOOL, "N", "m"]
    saturated: Annotated[BoolArray, BOOL, "N"]
    rows_time: Annotated[Array, F8, "N"]
    step_time: Annotated[Array, F8, "N"]


class Running(NamedTuple):
    """Scores so far, for m rows and n joints."""

    phi_max: Annotated[Array, F8, "m"]
    sigma_max: Annotated[Array, F8, "m"]
    # samples with σ > 0, and in which the row acts; the first and the last of these, −1 if there is
    # none
    outside: Annotated[IntArray, I8, "m"]
    acted: Annotated[IntArray, I8, "m"]
    first_active: Annotated[IntArray, I8, "m"]
    last_active: Annotated[IntArray, I8, "m"]
    # consecutive samples with φ ≥ 0 until now, and the most of them
    positive: Annotated[IntArray, I8, "m"]
    longest_positive: Annotated[IntArray, I8, "m"]
    acceleration_max: Annotated[Array, F8, "n"]  # |q̈_c|
    # samples of the scenario's duration, which all laws share: in these alone Σ‖Δq̈_c‖, Σ‖Δq̈_c‖²
    # and changes of the set of acting rows are counted
    common: Annotated[IntArray, I8, 1]
    variation: Annotated[Array, F8, 1]
    squared_variation: Annotated[Array, F8, 1]
    switches: Annotated[IntArray, I8, 1]
    # last sample of each goal in which it is not reached; −1 if none
    unreached: Annotated[IntArray, I8, "goals"]
    # samples in which the command is at a limit of the actuators
    saturated: Annotated[IntArray, I8, 1]
    # L_fφ / Σⱼ|L_gφⱼ|aⱼ where φ first comes to zero; NaN before
    share_to_hold: Annotated[Array, F8, "m"]
    # of the last sample
    active: Annotated[BoolArray, BOOL, "m"]
    qdd: Annotated[Array, F8, "n"]


class Loop(NamedTuple):
    """A closed loop.

    ``parts`` are addresses: of the function that evaluates a step, of the believed step, of the
    true one, of the law, of tracking. Where one is 0, Python does it. Then of the function that
    writes measurements to the believed step, or 0 where it knows all, and of its workspace;
    likewise of the function that moves a plant without a transition. ``clock`` is (0,) where nobody
    asks how long steps take. ``rows``, ``task`` and ``answer`` are the law's; its q̈ is the plant's
    command. ``alone`` is q̈ of tracking, ``true`` to ``camera_t`` what is true.
    """

    parts: Annotated[IntArray, I8, 9]
    Ts: Annotated[Array, F8, 1]
    clock: Annotated[IntArray, I8, 2]
    rows: RowArrays
    task: TaskArrays
    answer: Answer
    alone: Annotated[Array, F8, "n"]
    true: RowArrays
    pixels: Annotated[Array, F8, "M", 2]
    points: Annotated[Array, F8, "P", 3]
    camera_R: Annotated[Array, F8, 3, 3]
    camera_t: Annotated[Array, F8, 3]
    goals: Goals
    plant: PlantArrays
    kept: Kept
    scores: Running


def put(numbers: Array, out: Array) -> None:
    """Copy an array to another one of the same shape, number by number: that needs no memory."""
    for i in range(numbers.size):
        out.flat[i] = numbers.flat[i]


def hold(transition: Array, x: Array, after: Array) -> None:
    """Set x ← transition x: the state (s, n) at a period's end, from that at its beginning.
    ``after`` is scratch.
    """
    s, n = x.shape
    for i in range(s):
        for j in range(n):
            total = 0.0
            for k in range(s):
                total += transition[i, k] * x[k, j]
            after[i, j] = total
    put(after, x)


def saturate(plant: PlantArrays, qdd: Array, alone: Array) -> bool:
    """Bring the command (n,) to what the actuators have after the last one; whether a joint is at a
    limit of its.

    So they would bring what tracking commands ``alone`` (n,).
    """
    given = plant.limits
    saturated = False
    for j in range(len(given.acceleration)):
        limits = JointLimits(given.acceleration[j], given.change[j], 0.0, 0.0, 0.0, 0, given.period)
        least, greatest = actuator_box(plant.last[j], limits)
        qdd[j], alone[j] = between(qdd[j], least, greatest), between(alone[j], least, greatest)
        saturated = saturated or at_end(qdd[j], least, greatest)
    for j in range(len(qdd)):
        plant.last[j] = qdd[j]
    return saturated


def judge_contact(loop: Loop) -> None:
    """Where a row first comes to φ = 0, or tracking alone brings it there within the period: what
    holding it takes.

    q̈ with |q̈ⱼ| ≤ aⱼ changes φ̇ = L_fφ + L_gφ q̈ by up to Σⱼ|L_gφⱼ|aⱼ: L_fφ above that is more
    than any law can hold.
    """
    rows = loop.true
    limits = loop.plant.limits
    shares = loop.scores.share_to_hold
    for i in range(len(shares) if len(limits.acceleration) else 0):
        if not math.isnan(shares[i]):
            continue
        rate = rows.Lf[i]
        most = 0.0
        for j in range(len(loop.alone)):
            rate += rows.Lg[i, j] * loop.alone[j]
        if max(rows.phi[i], rows.phi[i] + loop.Ts[0] * rate) >= 0.0:
            for j in range(len(loop.alone)):
                most += abs(rows.Lg[i, j]) * limits.acceleration[j] if rows.Lg[i, j] != 0.0 else 0.0
            shares[i] = rows.Lf[i] / most if most > 0.0 else math.copysign(math.inf, rows.Lf[i])


def mark_acting(rows: RowArrays, qdd: Array, alone: Array, active: BoolArray) -> None:
    """Say of rows whether they act: whether they hold the arm back.

    Their φ is slowed: q̈ (n,) makes it rise by less than tracking ``alone`` (n,) would, from the
    same state. What slows one row slows others as well. Of the slowed rows, those with φ ≥ 0 act;
    where there is none, the one nearest to it.
    """
    nearest = -math.inf
    joints = 0
    for j in range(len(qdd)):
        # most often the two are the same
        joints = joints if qdd[j] == alone[j] else len(qdd)
    for i in range(len(active)):
        slowed = 0.0
        for j in range(joints):
            slowed += rows.Lg[i, j] * (alone[j] - qdd[j])
        active[i] = slowed > NOTICED * rows.switching_gain[i]
        if active[i]:
            nearest = max(nearest, min(rows.phi[i], 0.0) / rows.scale[i])
    for i in range(len(active)):
        active[i] = active[i] and min(rows.phi[i], 0.0) / rows.scale[i] >= nearest


def camera_error(R: Array, t: Array, wanted_R: Array, wanted_t: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses."""
    turned = moved = 0.0
    for i in range(3):
        moved += (t[i] - wanted_t[i]) ** 2
        for j in range(3):
            turned += (R[i, j] - wanted_R[i, j]) ** 2
    return math.sqrt(moved), angle(turned)


def feature_error(pixels: Array, wanted: Array) -> float:
    """Greatest distance of a marker (M, 2) from where it is wanted [px]."""
    greatest = 0.0
    for i in range(len(pixels)):
        du = pixels[i, 0] - wanted[i, 0]
        dv = pixels[i, 1] - wanted[i, 1]
        greatest = max(greatest, du * du + dv * dv)
    return math.sqrt(greatest)


def fastest(qd: Array) -> float:
    """Greatest |q̇ⱼ| of any joint."""
    greatest = 0.0
    for j in range(len(qd)):
        greatest = max(greatest, abs(qd[j]))
    return greatest


def score(scores: Running, rows: RowArrays, qdd: Array, active: BoolArray, k: int) -> None:
    """Score sample k: its rows, q̈_c (n,), and which rows act (m,)."""
    squared = 0.0
    changed = False
    for j in range(len(qdd)):
        squared += (qdd[j] - scores.qdd[j]) ** 2
        scores.acceleration_max[j] = max(scores.acceleration_max[j], abs(qdd[j]))
        scores.qdd[j] = qdd[j]
    for i in range(len(active)):
        scores.phi_max[i] = max(scores.phi_max[i], rows.phi[i])
        scores.sigma_max[i] = max(scores.sigma_max[i], rows.sigma[i])
        scores.outside[i] += rows.sigma[i] > 0.0
        scores.positive[i] = scores.positive[i] + 1 if rows.phi[i] >= 0.0 else 0
        scores.longest_positive[i] = max(scores.longest_positive[i], scores.positive[i])
        changed = changed or active[i] != scores.active[i]
        scores.active[i] = active[i]
        if active[i]:
            scores.acted[i] += 1
            scores.last_active[i] = k
            if scores.first_active[i] < 0:
                scores.first_active[i] = k
    if 0 < k < scores.common[0]:
        scores.variation[0] += math.sqrt(squared)
        scores.squared_variation[0] += squared
        scores.switches[0] += changed


def finish(loop: Loop, k: int) -> None:
    """Score and keep sample k, and take the robot to the end of its period."""
    kept = loop.kept
    true = loop.true
    goals = loop.goals
    x = loop.plant.x
    push = loop.plant.push
    at = k % len(kept.states)
    camera = k % len(kept.camera_t)
    goal = goal_at(goals.begins, k * loop.Ts[0])
    distance, turn = camera_error(loop.camera_R, loop.camera_t, goals.R[goal], goals.t[goal])
    away = feature_error(loop.pixels, goals.pixels[goal])
    kept.camera_error[camera, 0] = distance
    kept.camera_error[camera, 1] = turn
    kept.feature_error[camera] = away
    if not reached(distance, turn, away, fastest(x[1]), goals.tolerance[goal], goals.by_pose[0]):
        loop.scores.unreached[goal] = k
    kept.saturated[at] = saturate(loop.plant, loop.answer.qdd, loop.alone)
    loop.scores.saturated[0] += kept.saturated[at]
    judge_contact(loop)
    mark_acting(true, loop.answer.qdd, loop.alone, kept.active[at])
    score(loop.scores, true, loop.answer.qdd, kept.active[at], k)
    for j in range(x.shape[1]):
        x[-1, j] = push[k % len(push), j]
    put(x, kept.states[at])
    put(loop.task.error, kept.error[at])
    put(loop.camera_R, kept.camera_R[camera])
    put(loop.camera_t, kept.camera_t[camera])
    put(loop.pixels, kept.pixels[at])
    put(loop.points, kept.points[at])
    put(true.phi, kept.phi[at])
    put(true.sigma, kept.sigma[at])
    hold(loop.plant.transition, x, loop.plant.after)
