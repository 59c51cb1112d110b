"""Robot points stay out of a sphere: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..formulas import regions as formulas
from ..geometry import vector
from ..kinematics import RobotPoint
from ..rows import Array
from .base import demand_positive
from .point_constraint import PointConstraint


class ForbiddenSphere(PointConstraint):
    """r − ‖p − c‖ + margin ≤ 0 (eqs. 47 and 48) for any robot points.

    At the very centre, where every direction leads out, the gradient is that of leaving along +z.

    Parameters
    ----------
    centre
        (3,) c in the base frame [m].
    radius
        r [m].
    K, switching_gain
        Approach time constant [s] and u⁺ [m/s].
    margin
        Safety margin [m].
    robot_points
        Points that must stay out; the tip if not given.
    name
        Name of the obstacle, for labels when there are several.
    """

    kind = "sphere"

    def __init__(
        self,
        *,
        centre: Sequence[float],
        radius: float,
        K: float,
        switching_gain: float,
        margin: float = 0.0,
        robot_points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        demand_positive(radius, "radius of a sphere")
        if not (np.isfinite(margin) and margin >= 0.0):
            raise ConfigurationError(f"margin of a sphere must be zero or more metres, not {margin}")
        self.centre, self.radius, self.margin = (
            vector(centre, 3, "centre of a sphere"),
            float(radius),
            float(margin),
        )
        super().__init__(K=K, switching_gain=switching_gain, length=radius, robot_points=robot_points, name=name)

    def sigma(self, y: Array) -> Array:
        """Eq. (47)."""
        sigma: Array = formulas.sphere(*_coordinates(y - self.centre), self.radius + self.margin)[0]
        return sigma

    def gradient(self, y: Array) -> Array:
        """Eq. (48)."""
        return np.stack(formulas.sphere(*_coordinates(y - self.centre), self.radius)[1:4], axis=-1)

    def curvature(self, y: Array, velocity: Array) -> Array:
        """−(‖ṗ‖² − (ṗ·n)²) / ‖p − c‖, with n the outward direction."""
        curvature: Array = formulas.sphere_curvature(*_coordinates(y - self.centre), *_coordinates(velocity))
        return curvature


def _coordinates(p: Array) -> tuple[Array, Array, Array]:
    return p[..., 0], p[..., 1], p[..., 2]
