"""Bounds on a joint's acceleration that follow from its limits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..rows import at_end as at_end
from . import formula, where

formula(at_end)


class JointLimits(NamedTuple):
    """Limits of one joint (compiled), or arrays (n,) for all joints (NumPy); infinite if unlimited.

    |q̈| ≤ ``acceleration`` [rad/s² or m/s²], |q̈ − q̈_last| ≤ ``change`` from one sample to the
    next and, unless ``ranges`` is 0, range and speed [rad, rad/s or m, m/s]. Limits of range and
    speed require bounded accelerations. ``period`` is T_s [s].
    """

    acceleration: Any
    change: Any
    q_min: Any
    q_max: Any
    qd_max: Any
    ranges: int
    period: float


@formula
def between(x, least, greatest) -> Any:
    """Clip x to [least, greatest]."""
    return np.minimum(np.maximum(x, least), greatest)


@formula
def actuator_box(last, limits: JointLimits) -> tuple[Any, Any]:
    """Least and greatest q̈ of an actuator after q̈_last: |q̈| ≤ a and |q̈ − q̈_last| ≤ j T_s."""
    a = limits.acceleration
    least = between(last - limits.change, -a, a)
    greatest = between(last + limits.change, -a, a)
    return least, greatest


@formula
def stopping(left, speed, acceleration, period: float) -> Any:
    """Greatest q̈ for a period T after which a joint can still stop within its range.

    The end of the range is d = ``left`` away. After the period the speed is w = q̇ + T q̈ and the
    remaining distance d − T (q̇ + w)/2. If w ≥ 0, stopping takes w²/(2a) (Del Prete 2018, eq. 24):
    w² + a T w ≤ 2 a (d − T q̇/2). If no w ≥ 0 satisfies this, the joint turns back within the
    period, by q̈ = −q̇²/(2d). A joint outside its range is stopped.
    """
    d = where(left < np.inf, left, 0.0)
    half_a_period_ahead = 0.5 * period * speed
    ahead = d - half_a_period_ahead
    room = 4.0 * acceleration * np.maximum(ahead, 0.0)
    slowed = acceleration * period
    # root of the quadratic in a form without cancellation
    discriminant = slowed * slowed + 2.0 * room
    w = room / (slowed + np.sqrt(discriminant))
    slowing = (w - speed) / period
    is_inside = d > 0.0
    divisor = 2.0 * where(is_inside, d, 1.0)
    turning_back = -speed * speed / divisor
    stopping_at_once = -speed / period
    otherwise = where(is_inside, turning_back, stopping_at_once)
    bound = where(ahead >= 0.0, slowing, otherwise)
    return where(left < np.inf, bound, np.inf)


@formula
def joint_box(q, qd, last, limits: JointLimits) -> tuple[Any, Any]:
    """Least and greatest q̈ of a joint now.

    The box of the actuator is intersected with the bounds that keep speed and range. If the two do
    not overlap, the box shrinks to the actuator's acceleration nearest to those bounds.
    """
    least, greatest = actuator_box(last, limits)
    if limits.ranges == 0:
        return least, greatest
    a = limits.acceleration
    T = limits.period
    for_range_up = stopping(limits.q_max - q, qd, a, T)
    for_range_down = stopping(q - limits.q_min, -qd, a, T)
    for_speed_up = (limits.qd_max - qd) / T
    for_speed_down = (limits.qd_max + qd) / T
    demanded_up = np.minimum(for_range_up, for_speed_up)
    demanded_down = -np.minimum(for_range_down, for_speed_down)
    up = between(demanded_up, least, greatest)
    down = between(demanded_down, least, greatest)
    return np.minimum(down, up), up
