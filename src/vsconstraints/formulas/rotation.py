"""Single rotations: rotation about an axis, rotation vector of a matrix, and its derivative."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import formula
from .vectors import Matrix, Vector, dot, rotate

TURN = 2.0 * math.pi


@formula
def whole_turns(angle: Any) -> Any:
    """Multiple of 2π [rad] that brings an angle into [−π, π] when it is subtracted.

    It is 0 for an angle in that interval.
    """
    return TURN * np.rint(angle / TURN)


@formula
def length(x: Any) -> float:
    """‖x‖₂."""
    return math.sqrt(dot(x, x))


@formula
def turn_about(axis: Any, s: float, c: float) -> Matrix:
    """I + s [u]× + (1 − c) [u]×²: rotation about the unit vector u with sine s and cosine c."""
    x = axis[0]
    y = axis[1]
    z = axis[2]
    xy = (1.0 - c) * x * y
    yz = (1.0 - c) * y * z
    zx = (1.0 - c) * z * x
    return (
        (c + (1.0 - c) * x * x, xy - s * z, zx + s * y),
        (xy + s * z, c + (1.0 - c) * y * y, yz - s * x),
        (zx - s * y, yz + s * x, c + (1.0 - c) * z * z),
    )


@formula
def turn_by(w: Any) -> Matrix:
    """exp([w]×): rotation by ‖w‖ about w."""
    theta = length(w)
    share = 1.0 / theta if theta > 0.0 else 0.0
    return turn_about((share * w[0], share * w[1], share * w[2]), math.sin(theta), math.cos(theta))


@formula
def rotation_vector(R: Matrix, near: Any, continues: bool) -> Vector:
    """θu with exp([θu]×) = R.

    If ``continues`` is set, it is the one of θu, (θ − 2π)u, (θ + 2π)u, … closest to ``near``, so
    that a sequence of calls stays continuous, also through θ = π. Otherwise θ ≤ π, and at π the
    largest component of the axis is positive.
    """
    # quaternion (w, real) by its largest component, which is accurate for every angle
    xx = R[0][0]
    yy = R[1][1]
    zz = R[2][2]
    trace = xx + yy + zz
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        w = (R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1])
        real = 1.0 + trace
    elif largest == xx:
        w = (1.0 - trace + 2.0 * xx, R[1][0] + R[0][1], R[2][0] + R[0][2])
        real = R[2][1] - R[1][2]
    elif largest == yy:
        w = (R[0][1] + R[1][0], 1.0 - trace + 2.0 * yy, R[2][1] + R[1][2])
        real = R[0][2] - R[2][0]
    else:
        w = (R[0][2] + R[2][0], R[1][2] + R[2][1], 1.0 - trace + 2.0 * zz)
        real = R[1][0] - R[0][1]
    sine = length(w)
    theta = 2.0 * math.atan2(sine, abs(real))
    share = 0.0 if sine == 0.0 else theta / sine
    share = -share if real < 0.0 else share
    w = (w[0] * share, w[1] * share, w[2] * share)
    factor = 1.0
    if continues:
        if theta < 1e-12:
            # R = I has no axis: if the last rotation vector was a whole turn, its axis is kept
            before = length(near)
            if before > math.pi:
                whole = TURN * round(before / TURN) / before
                w = (near[0] * whole, near[1] * whole, near[2] * whole)
        else:
            factor += TURN * round((dot(near, w) / theta - theta) / TURN) / theta
    elif theta > math.pi - 1e-6:
        # near θ = π the sign of the axis is ambiguous: its largest component is made positive
        greatest = w[0]
        greatest = w[1] if abs(w[1]) > abs(greatest) else greatest
        greatest = w[2] if abs(w[2]) > abs(greatest) else greatest
        factor -= TURN / theta if greatest < 0.0 else 0.0
    return w[0] * factor, w[1] * factor, w[2] * factor


@formula
def cotangent_coefficient(theta: float) -> tuple[float, float]:
    """c(θ) = (1 − (θ/2) cot(θ/2)) / θ² and c'(θ) / θ.

    The series used below θ = 0.1 is exact to rounding (1e-13).
    """
    theta2 = theta * theta
    if theta < 0.1:
        c = 1.0 / 12.0 + theta2 * (1.0 / 720.0 + theta2 * (1.0 / 30240.0 + theta2 / 1209600.0))
        slope = 1.0 / 360.0 + theta2 * (
            1.0 / 7560.0 + theta2 * (1.0 / 201600.0 + theta2 / 5987520.0)
        )
        return c, slope
    half = 0.5 * theta
    cot = 1.0 / math.tan(half)
    c = (1.0 - half * cot) / theta2
    return c, ((0.5 * half * (1.0 + cot * cot) - 0.5 * cot) / theta2 - 2.0 * c / theta) / theta


@formula
def with_half_cross(L: Matrix, x: Any) -> Matrix:
    """L + ½[x]×."""
    return (
        (L[0][0], L[0][1] - 0.5 * x[2], L[0][2] + 0.5 * x[1]),
        (L[1][0] + 0.5 * x[2], L[1][1], L[1][2] - 0.5 * x[0]),
        (L[2][0] - 0.5 * x[1], L[2][1] + 0.5 * x[0], L[2][2]),
    )


@formula
def rotation_vector_rate(w: Any, omega: Any) -> tuple[Vector, Matrix, Matrix]:
    """ẇ = L ω of the rotation vector w = θu of R if Ṙ = R [ω]×, L, and its derivative along ω.

    L = I + ½[w]× + c(θ)[w]×², c(θ) = (1 − sinc θ / sinc²(θ/2)) / θ² (eq. 44 and its reference),
    [w]×² = w wᵀ − θ² I. The middle term is positive because ω is expressed in the current, rotating
    frame.
    """
    theta = length(w)
    theta2 = theta * theta
    c, slope = cotangent_coefficient(theta)
    cw = (c * w[0], c * w[1], c * w[2])
    rest = 1.0 - c * theta2
    outer = (
        (cw[0] * w[0] + rest, cw[0] * w[1], cw[0] * w[2]),
        (cw[1] * w[0], cw[1] * w[1] + rest, cw[1] * w[2]),
        (cw[2] * w[0], cw[2] * w[1], cw[2] * w[2] + rest),
    )
    L = with_half_cross(outer, w)
    w_dot = rotate(L, omega)
    along = dot(w, w_dot)
    c_dot = slope * along
    c_dot_w = (c_dot * w[0], c_dot * w[1], c_dot * w[2])
    turn = c_dot * theta2 + 2.0 * c * along
    x, y, z = w
    u, v, r = w_dot
    a, b, d = c_dot_w
    outer_dot = (
        (
            a * x + c * (u * x + x * u) - turn,
            a * y + c * (u * y + x * v),
            a * z + c * (u * z + x * r),
        ),
        (
            b * x + c * (v * x + y * u),
            b * y + c * (v * y + y * v) - turn,
            b * z + c * (v * z + y * r),
        ),
        (
            d * x + c * (r * x + z * u),
            d * y + c * (r * y + z * v),
            d * z + c * (r * z + z * r) - turn,
        ),
    )
    return w_dot, L, with_half_cross(outer_dot, w_dot)
