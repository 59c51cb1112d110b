"""Rotations in the image plane, and curvature along a motion by central differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from . import formula
from .vectors import Vector, dot, minus, plus, times

IN_IMAGE = 1e-4  #: Step of the differences along a velocity: in the image [px], in space [m].
IN_SPACE = 1e-6
TINY = 1e-300  #: Speed below which a motion counts as none, so that nothing is divided by zero.


@formula
def rotate_in_image(R, x) -> tuple[Any, Any]:
    """R x with R (2, 2) or larger."""
    u = x[0]
    v = x[1]
    return (
        R[0, 0] * u + R[0, 1] * v,
        R[1, 0] * u + R[1, 1] * v,
    )


@formula
def rotate_inverse_in_image(R, x) -> tuple[Any, Any]:
    """Rᵀ x with R (2, 2) or larger."""
    u = x[0]
    v = x[1]
    return (
        R[0, 0] * u + R[1, 0] * v,
        R[0, 1] * u + R[1, 1] * v,
    )


@formula
def differences_in_image(function: Callable[..., Any], parameters, y, velocity) -> Any:
    """ẏᵀ H ẏ at y = (u, v), by central differences of a formula's gradient along the velocity ẏ."""
    u = y[0]
    v = y[1]
    u_dot = velocity[0]
    v_dot = velocity[1]
    squared_speed = u_dot * u_dot + v_dot * v_dot
    speed = np.sqrt(squared_speed)
    h = IN_IMAGE / np.maximum(speed, TINY)
    du = h * u_dot
    dv = h * v_dot
    _, ahead_u, ahead_v = function(u + du, v + dv, *parameters)
    _, behind_u, behind_v = function(u - du, v - dv, *parameters)
    change_u = ahead_u - behind_u
    change_v = ahead_v - behind_v
    change = change_u * u_dot + change_v * v_dot
    return change / (2.0 * h)


@formula
def differences_in_space(function: Callable[..., Any], parameters, y, velocity) -> Any:
    """ẏᵀ H ẏ at y = (x, y, z), by central differences of a formula's gradient along ẏ."""
    speed = np.sqrt(dot(velocity, velocity))
    h = IN_SPACE / np.maximum(speed, TINY)
    step = times(h, velocity)
    ahead = gradient_in_space(function, parameters, plus(y, step))
    behind = gradient_in_space(function, parameters, minus(y, step))
    gradient_change = minus(ahead, behind)
    change = dot(gradient_change, velocity)
    return change / (2.0 * h)


@formula
def gradient_in_space(function: Callable[..., Any], parameters, y) -> Vector:
    """Gradient of a formula at y = (x, y, z)."""
    _, by_x, by_y, by_z = function(y[0], y[1], y[2], *parameters)
    return by_x, by_y, by_z
