"""Arm with mass, compiled: inertia and bias, joint controller, gears, friction, integration.

All quantities are expressed in the base frame, twists and momenta about its origin, so that momenta
of bodies can be added directly. The momenta of the bodies behind a joint, projected on its axis,
give the bias (recursive Newton–Euler). They give the inertia if the joint alone moves these bodies
(composite rigid bodies). Pinocchio's ``crba`` and ``nonLinearEffects``, which compiled code cannot
call, give the same results: ``test_inertia_and_bias_are_pinocchios`` in ``tests/test_dynamics.py``.

A period of ten substeps takes 7 µs within the compiled loop. In MuJoCo, stepped from Python, it
takes 120 µs.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..formulas.rotation import turn_about
from ..formulas.vectors import (
    Matrix,
    Vector,
    add_scaled,
    cross,
    dot,
    matrix,
    plus,
    product,
    rotate,
    times,
    vector,
)
from ..rows import Array
from .arm import TORQUE, Arm, BodyArrays, Drive, Motion
from .compiler import IN_PLACE, compiled, in_place, register_formulas
from .kinematics import put
from .memory import zeros
from .parts import address, call_int_pointer, checked, struct_loader
from .signatures import FLAG, INT, MATRIX, VOID, signature

register_formulas()

BOUND = 1e4  #: Joint speed beyond which the motion counts as unbounded [rad/s or m/s].
#: Maximum number of sweeps that balance friction among the joints, and the change at which they
#: end, relative to the greatest speed.
SWEEPS = 200
SETTLED = 1e-12
#: Stages of the Runge–Kutta method after the first: share of the substep h, and factor of h² times
#: the acceleration of the stage before the last.
STAGES = ((0.5, 0.0), (0.5, 0.25), (1.0, 0.5))


@in_place
def factor(M: Array, L: Array) -> None:
    """Write the Cholesky factor of M (n, n), with the inverses of its diagonal.

    Only the lower half of M is used.
    """
    for j in range(len(M)):
        rest = M[j, j]
        for k in range(j):
            rest -= L[j, k] * L[j, k]
        # NaN if M is not positive definite: the speeds become NaN as well, which is detected
        inverse = 1.0 / np.sqrt(rest) if rest > 0.0 else math.nan
        L[j, j] = inverse
        for i in range(j + 1, len(M)):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = rest * inverse


@in_place
def solve(L: Array, x: Array) -> None:
    """Set x ← M⁻¹ x (n,) with the factor of :func:`factor`."""
    n = len(x)
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] *= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] *= L[i, i]


@in_place
def accelerate(motion: Motion, torque: Array, friction: Array, qdd: Array) -> None:
    """Write q̈ = M⁻¹(τ − τ_f − h) (n,)."""
    for j in range(len(qdd)):
        qdd[j] = torque[j] - friction[j] - motion.bias[j]
    solve(motion.L, qdd)


@in_place
def symmetric(S: Array, v: Vector) -> Vector:
    """Return S v for a symmetric matrix S with the entries xx, xy, xz, yy, yz and zz."""
    xx = S[0]
    xy = S[1]
    xz = S[2]
    yy = S[3]
    yz = S[4]
    zz = S[5]
    return (
        xx * v[0] + xy * v[1] + xz * v[2],
        xy * v[0] + yy * v[1] + yz * v[2],
        xz * v[0] + yz * v[1] + zz * v[2],
    )


@in_place
def write_symmetric(
    xx: float, xy: float, xz: float, yy: float, yz: float, zz: float, S: Array
) -> None:
    """Write the entries of a symmetric matrix."""
    S[0] = xx
    S[1] = xy
    S[2] = xz
    S[3] = yy
    S[4] = yz
    S[5] = zz


@in_place
def add_link(link: Any, behind: Any) -> None:
    """Add force, moment, mass, first moment and inertia of the bodies behind a body to its own."""
    for k in range(3):
        link.force[k] += behind.force[k]
        link.moment[k] += behind.moment[k]
        link.first_moment[k] += behind.first_moment[k]
    link.mass += behind.mass
    for k in range(6):
        link.inertia[k] += behind.inertia[k]


class Frame(NamedTuple):
    """Motion of a body's frame, in the base frame.

    Rotation R and origin o, angular velocity ω and acceleration α = ω̇, and acceleration a of the
    origin, each for q̈ = 0. The acceleration includes that of the base, which stands for gravity.
    """

    R: Matrix
    o: Vector
    omega: Vector
    alpha: Vector
    a: Vector


@in_place
def next_frame(bodies: BodyArrays, i: int, q: float, qd: float, frame: Frame, link: Any) -> Frame:
    """Return the frame of body i behind its joint, from that of the body before.

    Write the twist of the body about the base's origin, for q̇ = 1 of this joint alone, to the link.
    """
    R, o, omega, alpha, a = frame
    axis = vector(bodies.axis[i])
    placement = matrix(bodies.R[i])
    displacement = 0.0
    r = rotate(R, vector(bodies.t[i]))
    if bodies.prismatic[i]:
        displacement = q
    else:
        placement = product(placement, turn_about(axis, np.sin(q), np.cos(q)))
    R = product(R, placement)
    z = rotate(R, axis)
    r = add_scaled(r, displacement, z)
    o = plus(o, r)
    # the previous body carries the frame's origin
    centripetal = cross(omega, cross(omega, r))
    a = plus(a, plus(cross(alpha, r), centripetal))
    if bodies.prismatic[i]:
        a = add_scaled(a, 2.0 * qd, cross(omega, z))
        velocity = z
        turn = (0.0, 0.0, 0.0)
    else:
        alpha = add_scaled(alpha, qd, cross(omega, z))
        omega = add_scaled(omega, qd, z)
        velocity = cross(o, z)
        turn = z
    put(velocity, link.velocity)
    put(turn, link.turn)
    return Frame(R, o, omega, alpha, a)


@in_place
def write_momenta(bodies: BodyArrays, i: int, frame: Frame, link: Any) -> None:
    """Write force and moment that move body i, its mass, first moment and inertia, to the link.

    All but the mass are about the base's origin.
    """
    R, o, omega, alpha, a = frame
    m = bodies.mass[i]
    to_centre = rotate(R, vector(bodies.centre[i]))
    c = plus(o, to_centre)
    centripetal = cross(omega, cross(omega, to_centre))
    force = times(m, plus(a, plus(cross(alpha, to_centre), centripetal)))
    # inertia about the centre, R I Rᵀ
    half = product(R, matrix(bodies.inertia[i]))
    xx = dot(half[0], R[0])
    xy = dot(half[0], R[1])
    xz = dot(half[0], R[2])
    yy = dot(half[1], R[1])
    yz = dot(half[1], R[2])
    zz = dot(half[2], R[2])
    write_symmetric(xx, xy, xz, yy, yz, zz, link.inertia)
    spin = cross(omega, symmetric(link.inertia, omega))
    moment = plus(plus(symmetric(link.inertia, alpha), spin), cross(c, force))
    put(force, link.force)
    put(moment, link.moment)
    link.mass = m
    put(times(m, c), link.first_moment)
    # about the base's origin, by Steiner's theorem
    write_symmetric(
        xx + m * (c[1] * c[1] + c[2] * c[2]),
        xy - m * c[0] * c[1],
        xz - m * c[0] * c[2],
        yy + m * (c[0] * c[0] + c[2] * c[2]),
        yz - m * c[1] * c[2],
        zz + m * (c[0] * c[0] + c[1] * c[1]),
        link.inertia,
    )


@in_place
def project_momenta(bodies: BodyArrays, motion: Motion) -> None:
    """Write bias and inertia (its lower half) from the momenta of the bodies behind each joint."""
    links = motion.links
    n = len(motion.bias)
    for i in range(n - 1, -1, -1):
        link = links[i]
        if i + 1 < n:
            add_link(link, links[i + 1])
        velocity = vector(link.velocity)
        turn = vector(link.turn)
        motion.bias[i] = dot(velocity, vector(link.force)) + dot(turn, vector(link.moment))
        # momenta of all bodies behind the joint if it alone moves, with speed 1
        first_moment = vector(link.first_moment)
        linear = plus(times(link.mass, velocity), cross(turn, first_moment))
        angular = plus(symmetric(link.inertia, turn), cross(first_moment, velocity))
        for j in range(i + 1):
            other = links[j]
            along = dot(vector(other.velocity), linear)
            motion.M[i, j] = along + dot(vector(other.turn), angular)
        motion.M[i, i] += bodies.rotor[i]


@in_place
def evaluate(bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
    """Write M(q) (its lower half), h(q, q̇) and the factor of M."""
    R = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    o = (0.0, 0.0, 0.0)
    omega = (0.0, 0.0, 0.0)
    alpha = (0.0, 0.0, 0.0)
    # gravity is an upward acceleration of the base
    a = times(-1.0, vector(bodies.gravity))
    frame = Frame(R, o, omega, alpha, a)
    for i in range(len(q)):
        link = motion.links[i]
        frame = next_frame(bodies, i, q[i], qd[i], frame, link)
        write_momenta(bodies, i, frame, link)
    project_momenta(bodies, motion)
    factor(motion.M, motion.L)


@in_place
def update_motion(arm: Arm, q: Array, qd: Array) -> None:
    """Compute inertia and bias at q and q̇ (n,), and those of the controller's model.

    Only computed torque with an inexact model needs the latter.
    """
    evaluate(arm.true, q, qd, arm.motion)
    if arm.drive.kind == TORQUE and not arm.drive.exact:
        evaluate(arm.believed, q, qd, arm.expected)


@in_place
def update_gravity(arm: Arm, q: Array) -> None:
    """Compute the weight on the joints at q (n,).

    Controllers without a model of inertia compensate it.
    """
    if arm.drive.kind != TORQUE:
        for j in range(len(q)):
            arm.speed[j] = 0.0
        evaluate(arm.believed, q, arm.speed, arm.expected)
        for j in range(len(q)):
            arm.memory.gravity[j] = arm.expected.bias[j]


@in_place
def speed_error(arm: Arm, q: Array, qd: Array, j: int) -> float:
    """Return the error of a joint's speed loop: q̇_c − q̇ + κ (q_c − q)."""
    memory = arm.memory
    error: float = memory.qd_c[j] - qd[j] + arm.drive.outer * (memory.q_c[j] - q[j])
    return error


@in_place
def command_torque(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Write the torques that the controller commands at q and q̇ (n,) for the command q̈_c (n,)."""
    drive = arm.drive
    memory = arm.memory
    n = len(q)
    rate = drive.rate
    if drive.kind != TORQUE:
        for j in range(n):
            error = speed_error(arm, q, qd, j)
            torque = drive.weight[j] * (2.0 * rate * error + rate * rate * memory.integral[j])
            arm.commanded[j] = memory.gravity[j] + torque
        return
    for j in range(n):
        away = memory.q_c[j] - q[j]
        faster = memory.qd_c[j] - qd[j]
        arm.after[j] = command[j] + 2.0 * rate * faster + rate * rate * away
    M = arm.expected.M
    bias = arm.expected.bias
    if drive.exact:
        M = arm.motion.M
        bias = arm.motion.bias
    for i in range(n):
        arm.commanded[i] = bias[i]
        for j in range(n):
            arm.commanded[i] += M[max(i, j), min(i, j)] * arm.after[j]


@in_place
def transmit_torque(arm: Arm) -> None:
    """Apply saturation, dead time and lag to the commanded torques."""
    drive = arm.drive
    memory = arm.memory
    slots = len(arm.memory.under_way)
    at = memory.at[0]
    for j in range(len(arm.commanded)):
        memory.under_way[at, j] = min(max(arm.commanded[j], -drive.effort[j]), drive.effort[j])
    at = (at + 1) % slots
    memory.at[0] = at
    for j in range(len(arm.commanded)):
        memory.torque[j] += drive.share * (memory.under_way[at, j] - memory.torque[j])


@in_place
def advance_reference(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Advance the controller's reference and integral by a substep that begins at q and q̇ (n,)."""
    drive = arm.drive
    memory = arm.memory
    h = arm.h
    for j in range(len(command)):
        error = speed_error(arm, q, qd, j)
        memory.at_limit[j] += abs(arm.commanded[j]) > drive.effort[j]
        # anti-windup: the integral stops while the torque is at its limit
        if abs(arm.commanded[j]) <= drive.effort[j] or error * arm.commanded[j] < 0.0:
            memory.integral[j] += h * error
        speed = memory.qd_c[j] + h * command[j]
        memory.q_c[j] += h * memory.qd_c[j]
        if abs(speed) > drive.speed[j]:
            speed = np.copysign(drive.speed[j], speed)
            memory.q_c[j] += 0.5 * h * (speed - memory.qd_c[j])
        else:
            memory.q_c[j] += 0.5 * h * h * command[j]
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
def apply_friction(arm: Arm, qd: Array) -> None:
    """Write friction (n,) of a substep that begins with q̇ (n,), and q̈ (n,) at its beginning.

    The friction is that at the end of the substep, so that it can stop a joint but never reverse
    it. With v at the end, M (v − v_free) = −h τ_f(v), where τ_f lies within ± static friction if v
    = 0. The solution minimises a convex function and is found joint by joint.
    """
    drive = arm.drive
    M = arm.motion.M
    h = arm.h
    v = arm.speed
    n = len(qd)
    for j in range(n):
        arm.friction[j] = 0.0
    accelerate(arm.motion, arm.memory.torque, arm.friction, arm.acceleration)
    if not drive.has_friction:
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
            speed = np.copysign(max(left, 0.0) / (M[j, j] + h * drive.viscous[j]), pull)
            change = max(change, abs(speed - v[j]))
            v[j] = speed
        if change <= SETTLED * greatest:
            break
    for i in range(n):
        arm.friction[i] = 0.0
        for j in range(n):
            arm.friction[i] += M[max(i, j), min(i, j)] * (arm.after[j] - v[j]) / h
    accelerate(arm.motion, arm.memory.torque, arm.friction, arm.acceleration)


@in_place
def verlet(arm: Arm, q: Array, qd: Array, command: Array) -> None:
    """Integrate a substep by the Verlet method, and compute inertia and bias at its end.

    q⁺ = q + h q̇ + ½h² q̈, q̇⁺ = q̇ + ½h (q̈ + q̈⁺), where q̈⁺ is evaluated at the speed q̇ + h q̈.
    The method is of second order with one evaluation, and exact for constant accelerations. A
    controller whose torque acts at once is continuous: q̈⁺ contains the torque that it commands at
    the end. Otherwise the torque is held.
    """
    h = arm.h
    for j in range(len(q)):
        q[j] += h * qd[j] + 0.5 * h * h * arm.acceleration[j]
        arm.speed[j] = qd[j] + h * arm.acceleration[j]
    update_motion(arm, q, arm.speed)
    if arm.drive.at_once:
        command_torque(arm, q, arm.speed, command)
        transmit_torque(arm)
    accelerate(arm.motion, arm.memory.torque, arm.friction, arm.after)
    for j in range(len(q)):
        qd[j] += 0.5 * h * (arm.acceleration[j] + arm.after[j])


@in_place
def runge_kutta(arm: Arm, q: Array, qd: Array) -> None:
    """Integrate a substep by the classical fourth-order Runge–Kutta method.

    Torque and friction are held.
    """
    h = arm.h
    n = len(q)
    a = arm.stages
    for j in range(n):
        a[0, j] = arm.acceleration[j]
    for i in range(3):
        share, bend = STAGES[i]
        earlier = max(i - 1, 0)
        for j in range(n):
            arm.commanded[j] = q[j] + share * h * qd[j] + bend * h * h * a[earlier, j]
            arm.speed[j] = qd[j] + share * h * a[i, j]
        evaluate(arm.true, arm.commanded, arm.speed, arm.motion)
        accelerate(arm.motion, arm.memory.torque, arm.friction, a[i + 1])
    for j in range(n):
        q[j] += h * qd[j] + h * h / 6.0 * (a[0, j] + a[1, j] + a[2, j])
        qd[j] += h / 6.0 * (a[0, j] + 2.0 * a[1, j] + 2.0 * a[2, j] + a[3, j])
    update_motion(arm, q, qd)


@in_place
def drive(arm: Arm, q: Array, qd: Array, command: Array, first: bool) -> None:
    """Compute torques and friction of a substep, and q̈ at its beginning.

    ``first`` is true for the first substep of a period.
    """
    if first:
        update_gravity(arm, q)
    # torques that act at once were computed at the end of the previous substep
    if first or not arm.drive.at_once:
        command_torque(arm, q, qd, command)
        transmit_torque(arm)
    advance_reference(arm, q, qd, command)
    apply_friction(arm, qd)


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
    memory = arm.memory
    effort = arm.drive.effort
    update_gravity(arm, q)
    for j in range(len(q)):
        memory.q_c[j] = q[j]
        memory.qd_c[j] = qd[j]
        arm.speed[j] = 0.0
    update_motion(arm, q, qd)
    command_torque(arm, q, qd, arm.speed)
    for j in range(len(q)):
        memory.torque[j] = min(max(arm.commanded[j], -effort[j]), effort[j])
        for i in range(len(memory.under_way)):
            memory.under_way[i, j] = memory.torque[j]


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
