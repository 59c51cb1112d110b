"""What a camera sees of one marker, and how that moves: eq. (24) and its derivative."""

from __future__ import annotations

from ..rows import Array
from .compiler import inner


@inner
def marker_motion(P: Array, v: Array, w: Array, dv: Array, dw: Array, out: Array) -> None:
    """Write x, y, ẋ, ẏ, ẍ, ÿ (with q̈ = 0) and Z of a marker at P in the camera frame to ``out`` (7,).

    The camera moves relative to the marker with the twist (v, w) and its derivative (dv, dw), in its own axes.
    """
    X, Y, Z = P[0], P[1], P[2]
    # a fixed point seen from a moving frame: Ṗ = −v − ω × P and P̈ = −v̇ − ω̇ × P − ω × Ṗ
    Xd = -v[0] - w[1] * Z + w[2] * Y
    Yd = -v[1] - w[2] * X + w[0] * Z
    Zd = -v[2] - w[0] * Y + w[1] * X
    Xdd = -dv[0] - dw[1] * Z + dw[2] * Y - w[1] * Zd + w[2] * Yd
    Ydd = -dv[1] - dw[2] * X + dw[0] * Z - w[2] * Xd + w[0] * Zd
    Zdd = -dv[2] - dw[0] * Y + dw[1] * X - w[0] * Yd + w[1] * Xd
    x, y = X / Z, Y / Z
    xd, yd = (Xd - x * Zd) / Z, (Yd - y * Zd) / Z
    out[0], out[1], out[2], out[3] = x, y, xd, yd
    out[4] = (Xdd - x * Zdd - 2.0 * xd * Zd) / Z
    out[5] = (Ydd - y * Zdd - 2.0 * yd * Zd) / Z
    out[6] = Z


@inner
def interaction_rows(x: float, y: float, Z: float, L: Array) -> None:
    """Write L_sx (2, 6) of eq. (24) to ``L``."""
    L[0, 0], L[0, 1], L[0, 2], L[0, 3], L[0, 4], L[0, 5] = -1.0 / Z, 0.0, x / Z, x * y, -1.0 - x * x, y
    L[1, 0], L[1, 1], L[1, 2], L[1, 3], L[1, 4], L[1, 5] = 0.0, -1.0 / Z, y / Z, 1.0 + y * y, -x * y, -x
