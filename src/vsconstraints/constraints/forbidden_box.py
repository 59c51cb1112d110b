"""Robot points stay out of a box: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..geometry import Pose, vector
from ..kinematics import RobotPoint
from ..rows import Array
from .forbidden_region import SMALL, ForbiddenRegion, signs


class ForbiddenBox(ForbiddenRegion):
    """Margin − d(p) ≤ 0 for a box, also a turned one.

    Inside, where several faces are equally near, the way out is along the first of the box's axes; at the centre
    towards + of the shortest one.

    Parameters
    ----------
    centre
        (3,) in the base frame [m].
    size
        (3,) lengths of its edges [m].
    rpy
        (3,) roll, pitch, yaw of its axes in the base frame [rad].
    K, switching_gain
        Approach time constant [s] and u⁺ [m/s].
    margin
        Safety margin [m].
    robot_points
        Points that must stay out; the tip if not given.
    name
        Name of the obstacle, for labels when there are several.
    """

    kind = "box"

    def __init__(
        self,
        *,
        centre: Sequence[float],
        size: Sequence[float],
        K: float,
        switching_gain: float,
        rpy: Sequence[float] = (0.0, 0.0, 0.0),
        margin: float = 0.0,
        robot_points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        self.size = vector(size, 3, "size of a box")
        if (self.size <= 0.0).any():
            raise ConfigurationError(f"size of a box must be three positive lengths, not {self.size}")
        self._half: Array = 0.5 * self.size
        super().__init__(
            Pose(Pose.from_xyz_rpy((0.0, 0.0, 0.0), rpy).R, vector(centre, 3, "centre of a box")),
            length=float(self._half.min()),
            K=K,
            switching_gain=switching_gain,
            margin=margin,
            robot_points=robot_points,
            name=name,
        )

    def distance(self, x: Array) -> Array:
        """‖max(|x| − h, 0)‖ outside, −min(h − |x|) inside, h half the size."""
        beyond = np.abs(x) - self._half
        out = np.maximum(beyond, 0.0)
        distance: Array = np.sqrt((out * out).sum(axis=-1)) + np.minimum(beyond.max(axis=-1), 0.0)
        return distance

    def outwards(self, x: Array) -> Array:
        """Away from the nearest point of the surface, inside towards it."""
        beyond = np.abs(x) - self._half
        out = np.maximum(beyond, 0.0)
        length = np.sqrt((out * out).sum(axis=-1, keepdims=True))
        face = np.eye(3)[beyond.argmax(axis=-1)]
        outwards: Array = signs(x) * np.where(length > 0.0, out / np.where(length > 0.0, length, 1.0), face)
        return outwards

    def bending(self, x: Array, velocity: Array) -> Array:
        """(‖ẋ_A‖² − (ẋ·n)²) / d with A the axes along which x is beyond the box; 0 inside."""
        out = np.maximum(np.abs(x) - self._half, 0.0)
        length = np.sqrt((out * out).sum(axis=-1))
        rate = (velocity * self.outwards(x)).sum(axis=-1)
        moving = np.where(out > 0.0, velocity, 0.0)
        bending: Array = ((moving * moving).sum(axis=-1) - rate * rate) / np.maximum(length, SMALL)
        return np.where(length > 0.0, bending, 0.0)
