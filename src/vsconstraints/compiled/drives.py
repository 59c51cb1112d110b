"""How the joints of an arm are driven: what their controller asks for and remembers, and what the gears give of it."""

from __future__ import annotations

import math
from typing import Any

from ..rows import Array
from .arm import TORQUE, Arm, evaluate


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


def weigh(engine: Any, arm: Arm, q: Array) -> None:
    """Let controllers that do not know inertias know what they believe to be the weight on the joints at q (n,)."""
    if arm.drive.kind != TORQUE:
        for j in range(len(q)):
            arm.speed[j] = 0.0
        evaluate(engine, arm.believed, q, arm.speed, arm.expected)
        for j in range(len(q)):
            arm.memory.gravity[j] = arm.expected.bias[j]
