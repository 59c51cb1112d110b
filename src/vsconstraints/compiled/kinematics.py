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
    plus,
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
def camera_twist(step: Step) -> tuple[Vector, Vector, Vector, Vector]:
    """Return v, ω, v̇ and ω̇ of the camera relative to the target, in the camera's axes."""
    eye = step.eye[0]
    v = vector(eye.velocity)
    omega = vector(eye.angular_velocity)
    v_dot = vector(eye.acceleration)
    omega_dot = vector(eye.angular_acceleration)
    return v, omega, v_dot, omega_dot


@in_place
def camera_column(step: Step, j: int) -> tuple[Vector, Vector]:
    """Return v and ω of the camera for q̇ⱼ = 1: a column of its Jacobian."""
    column = step.camera_J[:, j]
    return vector(column[:3]), vector(column[3:])


@in_place
def turned_by_joint(
    before_R: Matrix, placement: Matrix, joint_axis: Vector, prismatic: bool, q: float
) -> tuple[Matrix, Vector]:
    """Return orientation and joint axis of a body in the base frame, with its joint at q.

    ``before_R`` is the orientation of the body before it, ``placement`` that of the joint in it at
    q = 0, and ``joint_axis`` the axis in the frame of the joint.
    """
    if not prismatic:
        turn = turn_about(joint_axis, np.sin(q), np.cos(q))
        placement = product(placement, turn)
    R = product(before_R, placement)
    # a rotation about the axis does not change the axis
    return R, rotate(R, joint_axis)


@in_place
def place(step: Step, q: Array) -> None:
    """Write orientation, origin and axis of every body at q (n,), after its joint has moved."""
    for i in range(len(q)):
        joint = step.joints[i]
        before = step.bodies[i]
        body = step.bodies[i + 1]
        joint_axis = vector(joint.axis)
        before_R = matrix(before.R)
        displacement = 0.0
        if joint.prismatic:
            displacement = q[i]
        R, axis = turned_by_joint(before_R, matrix(joint.R), joint_axis, joint.prismatic, q[i])
        to_joint = rotate(before_R, vector(joint.t))
        joint_origin = plus(vector(before.origin), to_joint)
        put_matrix(R, body.R)
        put(axis, body.axis)
        put(add_scaled(joint_origin, displacement, axis), body.origin)


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
        r = minus(vector(body.origin), vector(before.origin))
        v = vector(before.velocity)
        omega = vector(before.angular_velocity)
        v_dot = vector(before.acceleration)
        omega_dot = vector(before.angular_acceleration)
        velocity, acceleration = carried(r, v, omega, v_dot, omega_dot)
        axis_rate = cross(omega, axis)
        put(add_scaled(omega, about, axis), body.angular_velocity)
        put(add_scaled(omega_dot, about, axis_rate), body.angular_acceleration)
        put(add_scaled(velocity, along, axis), body.velocity)
        put(add_scaled(acceleration, 2.0 * along, axis_rate), body.acceleration)


@in_place
def point_jacobian(step: Step, body: int, point: Vector, J: Array) -> None:
    """Write ∂(position)/∂q (3, n) of a point fixed to a body to ``J``."""
    for m in range(J.shape[1]):
        joint = step.bodies[m + 1]
        axis = vector(joint.axis)
        if m >= body:
            # the joint is behind the body
            column = (0.0, 0.0, 0.0)
        elif step.joints[m].prismatic:
            column = axis
        else:
            column = cross(axis, minus(point, vector(joint.origin)))
        put(column, J[:, m])
