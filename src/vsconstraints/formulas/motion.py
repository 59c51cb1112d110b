"""How things move, a point carried by a body, a camera relative to a target; and how far poses are from each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula
from .rotation import length, turn_about
from .vectors import Matrix, Vector, cross, minus, turned


@formula
def displacement(t: Any, velocity: Any, amplitude: Any, rate: Any, phase: Any) -> tuple[Any, Any, Any]:
    """D = v t + A (sin(ωt + ψ) − sin ψ) of one coordinate, and its first and second derivative."""
    angle = rate * t + phase
    s, c, s0 = np.sin(angle), np.cos(angle), np.sin(phase)
    return velocity * t + amplitude * (s - s0), velocity + amplitude * rate * c, -amplitude * rate * rate * s


@formula
def target_pose(t: float, angular_velocity: Any, centre: Any, moved: Any) -> tuple[Matrix, Vector]:
    """R and t of the target's frame at time t: x ↦ R(x − c) + c + d, with R the turn by ω t about c."""
    rate = length(angular_velocity)
    turning = rate if rate > 0.0 else 1.0
    axis = (angular_velocity[0] / turning, angular_velocity[1] / turning, angular_velocity[2] / turning)
    R = turn_about(axis, np.sin(rate * t), np.cos(rate * t))
    back = turned(R, centre)
    position = (
        centre[0] - back[0] + moved[0],
        centre[1] - back[1] + moved[1],
        centre[2] - back[2] + moved[2],
    )
    return R, position


@formula
def carried(r: Any, velocity: Any, omega: Any, acceleration: Any, alpha: Any) -> tuple[Vector, Vector]:
    """Velocity and acceleration of a point at r from a body's origin, which moves with v, ω, v̇ and ω̇."""
    s = cross(omega, r)
    inwards = cross(omega, s)
    return (
        (velocity[0] + s[0], velocity[1] + s[1], velocity[2] + s[2]),
        (
            acceleration[0] + alpha[1] * r[2] - alpha[2] * r[1] + inwards[0],
            acceleration[1] + alpha[2] * r[0] - alpha[0] * r[2] + inwards[1],
            acceleration[2] + alpha[0] * r[1] - alpha[1] * r[0] + inwards[2],
        ),
    )


@formula
def relative_twist(
    velocity: Any, acceleration: Any, omega: Any, alpha: Any, target_omega: Any, away: Any
) -> tuple[Vector, Vector, Vector, Vector]:
    """v, ω, v̇ and ω̇ of a camera relative to a target, as seen by who turns with the camera, in the base frame.

    Parameters
    ----------
    velocity, acceleration
        Of the camera's origin, less those of the target's displacement.
    omega, alpha
        ω and ω̇ of the camera.
    target_omega
        ω of the target, which is constant.
    away
        The camera's origin from the target's centre.
    """
    with_target, turning = cross(target_omega, away), cross(target_omega, velocity)
    v = minus(velocity, with_target)
    own = cross(omega, v)
    twist = cross(omega, target_omega)
    return (
        v,
        minus(omega, target_omega),
        (
            acceleration[0] - turning[0] - own[0],
            acceleration[1] - turning[1] - own[1],
            acceleration[2] - turning[2] - own[2],
        ),
        (twist[0] + alpha[0], twist[1] + alpha[1], twist[2] + alpha[2]),
    )


@formula
def angle(squared_difference: Any) -> Any:
    """Angle between two rotations [rad], from the sum of the squared differences of their matrices."""
    return 2.0 * np.arcsin(np.minimum(1.0, np.sqrt(squared_difference / 8.0)))


@formula
def reached(distance: Any, turn: Any, away: Any, speed: Any, tolerance: Any, by_pose: bool) -> Any:
    """Whether a goal is reached: by distance [m] and angle [rad] of the camera, or by markers [px] alone; and at rest.

    At rest is the arm whose fastest joint has no more than ``speed`` [rad/s or m/s]; ``tolerance`` (4,) are those of
    all four.
    """
    there = (distance <= tolerance[0]) & (turn <= tolerance[1]) if by_pose else away <= tolerance[2]
    return there & (speed <= tolerance[3])
