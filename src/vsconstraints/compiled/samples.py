"""Scores and records of a sample of a closed loop, and the motion of the robot after it.

The functions use only operations that compile. The compiled loop calls them compiled, other loops
call them in Python.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ..formulas.limits import JointLimits, actuator_box, at_end, between
from ..formulas.motion import pose_difference, reached
from ..formulas.tracking import goal_at
from ..rows import Array, BoolArray, IntArray
from .compiler import in_place
from .linear import largest_magnitude
from .records import LOOP_PARTS, Records
from .workspace import Answer, RowArrays, TaskArrays

#: Stages of a sample: rows and task; the law; the unconstrained baseline; records and the robot's
#: motion.
STEP, LAW, ALONE, MOVE = range(4)
#: Share of u⁺ from which on a row counts as slowed. Smaller values are within solvers' tolerances.
NOTICED = 1e-3


class Goals(NamedTuple):
    """Start time, pixels and pose of each goal (NaN where it has none), and its tolerance.

    The tolerance is distance [m], angle [rad], pixels and joint speed. The first two count if
    ``by_pose``, otherwise the third.
    """

    begins: Annotated[Array, "goals"]
    pixels: Annotated[Array, "goals M 2"]
    R: Annotated[Array, "goals 3 3"]
    t: Annotated[Array, "goals 3"]
    tolerance: Annotated[Array, "goals 4"]
    by_pose: Annotated[BoolArray, "1"]


class PlantArrays(NamedTuple):
    """Arrays of a plant: transition, state, scratch, d_c (N or 1, n), limits and last command.

    See :class:`vsconstraints.simulation.plant.Plant`. ``limits`` are those of the actuators, (0,)
    each if there are none. ``last`` is the previous command. The speeds from which the arm goes to
    commanded ones are the sum of the rows of a state, ``of_speeds``, by their ``speed_weights``.
    """

    transition: Annotated[Array, "s s"]
    x: Annotated[Array, "s n"]
    after: Annotated[Array, "s n"]
    push: Annotated[Array, "N n"]
    limits: JointLimits
    last: Annotated[Array, "n"]
    speed_weights: Annotated[Array, "r"]
    of_speeds: Annotated[Array, "r n"]


class Kept(NamedTuple):
    """Recorded samples, with the fields of :class:`vsconstraints.simulation.Trajectory`.

    Shorter arrays are ring buffers. ``states`` are those of the plant at the beginning of each
    period. The camera's errors and poses, and the features' error, are recorded for as long as it
    takes to detect rest, even if no other field is recorded.
    """

    states: Annotated[Array, "N s n"]
    error: Annotated[Array, "N k"]
    camera_error: Annotated[Array, "poses 2"]
    feature_error: Annotated[Array, "poses"]
    camera_R: Annotated[Array, "poses 3 3"]
    camera_t: Annotated[Array, "poses 3"]
    pixels: Annotated[Array, "N M 2"]
    points: Annotated[Array, "N P 3"]
    phi: Annotated[Array, "N m"]
    sigma: Annotated[Array, "N m"]
    active: Annotated[BoolArray, "N m"]
    saturated: Annotated[BoolArray, "N"]
    rows_time: Annotated[Array, "N"]
    step_time: Annotated[Array, "N"]


class Running(NamedTuple):
    """Scores so far, for m rows and n joints."""

    phi_max: Annotated[Array, "m"]
    sigma_max: Annotated[Array, "m"]
    # samples with σ > 0; samples in which the row is active; the first and the last of these, −1 if
    # none
    outside: Annotated[IntArray, "m"]
    acted: Annotated[IntArray, "m"]
    first_active: Annotated[IntArray, "m"]
    last_active: Annotated[IntArray, "m"]
    # current and greatest number of consecutive samples with φ ≥ 0
    positive: Annotated[IntArray, "m"]
    longest_positive: Annotated[IntArray, "m"]
    acceleration_max: Annotated[Array, "n"]  # |q̈_c|
    # samples of the scenario's duration, which is common to all laws; only in these Σ‖Δq̈_c‖,
    # Σ‖Δq̈_c‖² and changes of the set of active rows are counted
    common: Annotated[IntArray, "1"]
    variation: Annotated[Array, "1"]
    squared_variation: Annotated[Array, "1"]
    switches: Annotated[IntArray, "1"]
    # last sample of each goal in which it is not reached; −1 if none
    unreached: Annotated[IntArray, "goals"]
    # samples in which the command is at a limit of the actuators
    saturated: Annotated[IntArray, "1"]
    # L_fφ / Σⱼ|L_gφⱼ|aⱼ when φ first reaches zero; NaN before
    share_to_hold: Annotated[Array, "m"]
    # values of the last sample
    active: Annotated[BoolArray, "m"]
    qdd: Annotated[Array, "n"]


class Loop(NamedTuple):
    """Arrays of a closed loop.

    ``clock`` is (0,) if the duration of steps is not measured. ``rows``, ``task`` and ``answer``
    are those of the law; its q̈ is the plant's command. ``alone`` is q̈ of the unconstrained
    baseline. The fields from ``true`` to ``own_error`` contain true values. ``own_error`` is the
    error [px] of a feature that itself decides whether a goal is reached, NaN for other features.
    """

    parts: Annotated[Records, LOOP_PARTS, "1"]
    Ts: Annotated[Array, "1"]
    clock: Annotated[IntArray, "2"]
    rows: RowArrays
    task: TaskArrays
    answer: Answer
    alone: Annotated[Array, "n"]
    true: RowArrays
    pixels: Annotated[Array, "M 2"]
    points: Annotated[Array, "P 3"]
    camera_R: Annotated[Array, "3 3"]
    camera_t: Annotated[Array, "3"]
    own_error: Annotated[Array, "1"]
    goals: Goals
    plant: PlantArrays
    kept: Kept
    scores: Running


@in_place
def put(numbers: Array, out: Array) -> None:
    """Copy an array to another one of the same shape, number by number, without allocation."""
    for i in range(numbers.size):
        out.flat[i] = numbers.flat[i]


@in_place
def hold(transition: Array, x: Array, after: Array) -> None:
    """Set x ← transition x: the state (s, n) at a period's end from that at its beginning.

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


@in_place
def go_to_speeds(plant: PlantArrays, commanded: Array, Ts: float, qdd: Array) -> None:
    """Write the q̈ (n,) by which the arm reaches commanded speeds (n,) within a period."""
    weights = plant.speed_weights
    for j in range(len(commanded)):
        before = 0.0
        for i in range(len(weights)):
            before += weights[i] * plant.of_speeds[i, j]
        qdd[j] = (commanded[j] - before) / Ts


@in_place
def saturate(plant: PlantArrays, qdd: Array, alone: Array) -> bool:
    """Clip the command (n,) to the actuators' limits; return True if a joint is at a limit.

    The limits depend on the previous command. The unconstrained command ``alone`` (n,) is clipped
    in the same way.
    """
    given = plant.limits
    saturated = False
    for j in range(len(given.acceleration)):
        limits = actuator_limits(given, j)
        least, greatest = actuator_box(plant.last[j], limits)
        qdd[j] = between(qdd[j], least, greatest)
        alone[j] = between(alone[j], least, greatest)
        saturated = saturated or at_end(qdd[j], least, greatest)
    put(qdd, plant.last)
    return saturated


@in_place
def actuator_limits(given: JointLimits, j: int) -> JointLimits:
    """Return the limits of joint j's actuator, without those of its range and speed."""
    return JointLimits(
        acceleration=given.acceleration[j],
        change=given.change[j],
        q_min=0.0,
        q_max=0.0,
        qd_max=0.0,
        ranges=0,
        period=given.period,
    )


@in_place
def judge_contact(loop: Loop) -> None:
    """Write the effort of holding each row that first reaches φ = 0.

    A row also counts if the unconstrained command brings it to φ = 0 within the period. q̈ with
    |q̈ⱼ| ≤ aⱼ changes φ̇ = L_fφ + L_gφ q̈ by up to Σⱼ|L_gφⱼ|aⱼ. No law can hold a row whose L_fφ is
    greater than that.
    """
    rows = loop.true
    alone = loop.alone
    acceleration = loop.plant.limits.acceleration
    shares = loop.scores.share_to_hold
    if len(acceleration) == 0:
        return
    for i in range(len(shares)):
        is_judged = not math.isnan(shares[i])
        if is_judged:
            continue
        phi = rows.phi[i]
        drift = rows.Lf[i]
        rate = drift
        for j in range(len(alone)):
            rate += rows.Lg[i, j] * alone[j]
        phi_after = phi + loop.Ts[0] * rate
        is_reached = max(phi, phi_after) >= 0.0
        if not is_reached:
            continue
        most = greatest_change(rows, i, acceleration)
        if most > 0.0:
            shares[i] = drift / most
        else:
            shares[i] = np.copysign(math.inf, drift)


@in_place
def greatest_change(rows: RowArrays, i: int, acceleration: Array) -> float:
    """Return Σⱼ|L_gφⱼ|aⱼ of row i, by which q̈ within its limits a (n,) can change φ̇."""
    total = 0.0
    for j in range(len(acceleration)):
        effect = abs(rows.Lg[i, j])
        # the acceleration may be infinite
        if effect != 0.0:
            total += effect * acceleration[j]
    return total


@in_place
def mark_acting(rows: RowArrays, qdd: Array, alone: Array, active: BoolArray) -> None:
    """Mark the active rows, i.e. those that hold the arm back.

    Their φ is slowed: q̈ (n,) makes it rise by less than the unconstrained command ``alone`` (n,)
    would from the same state. A command that slows one row slows others as well. Therefore only
    slowed rows with φ ≥ 0 are active or, if there are none, the slowed row nearest to φ = 0.
    """
    # usually both commands are the same, and no row is slowed
    differs = False
    for j in range(len(qdd)):
        differs = differs or qdd[j] != alone[j]
    nearest = -math.inf
    for i in range(len(active)):
        slowed = 0.0
        if differs:
            for j in range(len(qdd)):
                missing = alone[j] - qdd[j]
                slowed += rows.Lg[i, j] * missing
        active[i] = slowed > NOTICED * rows.switching_gain[i]
        if active[i]:
            nearest = max(nearest, nearness(rows, i))
    for i in range(len(active)):
        active[i] = active[i] and nearness(rows, i) >= nearest


@in_place
def nearness(rows: RowArrays, i: int) -> float:
    """Return φ of row i relative to its scale, or 0 if φ is positive."""
    relative: float = min(rows.phi[i], 0.0) / rows.scale[i]
    return relative


@in_place
def feature_error(pixels: Array, wanted: Array) -> float:
    """Return the greatest distance of a marker (M, 2) from its desired place [px]."""
    greatest = 0.0
    for i in range(len(pixels)):
        du = pixels[i, 0] - wanted[i, 0]
        dv = pixels[i, 1] - wanted[i, 1]
        greatest = max(greatest, du * du + dv * dv)
    error: float = np.sqrt(greatest)
    return error


@in_place
def score(scores: Running, rows: RowArrays, qdd: Array, active: BoolArray, k: int) -> None:
    """Score sample k: its rows, q̈_c (n,), and its active rows (m,)."""
    squared = score_command(scores, qdd)
    changed = score_activity(scores, active, k)
    for i in range(len(active)):
        score_row(scores, rows, i)
    if 0 < k < scores.common[0]:
        scores.variation[0] += np.sqrt(squared)
        scores.squared_variation[0] += squared
        scores.switches[0] += changed


@in_place
def score_command(scores: Running, qdd: Array) -> float:
    """Score q̈_c (n,) of a sample, and return the square of its change since the last one."""
    last = scores.qdd
    greatest = scores.acceleration_max
    squared = 0.0
    for j in range(len(qdd)):
        change = qdd[j] - last[j]
        squared += change**2
        greatest[j] = max(greatest[j], abs(qdd[j]))
        last[j] = qdd[j]
    return squared


@in_place
def score_row(scores: Running, rows: RowArrays, i: int) -> None:
    """Score φ and σ of row i of a sample."""
    phi = rows.phi[i]
    sigma = rows.sigma[i]
    scores.phi_max[i] = max(scores.phi_max[i], phi)
    scores.sigma_max[i] = max(scores.sigma_max[i], sigma)
    scores.outside[i] += sigma > 0.0
    positive = 0
    if phi >= 0.0:
        positive = scores.positive[i] + 1
    scores.positive[i] = positive
    scores.longest_positive[i] = max(scores.longest_positive[i], positive)


@in_place
def score_activity(scores: Running, active: BoolArray, k: int) -> bool:
    """Score the active rows (m,) of sample k; return True if they are others than in the last."""
    changed = False
    for i in range(len(active)):
        changed = changed or active[i] != scores.active[i]
        scores.active[i] = active[i]
        if active[i]:
            scores.acted[i] += 1
            scores.last_active[i] = k
            if scores.first_active[i] < 0:
                scores.first_active[i] = k
    return changed


@in_place
def finish(loop: Loop, k: int) -> None:
    """Score and record sample k, and move the robot to the end of its period."""
    plant = loop.plant
    qdd = loop.answer.qdd
    at = k % len(loop.kept.states)
    score_goal(loop, k)
    is_saturated = saturate(plant, qdd, loop.alone)
    loop.kept.saturated[at] = is_saturated
    loop.scores.saturated[0] += is_saturated
    judge_contact(loop)
    active = loop.kept.active[at]
    mark_acting(loop.true, qdd, loop.alone, active)
    score(loop.scores, loop.true, qdd, active, k)
    pushed = k % len(plant.push)
    put(plant.push[pushed], plant.x[-1])
    keep(loop, k)
    hold(plant.transition, plant.x, plant.after)


@in_place
def score_goal(loop: Loop, k: int) -> None:
    """Write the distances of sample k from its goal, and note if the goal is not reached."""
    kept = loop.kept
    goals = loop.goals
    camera = k % len(kept.camera_t)
    goal = goal_at(goals.begins, k * loop.Ts[0])
    goal_R = goals.R[goal]
    goal_t = goals.t[goal]
    distance, turn = pose_difference(loop.camera_R, loop.camera_t, goal_R, goal_t)
    away = loop.own_error[0]
    if math.isnan(away):
        away = feature_error(loop.pixels, goals.pixels[goal])
    kept.camera_error[camera, 0] = distance
    kept.camera_error[camera, 1] = turn
    kept.feature_error[camera] = away
    speed = largest_magnitude(loop.plant.x[1])
    tolerance = goals.tolerance[goal]
    by_pose = goals.by_pose[0]
    is_reached = reached(distance, turn, away, speed, tolerance, by_pose)
    if not is_reached:
        loop.scores.unreached[goal] = k


@in_place
def keep(loop: Loop, k: int) -> None:
    """Record sample k. The records are ring buffers."""
    kept = loop.kept
    at = k % len(kept.states)
    camera = k % len(kept.camera_t)
    put(loop.plant.x, kept.states[at])
    put(loop.task.error, kept.error[at])
    put(loop.camera_R, kept.camera_R[camera])
    put(loop.camera_t, kept.camera_t[camera])
    put(loop.pixels, kept.pixels[at])
    put(loop.points, kept.points[at])
    put(loop.true.phi, kept.phi[at])
    put(loop.true.sigma, kept.sigma[at])
