"""Joints stay below their speed: section 4.3.5."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..robots.geometry import Numbers
from ..robots.robot import Robot
from ..rows import Array
from ..vision.scene import Scene
from .joint_constraint import SpeedConstraint
from .joint_range import OfJoints, limit_array, select_limits


class JointSpeed(OfJoints, SpeedConstraint):
    """Joints stay below their speeds, the robot's or given ones.

    q̇_i/q̇_max,i − 1 + margin ≤ 0 and q̇_i/q̇_min,i − 1 + margin ≤ 0 (eqs. 28 and 29, split as footnote 4 says).

    Parameters
    ----------
    robot
        Whose speed limits are used where none are given.
    switching_gain
        u⁺ [1/s].
    joints
        Numbers of the joints concerned, counted from 1; if None all that have a limit.
    lower, upper
        Speed limits of those joints [rad/s or m/s], lower < 0 < upper, instead of the robot's.
    margin
        Safety margin as a fraction of the limit.
    """

    kind = "speed"
    linear = True
    prismatic_unit = "m/s"

    def __init__(
        self,
        robot: Robot,
        *,
        switching_gain: float,
        joints: Sequence[int] | None = None,
        lower: Numbers | None = None,
        upper: Numbers | None = None,
        margin: float = 0.0,
    ) -> None:
        super().__init__(switching_gain=switching_gain)
        if lower is None and upper is not None:
            lower = -limit_array(upper, "upper of speed")
        numbers, self.lower, self.upper = select_limits(
            robot, joints, (lower, robot.qd_min), (upper, robot.qd_max), self.kind
        )
        if (self.lower >= 0.0).any() or (self.upper <= 0.0).any():
            raise ConfigurationError(
                f"speed limits must be lower < 0 < upper, so that the arm can rest: {self.lower} and {self.upper}"
            )
        self._select(numbers, margin, 1.0 / self.upper, -1.0 / self.lower, robot.n)

    def phi(self, qd: Array) -> Array:
        """Eq. (28), one row for each side."""
        x = qd[..., self._at]
        return np.concatenate((x / self.upper, x / self.lower), axis=-1) - (1.0 - self.margin)

    def characteristic_length(self, scene: Scene) -> Array:
        """The allowed speed [rad/s or m/s]."""
        return np.concatenate((self.upper, -self.lower)) * (1.0 - self.margin)
