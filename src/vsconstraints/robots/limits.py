"""Limits of a robot's actuators.

They also define the box of feasible accelerations at a sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import ConfigurationError, InvalidInput, format_value
from ..formulas.limits import JointLimits
from ..rows import Array

PerJoint = float | Sequence[float] | None  #: One number for all joints, one per joint, or no limit.


@dataclass(frozen=True)
class ActuatorLimits:
    """Limits of a robot's actuators, the same in both directions.

    Raises ConfigurationError if a limit is not a positive number, or if ``ranges`` is set without
    an acceleration limit for every joint.
    """

    acceleration: PerJoint = None  #: Largest |q̈| [rad/s² or m/s²].
    jerk: PerJoint = None  #: Largest |q̈ − q̈_last| / T_s [rad/s³ or m/s³].
    #: Largest torques or forces [Nm or N]; for a URDF, those of the file. An arm with mass
    #: saturates at them. A kinematic model cannot derive acceleration limits from them.
    effort: PerJoint = None
    #: If True, the acceleration box also ensures that every joint can stop within its range, and
    #: keeps its speed limit. Rows of joint ranges and speeds then remain inactive.
    ranges: bool = False
    known: bool = True  #: True if the controller knows them, too; else only the robot has them.

    def __post_init__(self) -> None:
        for name in ("acceleration", "jerk", "effort"):
            object.__setattr__(self, name, _positive(name, getattr(self, name)))
        if self.ranges and (self.acceleration is None or not np.isfinite(self.acceleration).all()):
            raise ConfigurationError(
                "limits that keep joint ranges need an acceleration limit for every joint"
            )

    @property
    def any(self) -> bool:
        """True if accelerations or jerks are limited."""
        return self.acceleration is not None or self.jerk is not None

    def of_joint(self, name: str, n: int) -> Array:
        """Return a limit (n,) by its name, infinite for None; raises as :func:`per_joint`."""
        return per_joint(f"the limit of {name}", getattr(self, name), n)

    def arrays(self, ranges: tuple[Array, Array, Array], period: float | None) -> JointLimits:
        """Return the limits as the formulas use them.

        ``ranges`` are :attr:`.Robot.ranges`, ``period`` is T_s [s]. Raises ConfigurationError if
        the number of limits differs from that of joints, and InvalidInput if T_s is not positive.
        """
        if period is None or not 0.0 < period < math.inf:
            raise InvalidInput(
                f"limits of actuators need the sampling period in seconds, period=..., not {period}"
            )
        q_min, q_max, qd_max = ranges
        n = len(q_min)
        return JointLimits(
            acceleration=self.of_joint("acceleration", n),
            change=self.of_joint("jerk", n) * period,
            q_min=q_min,
            q_max=q_max,
            qd_max=qd_max,
            ranges=int(self.ranges),
            period=float(period),
        )


def per_joint(what: str, value: PerJoint, n: int) -> Array:
    """Return one number per joint (n,), from one for all or n of them; infinite for None.

    Raises ConfigurationError for another number of values.
    """
    values = np.array(math.inf if value is None else value, dtype=np.float64)
    if values.shape not in ((), (n,)):
        raise ConfigurationError(
            f"{what} must be one number or {n}, one per joint, not {len(values)}"
        )
    return np.broadcast_to(values, (n,)).copy()


def _positive(name: str, value: object) -> PerJoint:
    """Return a number or a tuple of numbers; raise ConfigurationError unless all are positive."""
    if value is None:
        return None
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty((0, 0))
    is_list = numbers.ndim <= 1 and numbers.size > 0
    is_positive = bool((numbers > 0.0).all())
    if not is_list or not is_positive or isinstance(value, bool | str):
        raise ConfigurationError(
            f"the limit of {name} must be a positive number, or one for each joint, so that a "
            f"joint can stand still: not {format_value(value)}"
        )
    return float(numbers) if numbers.ndim == 0 else tuple(numbers.tolist())


NO_LIMITS = ActuatorLimits()  #: Limits of a robot of which none are known.
