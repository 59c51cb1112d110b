"""Robot points stay out of a cylinder: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry import vector
from ..kinematics import RobotPoint
from ..rows import Array
from .base import demand_positive
from .forbidden_region import SMALL, ForbiddenRegion, axis_pose, signs


class ForbiddenCylinder(ForbiddenRegion):
    """Margin − d(p) ≤ 0 for a cylinder with flat ends.

    Inside, where side and end are equally near, the way out is through the side; on the axis it is a fixed direction
    across it; in the middle of a flat cylinder, through the end.

    Parameters
    ----------
    start, end
        (3,) centres of its two ends in the base frame [m].
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

    kind = "cylinder"

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
        demand_positive(radius, "radius of a cylinder")
        self.start, self.end = vector(start, 3, "start of a cylinder"), vector(end, 3, "end of a cylinder")
        pose, length = axis_pose(self.start, self.end, "cylinder")
        self.radius, self._half = float(radius), 0.5 * length
        super().__init__(
            pose,
            length=min(self.radius, self._half),
            K=K,
            switching_gain=switching_gain,
            margin=margin,
            robot_points=robot_points,
            name=name,
        )

    def distance(self, x: Array) -> Array:
        """That of (ρ, z) to the rectangle of the radius and half the height."""
        beyond = self._beyond(x)
        out = np.maximum(beyond, 0.0)
        distance: Array = np.sqrt((out * out).sum(axis=-1)) + np.minimum(beyond.max(axis=-1), 0.0)
        return distance

    def outwards(self, x: Array) -> Array:
        """Away from the nearest point of the surface, inside towards it."""
        slope = self._slope(self._beyond(x))
        outwards: Array = np.concatenate((slope[..., :1] * _radial(x), slope[..., 1:] * signs(x[..., 2:])), axis=-1)
        return outwards

    def bending(self, x: Array, velocity: Array) -> Array:
        """The bend of the rectangle's distance, and that of ρ: (‖ẋ⊥‖² − ρ̇²) / ρ."""
        beyond = self._beyond(x)
        slope = self._slope(beyond)
        rho_dot = (velocity[..., :2] * _radial(x)).sum(axis=-1)
        across = (velocity[..., :2] ** 2).sum(axis=-1) - rho_dot**2
        of_radius = slope[..., 0] * across / np.maximum(np.sqrt((x[..., :2] ** 2).sum(axis=-1)), SMALL)
        # only near an edge, beyond both side and end, is the rectangle's distance bent
        rates = np.stack((rho_dot, velocity[..., 2] * signs(x[..., 2])), axis=-1)
        turning = rates[..., 0] * slope[..., 1] - rates[..., 1] * slope[..., 0]
        of_edge = turning**2 / np.maximum(np.sqrt((beyond * beyond).sum(axis=-1)), SMALL)
        bending: Array = of_radius + np.where((beyond > 0.0).all(axis=-1), of_edge, 0.0)
        return bending

    def _beyond(self, x: Array) -> Array:
        """(..., 2) how far ρ is beyond the radius, and z beyond an end."""
        rho = np.sqrt((x[..., :2] ** 2).sum(axis=-1))
        return np.stack((rho - self.radius, np.abs(x[..., 2]) - self._half), axis=-1)

    @staticmethod
    def _slope(beyond: Array) -> Array:
        """(..., 2) derivatives of the rectangle's distance."""
        out = np.maximum(beyond, 0.0)
        length = np.sqrt((out * out).sum(axis=-1, keepdims=True))
        side = np.eye(2)[beyond.argmax(axis=-1)]
        return np.where(length > 0.0, out / np.where(length > 0.0, length, 1.0), side)


def _radial(x: Array) -> Array:
    """(..., 2) unit vectors away from the axis; x on it."""
    across = x[..., :2]
    rho = np.sqrt((across * across).sum(axis=-1, keepdims=True))
    return np.where(rho > 0.0, across / np.where(rho > 0.0, rho, 1.0), [1.0, 0.0])
