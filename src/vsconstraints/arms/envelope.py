"""Limits that each setpoint is checked against before it is sent, and a braked stop within them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..errors import ConfigurationError
from ..formulas.limits import JointLimits, joint_box
from ..robots.limits import ActuatorLimits
from ..robots.robot import Robot
from ..rows import Array

#: Fraction of a limit by which a setpoint may exceed it, because differences of positions are
#: rounded.
ROUNDING = 1e-6
AT_REST = 1e-9  #: Speed below which a joint counts as at rest [rad/s or m/s].


class Setpoint(NamedTuple):
    """Setpoint of an arm: (n,) coordinates, speeds and accelerations.

    The acceleration is held during the period.
    """

    q: Array
    qd: Array
    qdd: Array


@dataclass(frozen=True)
class Envelope:
    """Limits (n,) of setpoints, infinite where there is none; accelerations are always limited."""

    q_min: Array
    q_max: Array
    qd_max: Array
    acceleration: Array
    jerk: Array
    period: float  #: T_s [s].

    @classmethod
    def of(cls, robot: Robot, limits: ActuatorLimits, period: float) -> Envelope:
        """Combine the limits of the robot and of the scenario; the stricter one counts.

        The robot limits ranges, speeds, accelerations and jerks. Raises ConfigurationError if a
        joint's acceleration is not limited, because a stop must know how hard it may brake.
        """
        least = {
            name: np.minimum(robot.limits.of_joint(name, robot.n), limits.of_joint(name, robot.n))
            for name in ("acceleration", "jerk")
        }
        if not np.isfinite(least["acceleration"]).all():
            raise ConfigurationError(
                f"{robot.name} has no acceleration limits, which a stop needs: give the scenario "
                "those of the arm's manual, in rad/s² (m/s² for prismatic joints), or low "
                f"values at first, as in limits = {{ acceleration = 5.0 }}"
            )
        return cls(robot.q_min, robot.q_max, robot.qd_max, **least, period=period)

    def box(self, q: Array, qd: Array, last: Array) -> tuple[Array, Array]:
        """Least and greatest q̈ (n,) in a state after the command ``last``.

        See :func:`.formulas.limits.joint_box`.
        """
        ranges = (self.q_min, self.q_max, self.qd_max)
        change = self.jerk * self.period
        least, greatest = joint_box(
            q, qd, last, JointLimits(self.acceleration, change, *ranges, 1, self.period)
        )
        return least, greatest

    def refusal(self, before: Setpoint, after: Setpoint) -> str:
        """Reason why ``after`` must not follow ``before`` by one period; empty if it may.

        Only the limits are checked.
        """
        T = self.period
        moved = (after.q - before.q) / T
        changed = (after.qd - before.qd) / T
        numbers = np.concatenate([after.q, after.qd, after.qdd])
        if not np.isfinite(numbers).all():
            return "it is not finite"

        def beyond(limit: Array) -> Array:
            return limit * (1.0 + ROUNDING) + ROUNDING

        room = ROUNDING * np.maximum(1.0, np.abs(after.q))
        is_outside = (after.q < self.q_min - room) | (after.q > self.q_max + room)
        speed = np.maximum(np.abs(after.qd), np.abs(moved))
        jerk = np.abs(after.qdd - before.qdd) / T
        # positions must move with the mean of both speeds
        jump = np.abs(moved - 0.5 * (before.qd + after.qd))
        greatest_jump = ROUNDING + 0.01 * self.acceleration * T
        violations = (
            ("is outside its range", is_outside, after.q),
            ("exceeds its speed", speed > beyond(self.qd_max), after.qd),
            ("exceeds its acceleration", np.abs(changed) > beyond(self.acceleration), changed),
            ("exceeds its jerk", jerk > beyond(self.jerk), after.qdd),
            ("jumps", jump > greatest_jump, moved),
        )
        for what, is_wrong, value in violations:
            if is_wrong.any():
                j = int(np.argmax(is_wrong))
                return f"joint {j + 1} {what}: {value[j]:.6g}"
        return ""


def deceleration(speed: Array, jerk: Array, period: float) -> Array:
    """Greatest deceleration (n,) that brings a joint to rest while it falls by j T per period.

    With n more periods, a deceleration x reduces the speed by v = T ((n + 1) x − jT n (n + 1)/2),
    where n is the greatest integer with n (n + 1)/2 ≤ v/(jT²). Without a limit of jerk, x = v/T.
    Speeds v and jerks j are (n,); the period is T [s].
    """
    step = np.where(np.isfinite(jerk), jerk * period, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        n = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * speed / (step * period)) - 1.0))
    n = np.where(np.isfinite(n), n, 0.0)
    return (speed / period + 0.5 * step * n * (n + 1.0)) / (n + 1.0)


class Brake:
    """Brings an arm to rest, period after period.

    First, each joint reduces its present acceleration to zero as fast as its jerk allows, at once
    if that is not limited. Then all joints slow down in proportion, so that the arm moves along a
    straight line of joint space; the joint with the smallest limit relative to its speed sets the
    rate. If that line would leave a range, each joint stops separately, as fast as it can.

    It begins with the acceleration ``qdd`` (n,) that was commanded last.
    """

    def __init__(self, qdd: Array, envelope: Envelope) -> None:
        self.envelope = envelope
        #: True if all joints slow down in proportion; None before that is decided.
        self.straight: bool | None = None
        self._last = np.where(np.isfinite(envelope.jerk), qdd, 0.0)
        self._limits: tuple[Array, Array] | None = None

    def step(self, q: Array, qd: Array) -> Array:
        """Return the acceleration (n,) for the period that begins at ``q`` and ``qd`` (n,)."""
        change = self.envelope.jerk * self.envelope.period
        if self._limits is None and self._last.any():
            self._last = self._last - np.clip(self._last, -change, change)
            return self._last
        if self._limits is None:
            self._limits = self._decide(q, qd)
        a, jerk = self._limits
        T = self.envelope.period
        speed = np.abs(qd)
        slower = np.minimum(deceleration(speed, jerk, T), a)
        slower = np.minimum(slower, np.abs(self._last) + jerk * T)
        self._last = -np.sign(qd) * slower
        return self._last

    def at_rest(self, qd: Array) -> bool:
        """True if the stop is complete."""
        change = self.envelope.jerk * self.envelope.period * (1.0 + 1e-9)
        is_still = bool((np.abs(qd) <= AT_REST).all())
        is_decided = self._limits is not None or not self._last.any()
        # the last deceleration can end within one period
        is_slight = bool((np.abs(self._last) <= change).all())
        return is_still and is_decided and is_slight

    def _decide(self, q: Array, qd: Array) -> tuple[Array, Array]:
        limits = self.envelope
        speed = np.abs(qd)
        each = limits.acceleration, limits.jerk
        moving = speed > AT_REST
        if not moving.any():
            self.straight = True
            return each
        share = float((limits.acceleration[moving] / speed[moving]).min())
        jerk = float((limits.jerk[moving] / speed[moving]).min())
        # at unit speed along the line: the deceleration grows, holds and falls
        length = 0.5 / share + 1.5 * share / jerk + limits.period
        end = q + length * qd
        is_inside = (end >= limits.q_min) & (end <= limits.q_max)
        self.straight = bool((is_inside | ~moving).all())
        if not self.straight:
            return each
        proportions = np.maximum(speed, 1e-3 * AT_REST)
        return share * proportions, jerk * proportions
