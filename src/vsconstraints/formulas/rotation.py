"""Single rotations: rotation about an axis, rotation vector of a matrix, and its derivative."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import formula
from .vectors import Matrix, Vector, dot, rotate, times

TURN = 2.0 * math.pi
IDENTITY = 1e-12  #: Angle [rad] below which a rotation has no axis.
AMBIGUOUS = 1e-6  #: Distance [rad] from θ = π within which the axis may have either sign.


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
    xx = (1.0 - c) * x * x
    yy = (1.0 - c) * y * y
    zz = (1.0 - c) * z * z
    xy = (1.0 - c) * x * y
    yz = (1.0 - c) * y * z
    zx = (1.0 - c) * z * x
    return (
        (c + xx, xy - s * z, zx + s * y),
        (xy + s * z, c + yy, yz - s * x),
        (zx - s * y, yz + s * x, c + zz),
    )


@formula
def turn_by(w: Any) -> Matrix:
    """exp([w]×): rotation by ‖w‖ about w."""
    theta = length(w)
    inverse = 1.0 / theta if theta > 0.0 else 0.0
    axis = times(inverse, w)
    return turn_about(axis, math.sin(theta), math.cos(theta))


@formula
def quaternion(R: Matrix) -> tuple[Vector, Any]:
    """Vector part and real part of a rotation's quaternion, up to a common factor.

    They are computed from the largest component, which is accurate for every angle.
    """
    xx = R[0][0]
    yy = R[1][1]
    zz = R[2][2]
    trace = xx + yy + zz
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        vector = (R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1])
        real = 1.0 + trace
    elif largest == xx:
        vector = (1.0 - trace + 2.0 * xx, R[1][0] + R[0][1], R[2][0] + R[0][2])
        real = R[2][1] - R[1][2]
    elif largest == yy:
        vector = (R[0][1] + R[1][0], 1.0 - trace + 2.0 * yy, R[2][1] + R[1][2])
        real = R[0][2] - R[2][0]
    else:
        vector = (R[0][2] + R[2][0], R[1][2] + R[2][1], 1.0 - trace + 2.0 * zz)
        real = R[1][0] - R[0][1]
    return vector, real


@formula
def largest_component(w: Any) -> Any:
    """Component of the largest magnitude, with its sign."""
    largest = w[0]
    if abs(w[1]) > abs(largest):
        largest = w[1]
    if abs(w[2]) > abs(largest):
        largest = w[2]
    return largest


@formula
def rotation_vector(R: Matrix, near: Any, continues: bool) -> Vector:
    """θu with exp([θu]×) = R.

    If ``continues`` is set, it is the one of θu, (θ − 2π)u, (θ + 2π)u, … closest to ``near``, so
    that a sequence of calls stays continuous, also through θ = π. Otherwise θ ≤ π, and at π the
    largest component of the axis is positive.
    """
    vector, real = quaternion(R)
    sine = length(vector)
    theta = 2.0 * math.atan2(sine, abs(real))
    share = 0.0 if sine == 0.0 else theta / sine
    share = -share if real < 0.0 else share
    w = times(share, vector)
    factor = 1.0
    if continues:
        if theta < IDENTITY:
            # R = I has no axis: if the last rotation vector was a whole turn, its axis is kept
            last_angle = length(near)
            if last_angle > math.pi:
                w = times(TURN * round(last_angle / TURN) / last_angle, near)
        else:
            angle_near = dot(near, w) / theta
            turns = round((angle_near - theta) / TURN)
            factor += TURN * turns / theta
    elif theta > math.pi - AMBIGUOUS and largest_component(w) < 0.0:
        factor -= TURN / theta
    return times(factor, w)


@formula
def cotangent_coefficient(theta: float) -> tuple[float, float]:
    """c(θ) = (1 − (θ/2) cot(θ/2)) / θ² and c'(θ) / θ.

    The series used below θ = 0.1 is exact to rounding (1e-13).
    """
    s = theta * theta
    if theta < 0.1:
        c = 1.0 / 12.0 + s * (1.0 / 720.0 + s * (1.0 / 30240.0 + s / 1209600.0))
        slope = 1.0 / 360.0 + s * (1.0 / 7560.0 + s * (1.0 / 201600.0 + s / 5987520.0))
        return c, slope
    half = 0.5 * theta
    cot = 1.0 / math.tan(half)
    c = (1.0 - half * cot) / s
    # the numerator's derivative is (θ/4) (1 + cot²(θ/2)) − ½ cot(θ/2)
    numerator_slope = 0.5 * half * (1.0 + cot * cot) - 0.5 * cot
    slope = numerator_slope / s - 2.0 * c / theta
    return c, slope / theta


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
    squared_angle = theta * theta
    c, slope = cotangent_coefficient(theta)
    # I + c [w]×² = c w wᵀ + (1 − c θ²) I
    cw = times(c, w)
    rest = 1.0 - c * squared_angle
    symmetric = (
        (cw[0] * w[0] + rest, cw[0] * w[1], cw[0] * w[2]),
        (cw[1] * w[0], cw[1] * w[1] + rest, cw[1] * w[2]),
        (cw[2] * w[0], cw[2] * w[1], cw[2] * w[2] + rest),
    )
    L = with_half_cross(symmetric, w)
    w_dot = rotate(L, omega)
    # its derivative: ċ w wᵀ + c (ẇ wᵀ + w ẇᵀ) − (c θ²)˙ I
    along = dot(w, w_dot)
    c_dot = slope * along
    c_dot_w = times(c_dot, w)
    rest_rate = c_dot * squared_angle + 2.0 * c * along
    x, y, z = w
    x_dot, y_dot, z_dot = w_dot
    a, b, d = c_dot_w
    symmetric_dot = (
        (
            a * x + c * (x_dot * x + x * x_dot) - rest_rate,
            a * y + c * (x_dot * y + x * y_dot),
            a * z + c * (x_dot * z + x * z_dot),
        ),
        (
            b * x + c * (y_dot * x + y * x_dot),
            b * y + c * (y_dot * y + y * y_dot) - rest_rate,
            b * z + c * (y_dot * z + y * z_dot),
        ),
        (
            d * x + c * (z_dot * x + z * x_dot),
            d * y + c * (z_dot * y + z * y_dot),
            d * z + c * (z_dot * z + z * z_dot) - rest_rate,
        ),
    )
    L_dot = with_half_cross(symmetric_dot, w_dot)
    return w_dot, L, L_dot
