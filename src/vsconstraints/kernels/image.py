"""What a camera sees of one marker, and how that moves: eq. (24) and its derivative."""

from __future__ import annotations

from ..rows import Array
from .compiler import in_place
from .kinematics import cross


@in_place
def marker_motion(P: Array, twist: Array, scratch: Array, out: Array) -> None:
    """Write x, y, ẋ, ẏ, ẍ, ÿ (with q̈ = 0) and Z of a marker to ``out`` (7,).

    Parameters
    ----------
    P
        (3,) the marker in the camera frame [m].
    twist
        (4, 3) v, ω, v̇ and ω̇ of the camera relative to the marker, in its own axes.
    scratch
        (3, 3).
    out
        (7,).
    """
    # a fixed point seen from a moving frame: Ṗ = −v − ω × P and P̈ = −v̇ − ω̇ × P − ω × Ṗ
    rate, bend, turn = scratch[0], scratch[1], scratch[2]
    cross(P, twist[1], rate)
    for i in range(3):
        rate[i] -= twist[0, i]
    cross(P, twist[3], bend)
    cross(rate, twist[1], turn)
    Z = P[2]
    for i in range(2):
        x = P[i] / Z
        x_dot = (rate[i] - x * rate[2]) / Z
        out[i], out[2 + i] = x, x_dot
        drift, depth_drift = bend[i] + turn[i] - twist[2, i], bend[2] + turn[2] - twist[2, 2]
        out[4 + i] = (drift - x * depth_drift - 2.0 * x_dot * rate[2]) / Z
    out[6] = Z


@in_place
def interaction(a: float, b: float, x: float, y: float, Z: float, out: Array) -> None:
    """Write (a, b) L_sx of eq. (24), by which v and by which ω is multiplied, to ``out`` (2, 3)."""
    along = a * x + b * y
    out[0, 0] = -a / Z
    out[0, 1] = -b / Z
    out[0, 2] = along / Z
    out[1, 0] = along * y + b
    out[1, 1] = -along * x - a
    out[1, 2] = a * y - b * x


@in_place
def pulled(pull: Array, Jc: Array, j: int) -> float:
    """Product of :func:`interaction` with column j of the Jacobian (6, n) of the camera's twist."""
    total = 0.0
    for i in range(3):
        total += pull[0, i] * Jc[i, j] + pull[1, i] * Jc[3 + i, j]
    return total
