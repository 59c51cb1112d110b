"""Visual features and their motion: projected points, markers, and the pose relative to a goal."""

from __future__ import annotations

from typing import Any, NamedTuple

from . import formula
from .rotation import rotation_vector, rotation_vector_rate
from .vectors import (
    Matrix,
    Vector,
    cross,
    minus,
    plus,
    rotate,
    rotate_inverse,
    transposed_product,
    vector,
)

MINIMUM_DEPTH = 1e-3  #: Depth [m] in front of the camera below which a marker cannot be projected.


@formula
def pose_error(
    goal_R: Matrix, goal_t, R: Matrix, t, near, continues: bool
) -> tuple[Matrix, Vector, Vector]:
    """c*R_C, c*t_C and θu of eq. (44) from two poses in the target's frame.

    See :func:`.rotation_vector` for ``near`` and ``continues``.
    """
    E = transposed_product(goal_R, R)
    from_goal = minus(t, goal_t)
    translation = rotate_inverse(goal_R, from_goal)
    theta_u = rotation_vector(E, near, continues)
    return E, translation, theta_u


@formula
def pose_rates(
    E: Matrix, L: Matrix, L_dot: Matrix, v, omega, v_dot, omega_dot
) -> tuple[Vector, Vector, Vector]:
    """First and second derivative of c*t_C, and second derivative of θu, with q̈ = 0.

    The camera's motion is given in its own axes. ``L`` and ``L_dot`` are those of
    :func:`.rotation_vector_rate`.
    """
    t_dot = rotate(E, v)
    acceleration = plus(v_dot, cross(omega, v))
    t_ddot = rotate(E, acceleration)
    theta_u_ddot = pair(L, omega_dot, L_dot, omega)
    return t_dot, t_ddot, theta_u_ddot


@formula
def pair(A: Matrix, x, B: Matrix, y) -> Vector:
    """A x + B y, summed column by column."""
    return (
        pair_of_rows(A[0], x, B[0], y),
        pair_of_rows(A[1], x, B[1], y),
        pair_of_rows(A[2], x, B[2], y),
    )


@formula
def pair_of_rows(a, x, b, y) -> Any:
    """Σᵢ aᵢ xᵢ + bᵢ yᵢ."""
    first = a[0] * x[0] + b[0] * y[0]
    second = a[1] * x[1] + b[1] * y[1]
    third = a[2] * x[2] + b[2] * y[2]
    return first + second + third


class PoseMotion(NamedTuple):
    """Error (t, θu) of a camera pose, eq. (44), with two derivatives for q̈ = 0.

    E = c*R_C leads the camera's v to ṫ, and L its ω to the derivative of θu.
    """

    E: Matrix
    L: Matrix
    t: Vector
    theta_u: Vector
    t_dot: Vector
    theta_u_dot: Vector
    t_ddot: Vector
    theta_u_ddot: Vector


@formula
def pose_motion(goal_R: Matrix, goal_t, R: Matrix, t, near, continues: bool, twist) -> PoseMotion:
    """Error of a pose relative to a goal, and its motion: see :func:`pose_error`.

    ``twist`` contains the camera's v, ω, v̇ and ω̇ relative to the target, in its own axes.
    """
    v, omega, v_dot, omega_dot = twist
    E, translation, theta_u = pose_error(goal_R, goal_t, R, t, near, continues)
    theta_u_dot, L, L_dot = rotation_vector_rate(theta_u, omega)
    t_dot, t_ddot, theta_u_ddot = pose_rates(E, L, L_dot, v, omega, v_dot, omega_dot)
    return PoseMotion(E, L, translation, theta_u, t_dot, theta_u_dot, t_ddot, theta_u_ddot)


@formula
def image_row(c: int, x, y, Z) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Row c of L_sx, eq. (24), at the normalised point (x, y) and depth Z."""
    # x for c = 0, y for c = 1
    of_x = 1.0 - c
    of_y = 1.0 * c
    linear, angular = interaction(of_x, of_y, x, y, Z)
    return linear + angular


@formula
def image_motion(P, v, omega, v_dot, omega_dot) -> tuple[Any, Any, Any, Any, Any, Any]:
    """x, y, ẋ, ẏ, ẍ, ÿ (with q̈ = 0) of a point P in the camera frame.

    ``v``, ``omega``, ``v_dot`` and ``omega_dot`` are the motion of the camera relative to the
    point.
    """
    # a fixed point seen from a moving frame: Ṗ = −v − ω × P and P̈ = −v̇ − ω̇ × P − ω × Ṗ
    by_rotation = cross(P, omega)
    P_dot = minus(by_rotation, v)
    by_angular_acceleration = cross(P, omega_dot)
    turning = plus(by_angular_acceleration, cross(P_dot, omega))
    P_ddot = minus(turning, v_dot)
    X, Y, Z = vector(P)
    X_dot, Y_dot, Z_dot = P_dot
    X_ddot, Y_ddot, Z_ddot = P_ddot
    x, x_dot, x_ddot = ratio(X, X_dot, X_ddot, Z, Z_dot, Z_ddot)
    y, y_dot, y_ddot = ratio(Y, Y_dot, Y_ddot, Z, Z_dot, Z_ddot)
    return x, y, x_dot, y_dot, x_ddot, y_ddot


@formula
def ratio(X, X_dot, X_ddot, Z, Z_dot, Z_ddot) -> tuple[Any, Any, Any]:
    """Quotient x = X/Z and two derivatives, from those of x Z = X."""
    x = X / Z
    x_dot = (X_dot - x * Z_dot) / Z
    numerator = X_ddot - x * Z_ddot - 2.0 * x_dot * Z_dot
    x_ddot = numerator / Z
    return x, x_dot, x_ddot


@formula
def interaction(a, b, x, y, Z) -> tuple[Vector, Vector]:
    """Rows (a, b) L_sx of eq. (24): the factors of the camera's v and of its ω."""
    along = a * x + b * y
    linear = (
        -a / Z,
        -b / Z,
        along / Z,
    )
    angular = (
        along * y + b,
        -along * x - a,
        a * y - b * x,
    )
    return linear, angular
