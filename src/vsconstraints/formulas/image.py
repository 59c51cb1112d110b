"""What a camera sees of a point, and how that moves: eq. (24) and its derivative."""

from __future__ import annotations

from typing import Any

from . import formula
from .vectors import Vector, cross


@formula
def image_motion(P: Any, v: Any, omega: Any, v_dot: Any, omega_dot: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
    """x, y, ẋ, ẏ, ẍ, ÿ (with q̈ = 0) of a point P in the camera frame, relative to which the camera moves."""
    # a fixed point seen from a moving frame: Ṗ = −v − ω × P and P̈ = −v̇ − ω̇ × P − ω × Ṗ
    swung = cross(P, omega)
    rate = (swung[0] - v[0], swung[1] - v[1], swung[2] - v[2])
    bent, turn = cross(P, omega_dot), cross(rate, omega)
    Z = P[2]
    x, y = P[0] / Z, P[1] / Z
    x_dot, y_dot = (rate[0] - x * rate[2]) / Z, (rate[1] - y * rate[2]) / Z
    depth_drift = bent[2] + turn[2] - v_dot[2]
    # twice the derivative of x Z = X
    x_ddot = (bent[0] + turn[0] - v_dot[0] - x * depth_drift - 2.0 * x_dot * rate[2]) / Z
    y_ddot = (bent[1] + turn[1] - v_dot[1] - y * depth_drift - 2.0 * y_dot * rate[2]) / Z
    return x, y, x_dot, y_dot, x_ddot, y_ddot


@formula
def interaction(a: Any, b: Any, x: Any, y: Any, Z: Any) -> tuple[Vector, Vector]:
    """(a, b) L_sx of eq. (24): by which the camera's v, and by which its ω, is multiplied."""
    along = a * x + b * y
    return (-a / Z, -b / Z, along / Z), (along * y + b, -along * x - a, a * y - b * x)
