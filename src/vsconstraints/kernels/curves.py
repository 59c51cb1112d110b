"""Image constraints at one pixel: values, gradients and second derivatives of the shared formulas."""

from __future__ import annotations

import math

import numpy as np

from ..constraints import formulas
from ..rows import Array
from .compiler import in_place
from .layout import BOWL, CIRCLE, FIELD_OF_VIEW, HYPERELLIPSE

circle, circle_curvature = in_place(formulas.circle), in_place(formulas.circle_curvature)
bowl, bowl_curvature = in_place(formulas.bowl), in_place(formulas.bowl_curvature)
heart, heart_curvature = in_place(formulas.heart), in_place(formulas.heart_curvature)


@in_place
def power(x: float, n: float) -> float:
    """Power xⁿ, x ≥ 0: by products for small whole n."""
    count = int(n) if 0.0 <= n <= 64.0 else -1
    if count != n:
        return math.pow(x, n)
    result = 1.0
    while count > 0:
        if count & 1:
            result *= x
        x *= x
        count >>= 1
    return result


@in_place
def superellipse(u: float, v: float, a: float, b: float, n: float) -> tuple[float, float, float]:
    """As :func:`vsconstraints.constraints.formulas.superellipse`."""
    x, y = abs(u) / a, abs(v) / b
    X, Y = power(x, n - 1.0), power(y, n - 1.0)
    return X * x + Y * y - 1.0, n / a * np.sign(u) * X, n / b * np.sign(v) * Y


@in_place
def superellipse_curvature(u: float, v: float, a: float, b: float, n: float, u_dot: float, v_dot: float) -> float:
    """As :func:`vsconstraints.constraints.formulas.superellipse_curvature`."""
    X, Y = power(abs(u) / a, n - 2.0), power(abs(v) / b, n - 2.0)
    bent: float = n * (n - 1.0) * (X * (u_dot / a) ** 2 + Y * (v_dot / b) ** 2)
    return bent


@in_place
def curve(kind: int, F: Array, at: int, u: float, v: float) -> tuple[float, float, float]:
    """Value and derivatives of an image constraint at one pixel; ``at`` is where its parameters begin."""
    if kind == FIELD_OF_VIEW:
        return superellipse(u, v, F[at], F[at + 1], F[at + 2])
    cu, cv, co, si, margin = F[at], F[at + 1], F[at + 2], F[at + 3], F[at + 4]
    x, y = co * (u - cu) + si * (v - cv), -si * (u - cu) + co * (v - cv)
    if kind == CIRCLE:
        value, dx, dy = circle(x, y, F[at + 5])
    elif kind == HYPERELLIPSE:
        value, dx, dy = superellipse(x, y, F[at + 5], F[at + 6], F[at + 7])
        value, dx, dy = -value, -dx, -dy
    elif kind == BOWL:
        value, dx, dy = bowl(x, y, F[at + 5], F[at + 6])
    else:
        value, dx, dy = heart(x, y, F[at + 5], F[at + 6])
    return value + margin, co * dx - si * dy, si * dx + co * dy


@in_place
def curve_curvature(kind: int, F: Array, at: int, u: float, v: float, ud: float, vd: float) -> float:
    """ẏᵀ H ẏ of an image constraint, exactly."""
    bent: float
    if kind == FIELD_OF_VIEW:
        bent = superellipse_curvature(u, v, F[at], F[at + 1], F[at + 2], ud, vd)
        return bent
    cu, cv, co, si = F[at], F[at + 1], F[at + 2], F[at + 3]
    x, y = co * (u - cu) + si * (v - cv), -si * (u - cu) + co * (v - cv)
    xd, yd = co * ud + si * vd, -si * ud + co * vd
    if kind == CIRCLE:
        bent = circle_curvature(x, y, F[at + 5], xd, yd)
    elif kind == HYPERELLIPSE:
        bent = -superellipse_curvature(x, y, F[at + 5], F[at + 6], F[at + 7], xd, yd)
    elif kind == BOWL:
        bent = bowl_curvature(x, y, F[at + 5], F[at + 6], xd, yd)
    else:
        bent = heart_curvature(x, y, F[at + 5], F[at + 6], xd, yd)
    return bent
