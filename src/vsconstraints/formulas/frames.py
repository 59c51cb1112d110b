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
    return R[0, 0] * x[0] + R[0, 1] * x[1], R[1, 0] * x[0] + R[1, 1] * x[1]


@formula
def rotate_inverse_in_image(R: Any, x: Any) -> tuple[Any, Any]:
    """Rᵀ x with R (2, 2) or larger."""
    return R[0, 0] * x[0] + R[1, 0] * x[1], R[0, 1] * x[0] + R[1, 1] * x[1]


@formula
def differences_in_image(function: Callable[..., Any], parameters: Any, y: Any, v: Any) -> Any:
    """ẏᵀ H ẏ at y = (u, v), ẏ = (u̇, v̇), by central differences of a gradient along ẏ."""
    h = IN_IMAGE / np.maximum(np.sqrt(v[0] * v[0] + v[1] * v[1]), TINY)
    ahead = function(y[0] + h * v[0], y[1] + h * v[1], *parameters)
    behind = function(y[0] - h * v[0], y[1] - h * v[1], *parameters)
    return ((ahead[1] - behind[1]) * v[0] + (ahead[2] - behind[2]) * v[1]) / (2.0 * h)


@formula
def differences_in_space(function: Callable[..., Any], parameters: Any, y: Any, v: Any) -> Any:
    """ẏᵀ H ẏ at y = (x, y, z) by central differences of a formula's gradient along ẏ."""
    h = IN_SPACE / np.maximum(np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), TINY)
    ahead = function(y[0] + h * v[0], y[1] + h * v[1], y[2] + h * v[2], *parameters)
    behind = function(y[0] - h * v[0], y[1] - h * v[1], y[2] - h * v[2], *parameters)
    change = (
        (ahead[1] - behind[1]) * v[0]
        + (ahead[2] - behind[2]) * v[1]
        + (ahead[3] - behind[3]) * v[2]
    )
    return change / (2.0 * h)
