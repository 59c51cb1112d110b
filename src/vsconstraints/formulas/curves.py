"""Implicit curves in the image.

Each curve has a formula for its value and derivatives at pixels (u, v), and one for its second
derivative along (u̇, v̇).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula

#: Value at (u, v), and its derivatives with respect to u and v.
ValueAndSlopes = tuple[Any, Any, Any]


@formula
def power(x, n: float) -> Any:
    """Power xⁿ for x ≥ 0 and a number n; by repeated squaring for whole n from 0 to 64."""
    count = int(n) if 0.0 <= n <= 64.0 else 0
    if count != n:
        return x**n
    # multiply the x^(2^k) of the binary digits of n
    result = x**0.0
    while count > 0:
        if count & 1:
            result = result * x
        x = x * x
        count >>= 1
    return result


@formula
def superellipse(u, v, a, b, n) -> ValueAndSlopes:
    """|u/a|ⁿ + |v/b|ⁿ − 1 and its derivatives (eqs. 20 and 23)."""
    x = np.abs(u) / a
    y = np.abs(v) / b
    x_slope = power(x, n - 1.0)
    y_slope = power(y, n - 1.0)
    x_power = x_slope * x
    y_power = y_slope * y
    value = x_power + y_power - 1.0
    du = n / a * np.sign(u) * x_slope
    dv = n / b * np.sign(v) * y_slope
    return value, du, dv


@formula
def superellipse_curvature(u, v, a, b, n, u_dot, v_dot) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`superellipse`."""
    x = np.abs(u) / a
    y = np.abs(v) / b
    x_bend = power(x, n - 2.0)
    y_bend = power(y, n - 2.0)
    x_dot = u_dot / a
    y_dot = v_dot / b
    bending = x_bend * x_dot**2 + y_bend * y_dot**2
    factor = n * (n - 1.0)
    return factor * bending


@formula
def hyperellipse(u, v, a, b, n) -> ValueAndSlopes:
    """Superellipse obstacle: minus :func:`superellipse`, positive inside."""
    value, du, dv = superellipse(u, v, a, b, n)
    return -value, -du, -dv


@formula
def hyperellipse_curvature(u, v, a, b, n, u_dot, v_dot) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`hyperellipse`."""
    return -superellipse_curvature(u, v, a, b, n, u_dot, v_dot)


@formula
def circle(u, v, r) -> ValueAndSlopes:
    """1 − (u² + v²)/r² and its derivatives."""
    squared_distance = u * u + v * v
    squared_radius = r * r
    value = 1.0 - squared_distance / squared_radius
    du = -2.0 * u / squared_radius
    dv = -2.0 * v / squared_radius
    return value, du, dv


@formula
def circle_curvature(u, v, r, u_dot, v_dot) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`circle`."""
    squared_speed = u_dot * u_dot + v_dot * v_dot
    factor = -2.0 / (r * r)
    return factor * squared_speed


@formula
def bowl(u, v, r, w) -> ValueAndSlopes:
    """1 − r⁻² (w² u² + (v − u²)²) and its derivatives (eq. 45)."""
    d = v - u * u
    scaled_u = w * u
    squared_distance = scaled_u**2 + d * d
    squared_radius = r * r
    value = 1.0 - squared_distance / squared_radius
    factor = -2.0 / squared_radius
    half_slope_u = w * w * u - 2.0 * u * d
    du = factor * half_slope_u
    dv = factor * d
    return value, du, dv


@formula
def bowl_curvature(u, v, r, w, u_dot, v_dot) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`bowl`."""
    d = v - u * u
    d_dot = v_dot - 2.0 * u * u_dot
    scaled_rate = w * u_dot
    by_slopes = scaled_rate**2 + d_dot * d_dot
    by_curvature_of_d = 2.0 * d * u_dot * u_dot
    bending = by_slopes - by_curvature_of_d
    factor = -2.0 / (r * r)
    return factor * bending


@formula
def heart(u, v, r, w) -> ValueAndSlopes:
    """1 − r⁻² (w² u² + (v − |u|)²) and its derivatives (eq. 46).

    At u = 0 the derivatives are the mean of both sides.
    """
    d = v - np.abs(u)
    scaled_u = w * u
    squared_distance = scaled_u**2 + d * d
    squared_radius = r * r
    value = 1.0 - squared_distance / squared_radius
    factor = -2.0 / squared_radius
    half_slope_u = w * w * u - np.sign(u) * d
    du = factor * half_slope_u
    dv = factor * d
    return value, du, dv


@formula
def heart_curvature(u, v, r, w, u_dot, v_dot) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`heart`."""
    d_dot = v_dot - np.sign(u) * u_dot
    scaled_rate = w * u_dot
    bending = scaled_rate**2 + d_dot * d_dot
    factor = -2.0 / (r * r)
    return factor * bending
