"""Robot points stay on one side of a plane, above a table or before a wall: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..formulas import regions as formulas
from ..formulas.regions import SMALL
from ..robots.geometry import Pose, Vector3, vector
from ..robots.kinematics import RobotPoint
from .forbidden_region import ForbiddenRegion, frame_along
from .meshes import Mesh, square


class ForbiddenHalfSpace(ForbiddenRegion):
    """Robot points stay on one side of a plane: above a table, before a wall.

    Margin − n·(p − a) ≤ 0: points stay on the side of a plane that its normal n points to.

    Parameters
    ----------
    point
        (3,) a, a point of the plane, in the base frame [m].
    normal
        (3,) n, out of the forbidden side; of any length.
    length
        Characteristic length [m]: a half-space has no size of its own.
    K, switching_gain, margin, points, name
        As of every :class:`.ForbiddenRegion`.
    """

    kind = "half-space"
    formula = staticmethod(formulas.half_space)
    curvature_formula = staticmethod(formulas.half_space_curvature)

    def __init__(
        self,
        *,
        point: Vector3,
        normal: Vector3,
        K: float,
        switching_gain: float,
        margin: float = 0.0,
        length: float = 0.1,
        points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        n = vector(normal, 3, "normal of a half-space")
        size = float(np.sqrt(n @ n))
        if size < SMALL:
            raise ConfigurationError(f"normal of a half-space must have a direction, not {n}")
        self.point, self.normal = vector(point, 3, "point of a half-space"), n / size
        pose = Pose(frame_along(self.normal), self.point)
        super().__init__(
            pose, length=length, K=K, switching_gain=switching_gain, margin=margin, points=points, name=name
        )

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """See :meth:`.PointConstraint.mesh`."""
        return square(reach, np.array([0.0, 0.0, 1.0]), np.zeros(3))
