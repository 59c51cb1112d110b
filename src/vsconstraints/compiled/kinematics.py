"""Kinematics of a serial chain in the base frame: pose and motion of every joint for q̈ = 0.

Body 0 is the base; joint i moves body i. Pinocchio, which compiled code cannot call, computes the
same in :mod:`vsconstraints.robots.kinematics`: ``test_every_robot_and_constraint_in_every_world``
compares the two.
"""

from __future__ import annotations

import numpy as np

from ..formulas.motion import carried
from ..formulas.rotation import turn_about
from ..formulas.vectors import (
    Matrix,
    Vector,
    add_scaled,
    cross,
    matrix,
    minus,
    product,
    rotate,
    vector,
)
from ..rows import Array
from .compiler import in_place
from .workspace import Step


@in_place
def put(x: Vector, out: Array) -> None:
    """Write a vector to ``out`` (3,)."""
    out[0] = x[0]
    out[1] = x[1]
    out[2] = x[2]


@in_place
def put_matrix(A: Matrix, out: Array) -> None:
    """Write a matrix to ``out`` (3, 3)."""
    put(A[0], out[0])
    put(A[1], out[1])
    put(A[2], out[2])


@in_place
def place(step: Step, q: Array) -> None:
    """Write orientation, origin and axis of every body at q (n,), after its joint has moved."""
    for i in range(len(q)):
        joint = step.joints[i]
        before = step.bodies[i]
        body = step.bodies[i + 1]
        axis = vector(joint.axis)
        R = matrix(before.R)
        placement = matrix(joint.R)
        along = 0.0
        if joint.prismatic:
            along = q[i]
        else:
            placement = product(placement, turn_about(axis, np.sin(q[i]), np.cos(q[i])))
        turn = product(R, placement)
        r = rotate(R, vector(joint.t))
        # a rotation about the axis does not change the axis
        axis = rotate(turn, axis)
        put_matrix(turn, body.R)
        put(axis, body.axis)
        body.origin[0] = before.origin[0] + r[0] + along * axis[0]
        body.origin[1] = before.origin[1] + r[1] + along * axis[1]
        body.origin[2] = before.origin[2] + r[2] + along * axis[2]


@in_place
def move(step: Step, q: Array, qd: Array) -> None:
    """Write pose and motion of every body at q and q̇ (n,), with q̈ = 0."""
    place(step, q)
    for i in range(len(q)):
        prismatic = step.joints[i].prismatic
        before = step.bodies[i]
        body = step.bodies[i + 1]
        along = qd[i] if prismatic else 0.0
        about = 0.0 if prismatic else qd[i]
        axis = vector(body.axis)
        omega = vector(before.angular_velocity)
        velocity, acceleration = carried(
            minus(vector(body.origin), vector(before.origin)),
            vector(before.velocity),
            omega,
            vector(before.acceleration),
            vector(before.angular_acceleration),
        )
        # ω × z: rate of the axis
        turning = cross(omega, axis)
        put(add_scaled(omega, about, axis), body.angular_velocity)
        put(
            add_scaled(vector(before.angular_acceleration), about, turning),
            body.angular_acceleration,
        )
        put(add_scaled(velocity, along, axis), body.velocity)
        put(add_scaled(acceleration, 2.0 * along, turning), body.acceleration)


@in_place
def point_jacobian(step: Step, body: int, point: Vector, J: Array) -> None:
    """Write ∂(position)/∂q (3, n) of a point fixed to a body to ``J``."""
    for m in range(J.shape[1]):
        joint = step.bodies[m + 1]
        column = (0.0, 0.0, 0.0)
        if m < body:
            column = vector(joint.axis)
            if not step.joints[m].prismatic:
                column = cross(column, minus(point, vector(joint.origin)))
        J[0, m], J[1, m], J[2, m] = column
