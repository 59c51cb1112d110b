"""Drives of an arm with mass, compiled: joint controllers, gears and friction.

They give the torques on the joints of :mod:`.inertia`'s bodies; :mod:`.substeps` integrates the
motion.
"""

from __future__ import annotations

import numpy as np

from ...compiled.compiler import in_place
from ...compiled.linear import clip
from ...rows import Array
from .arm import TORQUE, Arm, Drive
from .inertia import accelerate, update_gravity

#: Maximum number of sweeps that balance friction among the joints, and the change at which they
#: end, relative to the greatest speed.
SWEEPS = 200
SETTLED = 1e-12


@in_place
def symmetric_entry(M: Array, i: int, j: int) -> float:
    """Return an entry of a symmetric matrix of which only the lower half is written."""
    entry: float = M[max(i, j), min(i, j)]
    return entry


@in_place
def speed_error(arm: Arm, q: Array, qd: Array, j: int) -> float:
    """Return the error of a joint's speed loop: q̇_c − q̇ + κ (q_c − q)."""
    memory = arm.memory
    q_error = memory.q_c[j] - q[j]
    error: float = memory.qd_c[j] - qd[j] + arm.drive.outer * q_error
    return error


@in_place
def command_by_speed_loop(arm: Arm, q: Array, qd: Array) -> None:
    """Write the torques that the speed loops command: PI controllers, and the weight."""
    drive = arm.drive
    memory = arm.memory
    rate = drive.rate
    for j in range(len(q)):
        error = speed_error(arm, q, qd, j)
        acceleration = 2.0 * rate * error + rate * rate * memory.integral[j]
        arm.commanded[j] = memory.gravity[j] + drive.weight[j] * acceleration


@in_place
def command_by_model(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Write the torques M a + h of computed torque.

    a = q̈_c + 2ω (q̇_c − q̇) + ω² (q_c − q) is critically damped.
    """
    memory = arm.memory
    n = len(q)
    rate = arm.drive.rate
    acceleration = arm.after
    for j in range(n):
        q_error = memory.q_c[j] - q[j]
        qd_error = memory.qd_c[j] - qd[j]
        damped = command[j] + 2.0 * rate * qd_error
        acceleration[j] = damped + rate * rate * q_error
    M = arm.expected.M
    bias = arm.expected.bias
    if arm.drive.exact:
        M = arm.motion.M
        bias = arm.motion.bias
    for i in range(n):
        arm.commanded[i] = bias[i]
        for j in range(n):
            arm.commanded[i] += symmetric_entry(M, i, j) * acceleration[j]


@in_place
def command_torque(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Write the torques that the controller commands at q and q̇ (n,) for the command q̈_c (n,)."""
    if arm.drive.kind == TORQUE:
        command_by_model(arm, q, qd, command)
    else:
        command_by_speed_loop(arm, q, qd)


@in_place
def transmit_torque(arm: Arm) -> None:
    """Apply saturation, dead time and lag to the commanded torques."""
    drive = arm.drive
    memory = arm.memory
    under_way = memory.under_way
    n = len(arm.commanded)
    newest = memory.at[0]
    for j in range(n):
        effort = drive.effort[j]
        under_way[newest, j] = clip(arm.commanded[j], -effort, effort)
    # in the ring buffer, the oldest torque follows the newest one
    oldest = (newest + 1) % len(under_way)
    memory.at[0] = oldest
    for j in range(n):
        step = under_way[oldest, j] - memory.torque[j]
        memory.torque[j] += drive.share * step


@in_place
def advance_reference(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Advance the controller's reference and integral by a substep that begins at q and q̇ (n,)."""
    drive = arm.drive
    memory = arm.memory
    h = arm.h
    for j in range(len(command)):
        error = speed_error(arm, q, qd, j)
        commanded = arm.commanded[j]
        effort = drive.effort[j]
        memory.at_limit[j] += abs(commanded) > effort
        # anti-windup: the integral stops while the torque is at its limit
        is_possible = abs(commanded) <= effort
        leads_back = error * commanded < 0.0
        if is_possible or leads_back:
            memory.integral[j] += h * error
        qd_c = memory.qd_c[j]
        speed = qd_c + h * command[j]
        limit = drive.speed[j]
        if abs(speed) > limit:
            speed = np.copysign(limit, speed)
            by_acceleration = 0.5 * h * (speed - qd_c)
        else:
            by_acceleration = 0.5 * h * h * command[j]
        at_constant_speed = memory.q_c[j] + h * qd_c
        memory.q_c[j] = at_constant_speed + by_acceleration
        memory.qd_c[j] = speed


@in_place
def dry_friction(drive: Drive, j: int, speed: float) -> float:
    """Return a joint's Coulomb friction with the Stribeck effect near rest [Nm or N]."""
    more = drive.static[j] - drive.coulomb[j]
    if more == 0.0:
        return float(drive.coulomb[j])
    ratio = speed / drive.stribeck[j]
    return float(drive.coulomb[j] + more * np.exp(-ratio * ratio))


@in_place
def balance_friction(arm: Arm, qd: Array, v_free: Array, v: Array) -> float:
    """Update the speed v of each joint at the end of a substep, given those of the others.

    ``v_free`` (n,) are the speeds without friction. Return the greatest change of a speed.
    """
    drive = arm.drive
    M = arm.motion.M
    n = len(qd)
    greatest_change = 0.0
    h = arm.h
    for j in range(n):
        inertia = M[j, j]
        # momentum of the joint alone that friction has to take away
        momentum = inertia * v_free[j]
        for k in range(n):
            if k != j:
                change = v[k] - v_free[k]
                momentum -= symmetric_entry(M, j, k) * change
        left = abs(momentum) - h * dry_friction(drive, j, qd[j])
        size = max(left, 0.0) / (inertia + h * drive.viscous[j])
        speed = np.copysign(size, momentum)
        greatest_change = max(greatest_change, abs(speed - v[j]))
        v[j] = speed
    return greatest_change


@in_place
def apply_friction(arm: Arm, qd: Array) -> None:
    """Write friction (n,) of a substep that begins with q̇ (n,), and q̈ (n,) at its beginning.

    The friction is that at the end of the substep, so that it can stop a joint but never reverse
    it. With v at the end, M (v − v_free) = −h τ_f(v), where τ_f lies within ± static friction if v
    = 0. The solution minimises a convex function and is found joint by joint.
    """
    M = arm.motion.M
    h = arm.h
    v = arm.speed
    v_free = arm.after
    n = len(qd)
    for j in range(n):
        arm.friction[j] = 0.0
    accelerate(arm.motion, arm.memory.torque, arm.friction, arm.acceleration)
    if not arm.drive.has_friction:
        return
    greatest_speed = 0.0
    for j in range(n):
        v_free[j] = qd[j] + h * arm.acceleration[j]
        v[j] = qd[j]
        greatest_speed = max(greatest_speed, abs(v_free[j]))
    for _ in range(SWEEPS):
        if balance_friction(arm, qd, v_free, v) <= SETTLED * greatest_speed:
            break
    for i in range(n):
        arm.friction[i] = 0.0
        for j in range(n):
            lost_speed = v_free[j] - v[j]
            arm.friction[i] += symmetric_entry(M, i, j) * lost_speed / h
    accelerate(arm.motion, arm.memory.torque, arm.friction, arm.acceleration)


@in_place
def drive(arm: Arm, q: Array, qd: Array, command: Array, first: bool) -> None:
    """Compute torques and friction of a substep, and q̈ at its beginning.

    Also advance the controller's reference and integral by the substep. ``first`` is true for the
    first substep of a period.
    """
    if first:
        update_gravity(arm, q)
    # torques that act at once were computed at the end of the previous substep
    if first or not arm.drive.at_once:
        command_torque(arm, q, qd, command)
        transmit_torque(arm)
    advance_reference(arm, q, qd, command)
    apply_friction(arm, qd)
