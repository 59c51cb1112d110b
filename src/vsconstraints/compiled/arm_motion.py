"""How an arm with mass moves: friction, the motion through a substep, and through a period of the control."""

from __future__ import annotations

import math
from typing import Any

from ..rows import Array
from .arm import TORQUE, Arm, Drive, Motion, evaluate, move
from .drives import ask_torque, give_torque, refer, weigh

BOUND = 1e4
"""Speed of a joint beyond which the motion counts as without bounds [rad/s or m/s]."""

SWEEPS, SETTLED = 200, 1e-12
"""How often friction is balanced among the joints at most, and by how much less than the greatest speed it ends."""


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


def know_motion(engine: Any, arm: Arm, q: Array, qd: Array) -> None:
    """Compute inertia and bias at q and q̇ (n,): the true ones, and those that computed torque takes for them."""
    evaluate(engine, arm.true, q, qd, arm.motion)
    if arm.drive.kind == TORQUE and not arm.drive.exact:
        evaluate(engine, arm.believed, q, qd, arm.expected)


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
