"""Single rotations: rotation about an axis, rotation vector of a matrix, and its derivative."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import formula
from .vectors import Matrix, Vector, add_to_diagonal, dot, outer, plus, rotate, times

TURN = 2.0 * math.pi
IDENTITY = 1e-12  #: Angle [rad] below which a rotation has no axis.
AMBIGUOUS = 1e-6  #: Distance [rad] from θ = π within which the axis may have either sign.


@formula
def whole_turns(angle) -> Any:
    """Multiple of 2π [rad] that brings an angle into [−π, π] when it is subtracted.

    It is 0 for an angle in that interval.
    """
    return TURN * np.rint(angle / TURN)


@formula
def length(x) -> float:
    """‖x‖₂."""
    return math.sqrt(dot(x, x))


@formula
def turn_about(axis, s: float, c: float) -> Matrix:
    """I + s [u]× + (1 − c) [u]×²: rotation about the unit vector u with sine s and cosine c."""
    x = axis[0]
    y = axis[1]
    z = axis[2]
    versine = 1.0 - c
    xx = versine * x * x
    yy = versine * y * y
    zz = versine * z * z
    xy = versine * x * y
    yz = versine * y * z
    zx = versine * z * x
    sx = s * x
    sy = s * y
    sz = s * z
    return (
        (c + xx, xy - sz, zx + sy),
        (xy + sz, c + yy, yz - sx),
        (zx - sy, yz + sx, c + zz),
    )


@formula
def turn_by(w) -> Matrix:
    """exp([w]×): rotation by ‖w‖ about w."""
    theta = length(w)
    inverse = 1.0 / theta if theta > 0.0 else 0.0
    axis = times(inverse, w)
    sine = math.sin(theta)
    cosine = math.cos(theta)
    return turn_about(axis, sine, cosine)


@formula
def quaternion(R: Matrix) -> tuple[Vector, Any]:
    """Vector part and real part of a rotation's quaternion, up to a common factor.

    They are computed from the largest component, which is accurate for every angle.
    """
    xx, xy, xz = R[0]
    yx, yy, yz = R[1]
    zx, zy, zz = R[2]
    trace = xx + yy + zz
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        vector = (zy - yz, xz - zx, yx - xy)
        real = 1.0 + trace
    elif largest == xx:
        vector = (1.0 - trace + 2.0 * xx, yx + xy, zx + xz)
        real = zy - yz
    elif largest == yy:
        vector = (xy + yx, 1.0 - trace + 2.0 * yy, zy + yz)
        real = xz - zx
    else:
        vector = (xz + zx, yz + zy, 1.0 - trace + 2.0 * zz)
        real = yx - xy
    return vector, real


@formula
def largest_component(w) -> Any:
    """Component of the largest magnitude, with its sign."""
    largest = w[0]
    if abs(w[1]) > abs(largest):
        largest = w[1]
    if abs(w[2]) > abs(largest):
        largest = w[2]
    return largest


@formula
def rotation_vector(R: Matrix, near, continues: bool) -> Vector:
    """θu with exp([θu]×) = R.

    If ``continues`` is set, it is the one of θu, (θ − 2π)u, (θ + 2π)u, … closest to ``near``, so
    that a sequence of calls stays continuous, also through θ = π. Otherwise θ ≤ π, and at π the
    largest component of the axis is positive.
    """
    vector, real = quaternion(R)
    sine = length(vector)
    theta = 2.0 * math.atan2(sine, abs(real))
    scale = 0.0 if sine == 0.0 else theta / sine
    scale = -scale if real < 0.0 else scale
    w = times(scale, vector)
    factor = 1.0
    if continues:
        if theta < IDENTITY:
            # R = I has no axis: if the last rotation vector was a whole turn, its axis is kept
            last_angle = length(near)
            if last_angle > math.pi:
                whole_turn = TURN * round(last_angle / TURN)
                w = times(whole_turn / last_angle, near)
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
    numerator = 1.0 - half * cot
    c = numerator / s
    # the numerator's derivative is (θ/4) (1 + cot²(θ/2)) − ½ cot(θ/2)
    squared_cosecant = 1.0 + cot * cot
    numerator_slope = 0.5 * half * squared_cosecant - 0.5 * cot
    slope = numerator_slope / s - 2.0 * c / theta
    return c, slope / theta


@formula
def with_half_cross(L: Matrix, x) -> Matrix:
    """L + ½[x]×."""
    xx, xy, xz = L[0]
    yx, yy, yz = L[1]
    zx, zy, zz = L[2]
    half = times(0.5, x)
    return (
        (xx, xy - half[2], xz + half[1]),
        (yx + half[2], yy, yz - half[0]),
        (zx - half[1], zy + half[0], zz),
    )


@formula
def changing_row(c_dot_x, c, x, x_dot, w, w_dot) -> Vector:
    """Derivative of the row c x wᵀ of the matrix c w wᵀ, in which x is a component of w."""
    outer_rate = plus(times(x_dot, w), times(x, w_dot))
    return plus(times(c_dot_x, w), times(c, outer_rate))


@formula
def rotation_vector_rate(w, omega) -> tuple[Vector, Matrix, Matrix]:
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
    symmetric = add_to_diagonal(outer(cw, w), rest)
    L = with_half_cross(symmetric, w)
    w_dot = rotate(L, omega)
    # its derivative: ċ w wᵀ + c (ẇ wᵀ + w ẇᵀ) − (c θ²)˙ I
    along = dot(w, w_dot)
    c_dot = slope * along
    c_dot_w = times(c_dot, w)
    rest_rate = c_dot * squared_angle + 2.0 * c * along
    rows = (
        changing_row(c_dot_w[0], c, w[0], w_dot[0], w, w_dot),
        changing_row(c_dot_w[1], c, w[1], w_dot[1], w, w_dot),
        changing_row(c_dot_w[2], c, w[2], w_dot[2], w, w_dot),
    )
    symmetric_dot = add_to_diagonal(rows, -rest_rate)
    L_dot = with_half_cross(symmetric_dot, w_dot)
    return w_dot, L, L_dot
