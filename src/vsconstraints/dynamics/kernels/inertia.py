"""Inertia and bias of an arm with mass, compiled: M(q) and h(q, q̇) of M q̈ + h = τ.

All quantities are expressed in the base frame, twists and wrenches (force and moment) about its
origin, so that the wrenches of bodies can be added directly. The wrench that moves the bodies
behind a joint, projected on its axis, gives the bias (recursive Newton–Euler). Their momentum gives
the inertia in the same way if the joint alone moves them (composite rigid bodies). Pinocchio's
``crba`` and ``nonLinearEffects``, which compiled code cannot call, give the same results:
``test_inertia_and_bias_are_pinocchios`` in ``tests/test_dynamics.py``.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...compiled.compiler import in_place
from ...compiled.kinematics import put, turned_by_joint
from ...formulas.vectors import (
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
from ...rows import Array
from .arm import TORQUE, Arm, BodyArrays, Motion

#: Entries of a symmetric matrix (6,).
XX, XY, XZ, YY, YZ, ZZ = range(6)


@in_place
def factor(M: Array, L: Array) -> None:
    """Write the Cholesky factor of M (n, n), with the inverses of its diagonal.

    Only the lower half of M is used.
    """
    for j in range(len(M)):
        squared_pivot = M[j, j]
        for k in range(j):
            squared_pivot -= L[j, k] * L[j, k]
        # NaN if M is not positive definite: the speeds become NaN as well, which is detected
        inverse = math.nan
        if squared_pivot > 0.0:
            inverse = 1.0 / np.sqrt(squared_pivot)
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
def symmetric_product(S: Array, v: Vector) -> Vector:
    """Return S v for a symmetric matrix S with the entries :data:`XX` to :data:`ZZ`."""
    xx = S[XX]
    xy = S[XY]
    xz = S[XZ]
    yy = S[YY]
    yz = S[YZ]
    zz = S[ZZ]
    rows = (
        (xx, xy, xz),
        (xy, yy, yz),
        (xz, yz, zz),
    )
    return rotate(rows, v)


@in_place
def write_rotated_inertia(inertia: Matrix, R: Matrix, S: Array) -> None:
    """Write the inertia of a body with the orientation R in the base frame, R I Rᵀ."""
    RI = product(R, inertia)
    S[XX] = dot(RI[0], R[0])
    S[XY] = dot(RI[0], R[1])
    S[XZ] = dot(RI[0], R[2])
    S[YY] = dot(RI[1], R[1])
    S[YZ] = dot(RI[1], R[2])
    S[ZZ] = dot(RI[2], R[2])


@in_place
def move_inertia_to_origin(S: Array, m: float, centre: Vector) -> None:
    """Turn an inertia about the centre of a mass m into that about the base's origin.

    This is Steiner's theorem.
    """
    x, y, z = centre
    S[XX] += m * (y * y + z * z)
    S[XY] -= m * x * y
    S[XZ] -= m * x * z
    S[YY] += m * (x * x + z * z)
    S[YZ] -= m * y * z
    S[ZZ] += m * (x * x + y * y)


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

    Rotation R and origin, angular velocity ω and acceleration α = ω̇, and acceleration of the
    origin, each for q̈ = 0. The last one includes that of the base, which stands for gravity.
    """

    R: Matrix
    origin: Vector
    omega: Vector
    alpha: Vector
    acceleration: Vector


@in_place
def acceleration_at(frame: Frame, r: Vector) -> Vector:
    """Return the acceleration of a body's point at r from its origin: a + α × r + ω × (ω × r)."""
    tangential = cross(frame.alpha, r)
    by_rotation = cross(frame.omega, r)
    centripetal = cross(frame.omega, by_rotation)
    return plus(frame.acceleration, plus(tangential, centripetal))


@in_place
def next_frame(bodies: BodyArrays, i: int, q: float, qd: float, frame: Frame, link: Any) -> Frame:
    """Return the frame of body i behind its joint, from that of the body before.

    Write the twist of the body about the base's origin, for q̇ = 1 of this joint alone, to
    ``link``.
    """
    is_prismatic = bodies.prismatic[i]
    axis = vector(bodies.axis[i])
    placement = matrix(bodies.R[i])
    R, z = turned_by_joint(frame.R, placement, axis, is_prismatic, q)
    displacement = q if is_prismatic else 0.0
    to_joint = rotate(frame.R, vector(bodies.t[i]))
    r = add_scaled(to_joint, displacement, z)
    origin = plus(frame.origin, r)
    # the previous body carries the frame's origin, and turns the axis
    acceleration = acceleration_at(frame, r)
    axis_rate = cross(frame.omega, z)
    omega = frame.omega
    alpha = frame.alpha
    if is_prismatic:
        acceleration = add_scaled(acceleration, 2.0 * qd, axis_rate)
        velocity = z
        turn = (0.0, 0.0, 0.0)
    else:
        alpha = add_scaled(alpha, qd, axis_rate)
        omega = add_scaled(omega, qd, z)
        velocity = cross(origin, z)
        turn = z
    put(velocity, link.velocity)
    put(turn, link.turn)
    return Frame(R, origin, omega, alpha, acceleration)


@in_place
def write_wrench_and_mass(bodies: BodyArrays, i: int, frame: Frame, link: Any) -> None:
    """Write the wrench that moves body i, its mass, first moment and inertia to the link.

    The wrench is for q̈ = 0. All but the force and the mass are about the base's origin.
    """
    m = bodies.mass[i]
    from_origin = rotate(frame.R, vector(bodies.centre[i]))
    centre = plus(frame.origin, from_origin)
    force = times(m, acceleration_at(frame, from_origin))
    put(force, link.force)
    # moment about the centre: I α + ω × I ω
    write_rotated_inertia(matrix(bodies.inertia[i]), frame.R, link.inertia)
    of_alpha = symmetric_product(link.inertia, frame.alpha)
    angular_momentum = symmetric_product(link.inertia, frame.omega)
    of_omega = cross(frame.omega, angular_momentum)
    about_centre = plus(of_alpha, of_omega)
    moment = plus(about_centre, cross(centre, force))
    put(moment, link.moment)
    link.mass = m
    put(times(m, centre), link.first_moment)
    move_inertia_to_origin(link.inertia, m, centre)


@in_place
def project_on_joints(bodies: BodyArrays, motion: Motion) -> None:
    """Write bias and inertia (its lower half) from wrench and momentum of the bodies behind joints.

    A link first holds wrench and mass of its body alone, then also those of the bodies behind it.
    """
    links = motion.links
    n = len(motion.bias)
    for i in range(n - 1, -1, -1):
        link = links[i]
        if i + 1 < n:
            add_link(link, links[i + 1])
        velocity = vector(link.velocity)
        turn = vector(link.turn)
        force = vector(link.force)
        moment = vector(link.moment)
        motion.bias[i] = dot(velocity, force) + dot(turn, moment)
        # momentum of all bodies behind the joint if it alone moves, with speed 1
        first_moment = vector(link.first_moment)
        linear_by_velocity = times(link.mass, velocity)
        linear_by_turn = cross(turn, first_moment)
        linear = plus(linear_by_velocity, linear_by_turn)
        angular_by_turn = symmetric_product(link.inertia, turn)
        angular_by_velocity = cross(first_moment, velocity)
        angular = plus(angular_by_turn, angular_by_velocity)
        for j in range(i + 1):
            other_velocity = vector(links[j].velocity)
            other_turn = vector(links[j].turn)
            motion.M[i, j] = dot(other_velocity, linear) + dot(other_turn, angular)
        motion.M[i, i] += bodies.rotor[i]


@in_place
def evaluate(bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
    """Write M(q) (its lower half), h(q, q̇) and the factor of M."""
    R = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    origin = (0.0, 0.0, 0.0)
    omega = (0.0, 0.0, 0.0)
    alpha = (0.0, 0.0, 0.0)
    # gravity is an upward acceleration of the base
    acceleration = times(-1.0, vector(bodies.gravity))
    frame = Frame(R, origin, omega, alpha, acceleration)
    for i in range(len(q)):
        link = motion.links[i]
        frame = next_frame(bodies, i, q[i], qd[i], frame, link)
        write_wrench_and_mass(bodies, i, frame, link)
    project_on_joints(bodies, motion)
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
    if arm.drive.kind == TORQUE:
        return
    for j in range(len(q)):
        arm.speed[j] = 0.0
    # without motion, the bias is the weight
    evaluate(arm.believed, q, arm.speed, arm.expected)
    for j in range(len(q)):
        arm.memory.gravity[j] = arm.expected.bias[j]
