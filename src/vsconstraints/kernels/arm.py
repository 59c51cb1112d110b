"""An arm with mass under its own joint controller: what happens within a period of the control.

Written once, in operations that compile, as :mod:`.samples` is. What differs is who computes inertia and bias of the
arm: :mod:`vsconstraints.kernels.dynamics` compiled, Pinocchio in NumPy
(:mod:`vsconstraints.simulation.dynamics.plant`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..rows import Array, BoolArray, IntArray

TORQUE, POSITION, SPEED = range(3)
"""Controllers of the joints: computed torque; a speed loop with a position loop around it; the speed loop alone."""

BOUND = 1e4
"""Speed of a joint beyond which the motion counts as without bounds [rad/s or m/s]."""

SWEEPS, SETTLED = 200, 1e-12
"""How often friction is balanced among the joints at most, and by how much less than the greatest speed it ends."""


class BodyArrays(NamedTuple):
    """The moving bodies of an arm, one per joint, and how each is placed on the one before.

    Attributes
    ----------
    R, t, axis, prismatic
        (n, 3, 3) and (n, 3) placement at q = 0, (n, 3) the joint's axis in it, (n,) whether it moves along the axis.
    mass, centre, inertia
        (n,) [kg], (n, 3) [m] and (n, 3, 3) about the centre of mass [kg m²], in the body's frame.
    rotor
        (n,) inertia of the motors as the joints feel it [kg m²].
    gravity
        (3,) in the base frame [m/s²].
    """

    R: Array
    t: Array
    axis: Array
    prismatic: BoolArray
    mass: Array
    centre: Array
    inertia: Array
    rotor: Array
    gravity: Array


class Motion(NamedTuple):
    """M(q) (n, n), its Cholesky factor L, and the bias h(q, q̇) (n,): M q̈ + h = τ. ``work`` (n, 32) is scratch."""

    M: Array
    L: Array
    bias: Array
    work: Array


class Drive(NamedTuple):
    """How the joints are driven.

    Attributes
    ----------
    kind
        One of :data:`TORQUE`, :data:`POSITION` and :data:`SPEED`.
    exact
        Whether (1 or 0) the controller believes in the true model.
    rate, outer
        ω of its critically damped loops, and κ of the position loop around the speed loop [1/s].
    weight
        (n,) inertia that the speed loop takes each joint to have [kg m²].
    effort, speed
        (n,) greatest torque, and greatest speed that a reference may have; infinite where there is none.
    viscous, coulomb, static, stribeck
        (n,) friction: per speed, at speed, at rest, and the speed at which the last two have met by 63 %.
    rubs
        Whether (1 or 0) there is any friction.
    share
        How much of the way to what is asked for the torque goes in a substep: 1 − exp(−h/τ).
    at_once
        Whether (1 or 0) what is asked for acts without dead time and lag, and is no longer held for a substep.
    fourth_order
        Whether (1 or 0) the motion is integrated by Runge and Kutta's method of that order.
    """

    kind: int
    exact: int
    rate: float
    outer: float
    weight: Array
    effort: Array
    speed: Array
    viscous: Array
    coulomb: Array
    static: Array
    stribeck: Array
    rubs: int
    share: float
    at_once: int
    fourth_order: int


class Memory(NamedTuple):
    """What a driven arm remembers; (n,) each.

    Attributes
    ----------
    q_c, qd_c
        Reference of the controller: the command integrated.
    integral
        Of the speed loop's error.
    gravity
        What the controller believes that the arm weighs on the joints.
    torque
        What the gears give.
    under_way
        (d + 1, n) what was asked for in the last substeps, round and round.
    at
        (1,) where the next one is put.
    at_limit
        (n,) how many substeps asked for more torque than there is.
    """

    q_c: Array
    qd_c: Array
    integral: Array
    gravity: Array
    torque: Array
    under_way: Array
    at: IntArray
    at_limit: IntArray


class Arm(NamedTuple):
    """An arm, what its controller believes of it, and how it is integrated.

    Attributes
    ----------
    true, believed
        Bodies as they are, and as the controller believes them to be.
    motion, expected
        Inertia and bias of both.
    drive, memory
        Controller, friction and gears.
    substeps, h
        Of a period, and how long each is [s].
    asked
        (n,) torques that the controller asks for.
    acceleration, after, friction, speed
        (n,) scratch.
    stages
        (4, n) scratch.
    """

    true: BodyArrays
    believed: BodyArrays
    motion: Motion
    expected: Motion
    drive: Drive
    memory: Memory
    substeps: int
    h: float
    asked: Array
    acceleration: Array
    after: Array
    friction: Array
    speed: Array
    stages: Array


class Engine(Protocol):
    """What computes an arm's mechanics where nothing is compiled."""

    def evaluate(self, bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
        """Write M(q), its factor, and h(q, q̇)."""

    def move(self, arm: Arm, q: Array, qd: Array, command: Array) -> None:
        """As :func:`substep`."""


def evaluate(engine: Engine, bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
    """Write inertia and bias of bodies at q and q̇ (n,); compiled code has a form of its own."""
    engine.evaluate(bodies, q, qd, motion)


def move(engine: Engine, arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Move an arm through a substep; compiled, by :func:`substep`."""
    engine.move(arm, q, qd, command)


def factor(M: Array, L: Array) -> None:
    """Write the Cholesky factor of M (n, n), of which the lower half counts, with the inverses of its diagonal."""
    for j in range(len(M)):
        rest = M[j, j]
        for k in range(j):
            rest -= L[j, k] * L[j, k]
        # NaN where M is not positive definite: whoever looks at the speeds sees it
        inverse = 1.0 / math.sqrt(rest) if rest > 0.0 else math.nan
        L[j, j] = inverse
        for i in range(j + 1, len(M)):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = rest * inverse


def solve(L: Array, x: Array) -> None:
    """Set x ← M⁻¹ x (n,) by the factor of :func:`factor`."""
    n = len(x)
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] *= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] *= L[i, i]


def accelerate(motion: Motion, torque: Array, friction: Array, qdd: Array) -> None:
    """Write q̈ = M⁻¹(τ − τ_f − h) (n,)."""
    for j in range(len(qdd)):
        qdd[j] = torque[j] - friction[j] - motion.bias[j]
    solve(motion.L, qdd)


def ask_torque(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Write to ``arm.asked`` the torques that the controller asks for, at q and q̇ (n,) with the command q̈_c (n,)."""
    drive, memory, n = arm.drive, arm.memory, len(q)
    rate = drive.rate
    if drive.kind != TORQUE:
        for j in range(n):
            error = speed_error(arm, q, qd, j)
            torque = drive.weight[j] * (2.0 * rate * error + rate * rate * memory.integral[j])
            arm.asked[j] = memory.gravity[j] + torque
        return
    for j in range(n):
        away, faster = memory.q_c[j] - q[j], memory.qd_c[j] - qd[j]
        arm.after[j] = command[j] + 2.0 * rate * faster + rate * rate * away
    M, bias = arm.expected.M, arm.expected.bias
    if drive.exact:
        M, bias = arm.motion.M, arm.motion.bias
    for i in range(n):
        arm.asked[i] = bias[i]
        for j in range(n):
            arm.asked[i] += M[max(i, j), min(i, j)] * arm.after[j]


def speed_error(arm: Arm, q: Array, qd: Array, j: int) -> float:
    """What the speed loop of a joint sees: q̇_c − q̇ + κ (q_c − q)."""
    memory = arm.memory
    error: float = memory.qd_c[j] - qd[j] + arm.drive.outer * (memory.q_c[j] - q[j])
    return error


def refer(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Take what the controller remembers through a substep that begins at q and q̇ (n,), its reference first."""
    drive, memory, h = arm.drive, arm.memory, arm.h
    for j in range(len(command)):
        error = speed_error(arm, q, qd, j)
        memory.at_limit[j] += abs(arm.asked[j]) > drive.effort[j]
        # what is integrated while the torque has no more to give would have to be undone
        if abs(arm.asked[j]) <= drive.effort[j] or error * arm.asked[j] < 0.0:
            memory.integral[j] += h * error
        speed = memory.qd_c[j] + h * command[j]
        memory.q_c[j] += h * memory.qd_c[j]
        if abs(speed) > drive.speed[j]:
            speed = math.copysign(drive.speed[j], speed)
            memory.q_c[j] += 0.5 * h * (speed - memory.qd_c[j])
        else:
            memory.q_c[j] += 0.5 * h * h * command[j]
        memory.qd_c[j] = speed


def give_torque(arm: Arm) -> None:
    """Take what is asked for through saturation, dead time and lag."""
    drive, memory, slots = arm.drive, arm.memory, len(arm.memory.under_way)
    at = memory.at[0]
    for j in range(len(arm.asked)):
        memory.under_way[at, j] = min(max(arm.asked[j], -drive.effort[j]), drive.effort[j])
    memory.at[0] = at = (at + 1) % slots
    for j in range(len(arm.asked)):
        memory.torque[j] += drive.share * (memory.under_way[at, j] - memory.torque[j])


def dry_friction(drive: Drive, j: int, speed: float) -> float:
    """Coulomb's friction of a joint at that speed, with Stribeck's rise towards rest [Nm or N]."""
    more = drive.static[j] - drive.coulomb[j]
    if more == 0.0:
        return float(drive.coulomb[j])
    ratio = speed / drive.stribeck[j]
    return float(drive.coulomb[j] + more * math.exp(-ratio * ratio))


def rub(arm: Arm, qd: Array) -> None:
    """Write friction (n,) of a substep that begins with q̇ (n,), and q̈ (n,) at its beginning.

    Friction is that at the end of the substep, so that it stops a joint, and never sends it back: with v of the end,
    M (v − v_free) = −h τ_f(v), where τ_f is anything within ± static friction if v = 0. This is the least of a convex
    function, found joint by joint.
    """
    drive, M, h, v, n = arm.drive, arm.motion.M, arm.h, arm.speed, len(qd)
    for j in range(n):
        arm.friction[j] = 0.0
    accelerate(arm.motion, arm.memory.torque, arm.friction, arm.acceleration)
    if not drive.rubs:
        return
    greatest = 0.0
    for j in range(n):
        arm.after[j] = qd[j] + h * arm.acceleration[j]
        v[j] = qd[j]
        greatest = max(greatest, abs(arm.after[j]))
    for _ in range(SWEEPS):
        change = 0.0
        for j in range(n):
            pull = M[j, j] * arm.after[j]
            for k in range(n):
                if k != j:
                    pull -= M[max(j, k), min(j, k)] * (v[k] - arm.after[k])
            left = abs(pull) - h * dry_friction(drive, j, qd[j])
            speed = math.copysign(max(left, 0.0) / (M[j, j] + h * drive.viscous[j]), pull)
            change = max(change, abs(speed - v[j]))
            v[j] = speed
        if change <= SETTLED * greatest:
            break
    for i in range(n):
        arm.friction[i] = 0.0
        for j in range(n):
            arm.friction[i] += M[max(i, j), min(i, j)] * (arm.after[j] - v[j]) / h
    accelerate(arm.motion, arm.memory.torque, arm.friction, arm.acceleration)


def substep(engine: Any, arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Move the arm through a substep, from q and q̇ (n,) on, and compute inertia and bias at its end.

    q⁺ = q + h q̇ + ½h² q̈, q̇⁺ = q̇ + ½h (q̈ + q̈⁺), where q̈⁺ takes the speed to be q̇ + h q̈: second order with one
    evaluation, and exact for constant accelerations. A controller whose torque acts at once is a continuous one: what
    it asks for at the end is in q̈⁺. Otherwise the torque is held.
    """
    h, n, drive = arm.h, len(q), arm.drive
    rub(arm, qd)
    if drive.fourth_order:
        runge_kutta(engine, arm, q, qd)
        return
    for j in range(n):
        q[j] += h * qd[j] + 0.5 * h * h * arm.acceleration[j]
        arm.speed[j] = qd[j] + h * arm.acceleration[j]
    know_motion(engine, arm, q, arm.speed)
    if drive.at_once:
        ask_torque(arm, q, arm.speed, command)
        give_torque(arm)
    accelerate(arm.motion, arm.memory.torque, arm.friction, arm.after)
    for j in range(n):
        qd[j] += 0.5 * h * (arm.acceleration[j] + arm.after[j])


def runge_kutta(engine: Any, arm: Arm, q: Array, qd: Array) -> None:
    """Move the arm through a substep by the classical method of fourth order, with torque and friction held."""
    h, n, a = arm.h, len(q), arm.stages
    for j in range(n):
        a[0, j] = arm.acceleration[j]
    for i in range(3):
        way, bend = (0.5, 0.25 * (i == 1)) if i < 2 else (1.0, 0.5)
        for j in range(n):
            arm.asked[j] = q[j] + way * h * qd[j] + bend * h * h * a[max(i - 1, 0), j]
            arm.speed[j] = qd[j] + way * h * a[i, j]
        evaluate(engine, arm.true, arm.asked, arm.speed, arm.motion)
        accelerate(arm.motion, arm.memory.torque, arm.friction, a[i + 1])
    for j in range(n):
        q[j] += h * qd[j] + h * h / 6.0 * (a[0, j] + a[1, j] + a[2, j])
        qd[j] += h / 6.0 * (a[0, j] + 2.0 * a[1, j] + 2.0 * a[2, j] + a[3, j])
    know_motion(engine, arm, q, qd)


def know_motion(engine: Any, arm: Arm, q: Array, qd: Array) -> None:
    """Compute inertia and bias at q and q̇ (n,): the true ones, and those that computed torque takes for them."""
    evaluate(engine, arm.true, q, qd, arm.motion)
    if arm.drive.kind == TORQUE and not arm.drive.exact:
        evaluate(engine, arm.believed, q, qd, arm.expected)


def bounded(qd: Array) -> bool:
    """Whether speeds (n,) are numbers, and not beyond :data:`BOUND`."""
    fastest = 0.0
    for speed in qd:
        # NaN is not less than anything
        fastest = abs(speed) if not abs(speed) < fastest else fastest
    return fastest < BOUND


def begin(engine: Any, arm: Arm, q: Array, qd: Array) -> None:
    """Begin a run at q and q̇ (n,): the gears give what the controller asks for where nothing is commanded."""
    memory, drive = arm.memory, arm.drive
    for j in range(len(q)):
        memory.q_c[j], memory.qd_c[j] = q[j], qd[j]
        arm.speed[j] = 0.0
    weigh(engine, arm, q)
    know_motion(engine, arm, q, qd)
    ask_torque(arm, q, qd, arm.speed)
    for j in range(len(q)):
        memory.torque[j] = min(max(arm.asked[j], -drive.effort[j]), drive.effort[j])
        for i in range(len(memory.under_way)):
            memory.under_way[i, j] = memory.torque[j]


def weigh(engine: Any, arm: Arm, q: Array) -> None:
    """Let controllers that do not know inertias know what they believe to be the weight on the joints at q (n,)."""
    if arm.drive.kind != TORQUE:
        for j in range(len(q)):
            arm.speed[j] = 0.0
        evaluate(engine, arm.believed, q, arm.speed, arm.expected)
        for j in range(len(q)):
            arm.memory.gravity[j] = arm.expected.bias[j]


def drive_period(engine: Any, arm: Arm, x: Array) -> int:
    """Move the arm through a period: its state x (s, n) has q, q̇ first and the command last but one.

    Returns
    -------
    int
        0, or 1 if the motion is without bounds.
    """
    q, qd, command = x[0], x[1], x[-2]
    weigh(engine, arm, q)
    for i in range(arm.substeps):
        # what acts at once was asked for at the end of the substep before
        if i == 0 or not arm.drive.at_once:
            ask_torque(arm, q, qd, command)
            give_torque(arm)
        refer(arm, q, qd, command)
        move(engine, arm, q, qd, command)
    return 0 if bounded(qd) else 1


def blank(bodies: tuple[BodyArrays, BodyArrays], drive: Drive, slots: int, substeps: int, h: float) -> Arm:
    """An arm of which nothing has been computed yet; its gears remember so many ``slots``."""
    n = len(drive.effort)

    def zeros(*shape: int) -> Array:
        return np.zeros(shape)

    true, expected = (Motion(zeros(n, n), zeros(n, n), zeros(n), zeros(n, 32)) for _ in range(2))
    q_c, qd_c, integral, gravity, torque, asked, qdd, after, friction, speed = zeros(10, n)
    counts = np.zeros(1, dtype=np.int64), np.zeros(n, dtype=np.int64)
    memory = Memory(q_c, qd_c, integral, gravity, torque, zeros(slots, n), *counts)
    return Arm(
        *bodies, true, expected, drive, memory, substeps, h, asked, qdd, after, friction, speed, stages=zeros(4, n)
    )
