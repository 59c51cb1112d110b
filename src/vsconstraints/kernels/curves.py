"""Image constraints at one pixel: values, gradients and second derivatives of the shared formulas."""

from __future__ import annotations

from ..formulas import curves as formulas
from ..rows import Array
from .compiler import in_place
from .layout import BOWL, CIRCLE, FIELD_OF_VIEW, HYPERELLIPSE

circle, circle_curvature = in_place(formulas.circle), in_place(formulas.circle_curvature)
bowl, bowl_curvature = in_place(formulas.bowl), in_place(formulas.bowl_curvature)
heart, heart_curvature = in_place(formulas.heart), in_place(formulas.heart_curvature)
superellipse, superellipse_curvature = in_place(formulas.superellipse), in_place(formulas.superellipse_curvature)


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
