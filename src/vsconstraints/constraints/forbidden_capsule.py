"""Robot points stay out of a capsule: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry import vector
from ..kinematics import RobotPoint
from ..rows import Array
from .base import demand_positive
from .forbidden_region import SMALL, ForbiddenRegion, axis_pose


class ForbiddenCapsule(ForbiddenRegion):
    """Radius + margin − ‖p − nearest point of a segment‖ ≤ 0: a pipe with round ends.

    On the segment, where every direction across it leads out, the gradient is that of leaving along a fixed one.

    Parameters
    ----------
    start, end
        (3,) ends of the segment in the base frame [m].
    radius
        [m].
    K, switching_gain
        Approach time constant [s] and u⁺ [m/s].
    margin
        Safety margin [m].
    robot_points
        Points that must stay out; the tip if not given.
    name
        Name of the obstacle, for labels when there are several.
    """

    kind = "capsule"

    def __init__(
        self,
        *,
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        K: float,
        switching_gain: float,
        margin: float = 0.0,
        robot_points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        demand_positive(radius, "radius of a capsule")
        self.start, self.end = vector(start, 3, "start of a capsule"), vector(end, 3, "end of a capsule")
        pose, length = axis_pose(self.start, self.end, "capsule")
        self.radius, self._half = float(radius), 0.5 * length
        super().__init__(
            pose,
            length=self.radius,
            K=K,
            switching_gain=switching_gain,
            margin=margin,
            robot_points=robot_points,
            name=name,
        )

    def distance(self, x: Array) -> Array:
        """That to the segment, less the radius."""
        away = self._away(x)
        distance: Array = np.sqrt((away * away).sum(axis=-1)) - self.radius
        return distance

    def outwards(self, x: Array) -> Array:
        """Away from the nearest point of the segment."""
        away = self._away(x)
        length = np.sqrt((away * away).sum(axis=-1, keepdims=True))
        return np.where(length > 0.0, away / np.where(length > 0.0, length, 1.0), [1.0, 0.0, 0.0])

    def bending(self, x: Array, velocity: Array) -> Array:
        """(‖ẋ‖² − (ẋ·n)²) / distance to the segment; without ż beside it."""
        away = self._away(x)
        length = np.maximum(np.sqrt((away * away).sum(axis=-1)), SMALL)
        beside = np.abs(x[..., 2:]) <= self._half
        moving = np.concatenate((velocity[..., :2], np.where(beside, 0.0, velocity[..., 2:])), axis=-1)
        rate = (moving * self.outwards(x)).sum(axis=-1)
        bending: Array = ((moving * moving).sum(axis=-1) - rate * rate) / length
        return bending

    def _away(self, x: Array) -> Array:
        """(..., 3) from the nearest point of the segment to x."""
        z = x[..., 2:]
        return np.concatenate((x[..., :2], z - np.clip(z, -self._half, self._half)), axis=-1)
