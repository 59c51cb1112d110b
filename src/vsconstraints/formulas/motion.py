"""Motion of displaced targets, of points carried by a body, and of a camera relative to a target.

Also distance and angle between two poses.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula
from .rotation import length, turn_about
from .vectors import Matrix, Vector, cross, minus, plus, rotate, vector


@formula
def displacement(t, velocity, amplitude, rate, phase) -> tuple[Any, Any, Any]:
    """Displacement d = v t + A (sin(ωt + ψ) − sin ψ) of one coordinate, and two derivatives."""
    angle = rate * t + phase
    sine = np.sin(angle)
    cosine = np.cos(angle)
    sine_at_start = np.sin(phase)
    d = velocity * t + amplitude * (sine - sine_at_start)
    d_dot = velocity + amplitude * rate * cosine
    d_ddot = -amplitude * rate * rate * sine
    return d, d_dot, d_ddot


@formula
def target_pose(t: float, angular_velocity, centre, moved) -> tuple[Matrix, Vector]:
    """R and t of the target's frame at time t: x ↦ R(x − c) + c + d.

    R is the rotation by ω t about c.
    """
    rate = length(angular_velocity)
    turning = rate if rate > 0.0 else 1.0
    omega_x, omega_y, omega_z = vector(angular_velocity)
    axis = (
        omega_x / turning,
        omega_y / turning,
        omega_z / turning,
    )
    angle_turned = rate * t
    sine = np.sin(angle_turned)
    cosine = np.cos(angle_turned)
    R = turn_about(axis, sine, cosine)
    centre_moved_by_turn = minus(centre, rotate(R, centre))
    origin = plus(centre_moved_by_turn, moved)
    return R, origin


@formula
def carried(r, velocity, omega, acceleration, alpha) -> tuple[Vector, Vector]:
    """Velocity and acceleration of a point of a body, at r from the body's origin.

    The origin moves with v and v̇, the body turns with ω and ω̇.
    """
    by_rotation = cross(omega, r)
    centripetal = cross(omega, by_rotation)
    point_velocity = plus(velocity, by_rotation)
    # v̇ + ω̇ × r + ω × (ω × r)
    x, y, z = vector(r)
    alpha_x, alpha_y, alpha_z = vector(alpha)
    without_centripetal = (
        acceleration[0] + alpha_y * z - alpha_z * y,
        acceleration[1] + alpha_z * x - alpha_x * z,
        acceleration[2] + alpha_x * y - alpha_y * x,
    )
    return point_velocity, plus(without_centripetal, centripetal)


@formula
def relative_twist(
    velocity, acceleration, omega, alpha, target_omega, away
) -> tuple[Vector, Vector, Vector, Vector]:
    """v, ω, v̇ and ω̇ of a camera relative to a target, in the base frame.

    The derivatives are those seen by an observer that turns with the camera. Inputs are ω, ω̇ and
    the motion of the camera's origin, less the motion of the target's displacement; the constant ω
    of the target; and the position ``away`` of the camera's origin from the target's centre.
    """
    by_target_rotation = cross(target_omega, away)
    v = minus(velocity, by_target_rotation)
    relative_omega = minus(omega, target_omega)
    # derivative of v in the base frame, less ω × v for an observer that turns with the camera
    v_rate = minus(acceleration, cross(target_omega, velocity))
    v_dot = minus(v_rate, cross(omega, v))
    omega_dot = plus(cross(omega, target_omega), alpha)
    return v, relative_omega, v_dot, omega_dot


@formula
def angle(squared_difference) -> Any:
    """Angle between two rotations [rad], from the squared Frobenius norm of their difference."""
    sine_of_half = np.sqrt(squared_difference / 8.0)
    half = np.arcsin(np.minimum(1.0, sine_of_half))
    return 2.0 * half


@formula
def pose_difference(R, t, other_R, other_t) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses, each a rotation and an origin."""
    squared_distance = 0.0
    squared_difference = 0.0
    for i in range(3):
        offset = t[i] - other_t[i]
        squared_distance += offset**2
        for j in range(3):
            squared_difference += (R[i][j] - other_R[i][j]) ** 2
    return np.sqrt(squared_distance), angle(squared_difference)


@formula
def reached(distance, turn, away, speed, tolerance, by_pose: bool) -> Any:
    """True if a goal is reached and the arm is at rest.

    The goal is reached by distance [m] and angle [rad] of the camera (``by_pose``), or else by
    markers [px] alone. ``speed`` is that of the fastest joint [rad/s or m/s]; ``tolerance`` (4,)
    holds the tolerances of all four.
    """
    at_rest = speed <= tolerance[3]
    if not by_pose:
        return (away <= tolerance[2]) & at_rest
    is_near = distance <= tolerance[0]
    is_turned = turn <= tolerance[1]
    return is_near & is_turned & at_rest
