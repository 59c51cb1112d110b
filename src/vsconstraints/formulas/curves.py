"""Implicit curves in the image.

Each curve has a formula for its value and derivatives at pixels (u, v), and one for its second
derivative along (u̇, v̇).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula


@formula
def power(x: Any, n: float) -> Any:
    """Power xⁿ for x ≥ 0 and a number n; by repeated multiplication for whole n from 0 to 64."""
    count = int(n) if 0.0 <= n <= 64.0 else 0
    if count != n:
        return x**n
    result = x**0.0
    while count > 0:
        if count & 1:
            result = result * x
        x = x * x
        count >>= 1
    return result


@formula
def superellipse(u: Any, v: Any, a: Any, b: Any, n: Any) -> tuple[Any, Any, Any]:
    """|u/a|ⁿ + |v/b|ⁿ − 1 and its derivatives (eqs. 20 and 23)."""
    x = np.abs(u) / a
    y = np.abs(v) / b
    X = power(x, n - 1.0)
    Y = power(y, n - 1.0)
    return X * x + Y * y - 1.0, n / a * np.sign(u) * X, n / b * np.sign(v) * Y


@formula
def superellipse_curvature(u: Any, v: Any, a: Any, b: Any, n: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`superellipse`."""
    X = power(np.abs(u) / a, n - 2.0)
    Y = power(np.abs(v) / b, n - 2.0)
    return n * (n - 1.0) * (X * (u_dot / a) ** 2 + Y * (v_dot / b) ** 2)


@formula
def hyperellipse(u: Any, v: Any, a: Any, b: Any, n: Any) -> tuple[Any, Any, Any]:
    """Superellipse obstacle: minus :func:`superellipse`, positive inside."""
    value, du, dv = superellipse(u, v, a, b, n)
    return -value, -du, -dv


@formula
def hyperellipse_curvature(u: Any, v: Any, a: Any, b: Any, n: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`hyperellipse`."""
    return -superellipse_curvature(u, v, a, b, n, u_dot, v_dot)


@formula
def circle(u: Any, v: Any, r: Any) -> tuple[Any, Any, Any]:
    """1 − (u² + v²)/r² and its derivatives."""
    return 1.0 - (u * u + v * v) / (r * r), -2.0 * u / (r * r), -2.0 * v / (r * r)


@formula
def circle_curvature(u: Any, v: Any, r: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`circle`."""
    return -2.0 / (r * r) * (u_dot * u_dot + v_dot * v_dot)


@formula
def bowl(u: Any, v: Any, r: Any, w: Any) -> tuple[Any, Any, Any]:
    """1 − r⁻² (w² u² + (v − u²)²) and its derivatives (eq. 45)."""
    d = v - u * u
    s = -2.0 / (r * r)
    return 1.0 - ((w * u) ** 2 + d * d) / (r * r), s * (w * w * u - 2.0 * u * d), s * d


@formula
def bowl_curvature(u: Any, v: Any, r: Any, w: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`bowl`."""
    d = v - u * u
    d_dot = v_dot - 2.0 * u * u_dot
    return -2.0 / (r * r) * ((w * u_dot) ** 2 + d_dot * d_dot - 2.0 * d * u_dot * u_dot)


@formula
def heart(u: Any, v: Any, r: Any, w: Any) -> tuple[Any, Any, Any]:
    """1 − r⁻² (w² u² + (v − |u|)²) and its derivatives (eq. 46).

    At u = 0 the derivatives are the mean of both sides.
    """
    d = v - np.abs(u)
    s = -2.0 / (r * r)
    return 1.0 - ((w * u) ** 2 + d * d) / (r * r), s * (w * w * u - np.sign(u) * d), s * d


@formula
def heart_curvature(u: Any, v: Any, r: Any, w: Any, u_dot: Any, v_dot: Any) -> Any:
    """(u̇, v̇) H (u̇, v̇)ᵀ of :func:`heart`."""
    d_dot = v_dot - np.sign(u) * u_dot
    return -2.0 / (r * r) * ((w * u_dot) ** 2 + d_dot * d_dot)
