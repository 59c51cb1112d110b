"""Values and gradients of constraint functions, elementwise: for arrays of points, and compiled for single ones.

Each function takes coordinates as separate numbers or arrays and returns σ and its partial derivatives.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def superellipse(u: Any, v: Any, a: Any, b: Any, n: Any) -> tuple[Any, Any, Any]:
    """|u/a|ⁿ + |v/b|ⁿ − 1 and its derivatives (eqs. 20 and 23)."""
    x, y = np.abs(u) / a, np.abs(v) / b
    X, Y = x ** (n - 1.0), y ** (n - 1.0)
    return X * x + Y * y - 1.0, n / a * np.sign(u) * X, n / b * np.sign(v) * Y


def superellipse_curvature(u: Any, v: Any, a: Any, b: Any, n: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`superellipse`."""
    x, y = np.abs(u) / a, np.abs(v) / b
    return n * (n - 1.0) * (x ** (n - 2.0) * (u_dot / a) ** 2 + y ** (n - 2.0) * (v_dot / b) ** 2)


def circle(u: Any, v: Any, r: Any) -> tuple[Any, Any, Any]:
    """1 − (u² + v²)/r² and its derivatives."""
    return 1.0 - (u * u + v * v) / (r * r), -2.0 * u / (r * r), -2.0 * v / (r * r)


def circle_curvature(u: Any, v: Any, r: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`circle`."""
    return -2.0 / (r * r) * (u_dot * u_dot + v_dot * v_dot)


def bowl(u: Any, v: Any, r: Any, w: Any) -> tuple[Any, Any, Any]:
    """1 − r⁻² (w² u² + (v − u²)²) and its derivatives (eq. 45)."""
    d, s = v - u * u, -2.0 / (r * r)
    return 1.0 - ((w * u) ** 2 + d * d) / (r * r), s * (w * w * u - 2.0 * u * d), s * d


def bowl_curvature(u: Any, v: Any, r: Any, w: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`bowl`."""
    d, d_dot = v - u * u, v_dot - 2.0 * u * u_dot
    return -2.0 / (r * r) * ((w * u_dot) ** 2 + d_dot * d_dot - 2.0 * d * u_dot * u_dot)


def heart(u: Any, v: Any, r: Any, w: Any) -> tuple[Any, Any, Any]:
    """1 − r⁻² (w² u² + (v − |u|)²) and its derivatives, at u = 0 the mean of both sides (eq. 46)."""
    d, s = v - np.abs(u), -2.0 / (r * r)
    return 1.0 - ((w * u) ** 2 + d * d) / (r * r), s * (w * w * u - np.sign(u) * d), s * d


def heart_curvature(u: Any, v: Any, r: Any, w: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`heart`."""
    d_dot = v_dot - np.sign(u) * u_dot
    return -2.0 / (r * r) * ((w * u_dot) ** 2 + d_dot * d_dot)


def sphere(x: Any, y: Any, z: Any, r: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Depth in a sphere r − ‖p‖, its derivatives (eqs. 47 and 48), and ‖p‖; at the centre the direction out is +z."""
    d = np.sqrt(x * x + y * y + z * z)
    inside = d > 0.0
    s = -1.0 / np.where(inside, d, 1.0)
    return r - d, s * x, s * y, np.where(inside, s * z, -1.0), d


def sphere_curvature(x: Any, y: Any, z: Any, x_dot: Any, y_dot: Any, z_dot: Any) -> Any:
    """ṗᵀ H ṗ of :func:`sphere`: −(‖ṗ‖² − (ṗ·n)²)/‖p‖, n the direction out."""
    d = np.maximum(np.sqrt(x * x + y * y + z * z), 1e-9)
    radial = (x * x_dot + y * y_dot + z * z_dot) / d
    return -(x_dot * x_dot + y_dot * y_dot + z_dot * z_dot - radial * radial) / d
