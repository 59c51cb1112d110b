"""What a joint's limits leave of its acceleration."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..rows import at_end as at_end
from . import formula

formula(at_end)


class JointLimits(NamedTuple):
    """Limits of a joint (compiled), or arrays (n,) of those of all joints (NumPy); infinite where
    there is none.

    |q̈| ≤ ``acceleration`` [rad/s² or m/s²], |q̈ − q̈_last| ≤ ``change`` from one sample to the next, and unless
    ``ranges`` is 0 range and speed [rad, rad/s or m, m/s], which takes bounded accelerations;
    ``period`` is T_s [s].
    """

    acceleration: Any
    change: Any
    q_min: Any
    q_max: Any
    qd_max: Any
    ranges: int
    period: float


@formula
def between(x: Any, least: Any, greatest: Any) -> Any:
    """What is nearest to x."""
    return np.minimum(np.maximum(x, least), greatest)


@formula
def actuator_box(last: Any, limits: JointLimits) -> tuple[Any, Any]:
    """Least and greatest q̈ that an actuator has after q̈_last: |q̈| ≤ a and |q̈ − q̈_last| ≤ j
    T_s.
    """
    a = limits.acceleration
    return between(last - limits.change, -a, a), between(last + limits.change, -a, a)


@formula
def stopping(left: Any, speed: Any, acceleration: Any, period: float) -> Any:
    """Greatest q̈ for a period T after which a joint can still stop before the end of its range, d
    = ``left`` away.

    After it the speed is w = q̇ + T q̈ and what is left is d − T (q̇ + w)/2. Where w ≥ 0, stopping
    takes w²/(2a) (Del Prete 2018, eq. 24): w² + a T w ≤ 2 a (d − T q̇/2). Where that leaves no w ≥
    0, the joint turns back within the period, by q̈ = −q̇²/(2d). A joint that is outside is
    stopped.
    """
    d = np.where(left < np.inf, left, 0.0)
    ahead = d - 0.5 * period * speed
    room = 4.0 * acceleration * np.maximum(ahead, 0.0)
    slowed = acceleration * period
    # the root of the quadratic, without a difference of two numbers that are nearly the same
    w = room / (slowed + np.sqrt(slowed * slowed + 2.0 * room))
    turning = np.where(d > 0.0, -speed * speed / (2.0 * np.where(d > 0.0, d, 1.0)), -speed / period)
    return np.where(left < np.inf, np.where(ahead >= 0.0, (w - speed) / period, turning), np.inf)


@formula
def joint_box(q: Any, qd: Any, last: Any, limits: JointLimits) -> tuple[Any, Any]:
    """Least and greatest q̈ now: what the actuator has, of that what keeps speed and range, or what
    is nearest to it.
    """
    least, greatest = actuator_box(last, limits)
    if limits.ranges == 0:
        return least, greatest
    a = limits.acceleration
    T = limits.period
    up = np.minimum(stopping(limits.q_max - q, qd, a, T), (limits.qd_max - qd) / T)
    down = np.minimum(stopping(q - limits.q_min, -qd, a, T), (limits.qd_max + qd) / T)
    up = between(up, least, greatest)
    return np.minimum(between(-down, least, greatest), up), up
