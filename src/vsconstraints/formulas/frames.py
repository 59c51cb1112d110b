"""Rotations in the image plane, and curvature along a motion by central differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from . import formula

IN_IMAGE = 1e-4  #: Step of the differences along a velocity: in the image [px], in space [m].
IN_SPACE = 1e-6
TINY = 1e-300  #: Speed below which a motion counts as none, so that nothing is divided by zero.


@formula
def rotate_in_image(R: Any, x: Any) -> tuple[Any, Any]:
    """R x with R (2, 2) or larger."""
    return (
        R[0, 0] * x[0] + R[0, 1] * x[1],
        R[1, 0] * x[0] + R[1, 1] * x[1],
    )


@formula
def rotate_inverse_in_image(R: Any, x: Any) -> tuple[Any, Any]:
    """Rᵀ x with R (2, 2) or larger."""
    return (
        R[0, 0] * x[0] + R[1, 0] * x[1],
        R[0, 1] * x[0] + R[1, 1] * x[1],
    )


@formula
def differences_in_image(function: Callable[..., Any], parameters: Any, y: Any, v: Any) -> Any:
    """ẏᵀ H ẏ at y = (u, v), by central differences of a formula's gradient along ẏ (``v``)."""
    speed = np.sqrt(v[0] * v[0] + v[1] * v[1])
    h = IN_IMAGE / np.maximum(speed, TINY)
    du = h * v[0]
    dv = h * v[1]
    _, ahead_u, ahead_v = function(y[0] + du, y[1] + dv, *parameters)
    _, behind_u, behind_v = function(y[0] - du, y[1] - dv, *parameters)
    change_u = ahead_u - behind_u
    change_v = ahead_v - behind_v
    change = change_u * v[0] + change_v * v[1]
    return change / (2.0 * h)


@formula
def differences_in_space(function: Callable[..., Any], parameters: Any, y: Any, v: Any) -> Any:
    """ẏᵀ H ẏ at y = (x, y, z), by central differences of a formula's gradient along ẏ (``v``)."""
    speed = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    h = IN_SPACE / np.maximum(speed, TINY)
    dx = h * v[0]
    dy = h * v[1]
    dz = h * v[2]
    _, ahead_x, ahead_y, ahead_z = function(y[0] + dx, y[1] + dy, y[2] + dz, *parameters)
    _, behind_x, behind_y, behind_z = function(y[0] - dx, y[1] - dy, y[2] - dz, *parameters)
    change_x = ahead_x - behind_x
    change_y = ahead_y - behind_y
    change_z = ahead_z - behind_z
    change = change_x * v[0] + change_y * v[1] + change_z * v[2]
    return change / (2.0 * h)
