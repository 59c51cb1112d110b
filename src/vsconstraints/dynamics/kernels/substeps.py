"""Motion of an arm with mass through a sampling period, compiled: integration in substeps.

A period of ten substeps takes 7 µs within the compiled loop. In MuJoCo, stepped from Python, it
takes 120 µs.
"""

from __future__ import annotations

from ...compiled.compiler import IN_PLACE, compiled, in_place
from ...compiled.linear import clip
from ...compiled.memory import zeros
from ...compiled.parts import address, call_int_pointer, checked, struct_loader
from ...compiled.signatures import FLAG, INT, MATRIX, VOID, signature
from ...rows import Array
from .arm import Arm
from .drives import command_torque, drive, transmit_torque
from .inertia import accelerate, evaluate, update_gravity, update_motion

BOUND = 1e4  #: Joint speed beyond which the motion counts as unbounded [rad/s or m/s].
#: Stages of the Runge–Kutta method after the first: share of the substep h, and factor of h² times
#: the acceleration of the stage before the last.
STAGES = ((0.5, 0.0), (0.5, 0.25), (1.0, 0.5))


@in_place
def verlet(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Integrate a substep by the Verlet method, and compute inertia and bias at its end.

    q⁺ = q + h q̇ + ½h² q̈, q̇⁺ = q̇ + ½h (q̈ + q̈⁺), where q̈⁺ is evaluated at the speed q̇ + h q̈.
    The method is of second order with one evaluation, and exact for constant accelerations. A
    controller whose torque acts at once is continuous: q̈⁺ contains the torque that it commands at
    the end. Otherwise the torque is held.
    """
    h = arm.h
    acceleration = arm.acceleration
    at_end = arm.after
    for j in range(len(q)):
        qdd = acceleration[j]
        q[j] += h * qd[j] + 0.5 * h * h * qdd
        arm.speed[j] = qd[j] + h * qdd
    update_motion(arm, q, arm.speed)
    if arm.drive.at_once:
        command_torque(arm, q, arm.speed, command)
        transmit_torque(arm)
    accelerate(arm.motion, arm.memory.torque, arm.friction, at_end)
    for j in range(len(q)):
        qd[j] += 0.5 * h * (acceleration[j] + at_end[j])


@in_place
def runge_kutta(arm: Arm, q: Array, qd: Array) -> None:
    """Integrate a substep by the classical fourth-order Runge–Kutta method.

    Torque and friction are held.
    """
    h = arm.h
    n = len(q)
    a = arm.stages
    # scratch: the torques have been transmitted
    stage_q = arm.commanded
    stage_qd = arm.speed
    for j in range(n):
        a[0, j] = arm.acceleration[j]
    for stage in range(3):
        share, bend = STAGES[stage]
        earlier = max(stage - 1, 0)
        span = share * h
        for j in range(n):
            moved = q[j] + span * qd[j]
            stage_q[j] = moved + bend * h * h * a[earlier, j]
            stage_qd[j] = qd[j] + span * a[stage, j]
        evaluate(arm.true, stage_q, stage_qd, arm.motion)
        accelerate(arm.motion, arm.memory.torque, arm.friction, a[stage + 1])
    weight_of_qd = h / 6.0
    weight_of_q = h * h / 6.0
    for j in range(n):
        first = a[0, j]
        second = a[1, j]
        third = a[2, j]
        last = a[3, j]
        first_three = first + second + third
        all_four = first + 2.0 * second + 2.0 * third + last
        q[j] += h * qd[j] + weight_of_q * first_three
        qd[j] += weight_of_qd * all_four
    update_motion(arm, q, qd)


load_arm = struct_loader(zeros(Arm))


@checked(Arm)
@compiled(signature(VOID, INT, MATRIX), IN_PLACE)
def begin(arm_address: int, x: Array) -> None:
    """Begin a run at the state x (s, n).

    The gears transmit the torque that the controller commands for q̈_c = 0.
    """
    arm = load_arm(arm_address)
    q = x[0]
    qd = x[1]
    at_rest = arm.speed
    memory = arm.memory
    effort = arm.drive.effort
    update_gravity(arm, q)
    for j in range(len(q)):
        memory.q_c[j] = q[j]
        memory.qd_c[j] = qd[j]
        at_rest[j] = 0.0
    update_motion(arm, q, qd)
    command_torque(arm, q, qd, at_rest)
    for j in range(len(q)):
        torque = clip(arm.commanded[j], -effort[j], effort[j])
        memory.torque[j] = torque
        for i in range(len(memory.under_way)):
            memory.under_way[i, j] = torque


@compiled(signature(INT, INT, MATRIX), IN_PLACE, from_python=False)
def drive_period_at(arm_address: int, x: Array) -> int:
    """Move the arm through a period. Return 0, or 1 if the motion is unbounded.

    The state x (s, n) contains q and q̇ first, and the command last but one.
    """
    arm = load_arm(arm_address)
    q = x[0]
    qd = x[1]
    command = x[-2]
    for i in range(arm.substeps):
        drive(arm, q, qd, command, i == 0)
        if arm.drive.fourth_order:
            runge_kutta(arm, q, qd)
        else:
            verlet(arm, q, qd, command)
    bounded = True
    for j in range(len(qd)):
        # the comparison is false for NaN
        bounded = bounded and abs(qd[j]) < BOUND
    return 0 if bounded else 1


@checked(Arm)
@compiled(signature(VOID, INT, MATRIX, FLAG), IN_PLACE)
def drive_substep(arm_address: int, x: Array, first: bool) -> None:
    """Call :func:`drive` in a simulation whose motion another program integrates."""
    drive(load_arm(arm_address), x[0], x[1], x[-2], first)


@checked(Arm)
@compiled(signature(VOID, INT, MATRIX), IN_PLACE)
def end_substep(arm_address: int, x: Array) -> None:
    """Call :func:`update_motion` in a simulation whose motion another program integrates."""
    update_motion(load_arm(arm_address), x[0], x[1])


MOVE = address(drive_period_at)  #: Address of the function that moves an arm through a period.


@checked(Arm, calls=MOVE)
@compiled(signature(INT, INT, INT, MATRIX), IN_PLACE)
def drive_period(function: int, arm_address: int, x: Array) -> int:
    """Call :func:`drive_period_at` from Python."""
    code: int = call_int_pointer(function, (arm_address, x))
    return code
