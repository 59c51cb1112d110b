"""What the arm may be sent: limits that are kept by the command, and checked again at what is about to be sent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ConfigurationError
from ..formulas.limits import JointLimits, joint_box
from ..robots.limits import ActuatorLimits
from ..robots.robot import Robot
from ..rows import Array

ROUNDING = 1e-6
"""Share of a limit by which what is sent may be beyond it: differences of positions are no better."""


@dataclass(frozen=True)
class Setpoint:
    """Where an arm is sent: (n,) coordinates, speeds and accelerations, the last being held during the period."""

    q: Array
    qd: Array
    qdd: Array


@dataclass(frozen=True)
class Envelope:
    """Limits of what is sent to an arm, for n joints and one period.

    Attributes
    ----------
    q_min, q_max, qd_max, acceleration, jerk
        (n,) infinite where there is none; accelerations are always limited.
    period
        T_s [s].
    """

    q_min: Array
    q_max: Array
    qd_max: Array
    acceleration: Array
    jerk: Array
    period: float

    @classmethod
    def of(cls, robot: Robot, limits: ActuatorLimits, period: float) -> Envelope:
        """The robot's own ranges, speeds, accelerations and jerks, and the scenario's, whichever are less.

        Raises
        ------
        ConfigurationError
            if a joint's acceleration is not limited: a stop needs to know how hard it may brake.
        """
        least = {
            name: np.minimum(robot.limits.of_joint(name, robot.n), limits.of_joint(name, robot.n))
            for name in ("acceleration", "jerk")
        }
        if not np.isfinite(least["acceleration"]).all():
            raise ConfigurationError(
                f"{robot.name} has no limit of acceleration, without which no stop is defined: give the scenario "
                "limits = { acceleration = ... }"
            )
        return cls(robot.q_min, robot.q_max, robot.qd_max, **least, period=period)

    def box(self, q: Array, qd: Array, last: Array) -> tuple[Array, Array]:
        """(n,) least and greatest q̈ from a state after the command ``last``: every joint can still stop in its range.

        See :func:`vsconstraints.formulas.limits.joint_box`.
        """
        change = self.jerk * self.period
        own = JointLimits(self.acceleration, change, self.q_min, self.q_max, self.qd_max, 1, self.period)
        least, greatest = joint_box(q, qd, last, own)
        return least, greatest

    def refusal(self, before: Setpoint, after: Setpoint) -> str:
        """Why ``after`` must not be sent where ``before`` was sent a period ago; empty if it may.

        It looks at what is sent alone: positions and speeds, and their differences over a period.
        """
        T = self.period
        moved, changed = (after.q - before.q) / T, (after.qd - before.qd) / T
        numbers = np.concatenate([after.q, after.qd, after.qdd])
        if not np.isfinite(numbers).all():
            return "it is not finite"
        room = ROUNDING * np.maximum(1.0, np.abs(after.q))
        found = (
            ("is outside its range", (after.q < self.q_min - room) | (after.q > self.q_max + room), after.q),
            ("exceeds its speed", np.maximum(np.abs(after.qd), np.abs(moved)) > _beyond(self.qd_max), after.qd),
            ("exceeds its acceleration", np.abs(changed) > _beyond(self.acceleration), changed),
            ("exceeds its jerk", np.abs(after.qdd - before.qdd) / T > _beyond(self.jerk), after.qdd),
            ("jumps", np.abs(moved - 0.5 * (before.qd + after.qd)) > ROUNDING + 0.01 * self.acceleration * T, moved),
        )
        for what, wrong, value in found:
            if wrong.any():
                j = int(np.argmax(wrong))
                return f"joint {j + 1} {what}: {value[j]:.6g}"
        return ""


def _beyond(limit: Array) -> Array:
    """(n,) what is beyond a limit and its rounding."""
    beyond: Array = limit * (1.0 + ROUNDING) + ROUNDING
    return beyond
