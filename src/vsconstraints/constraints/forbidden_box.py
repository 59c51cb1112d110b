"""Robot points stay out of a box: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np

from ..errors import ConfigurationError
from ..formulas import regions as formulas
from ..robots.geometry import Pose, Vector3, vector
from ..robots.kinematics import RobotPoint
from .forbidden_region import ForbiddenRegion
from .meshes import Mesh, mesh_of


class ForbiddenBox(ForbiddenRegion):
    """Robot points stay out of a box, also a turned one.

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
    K, switching_gain, margin, points, name
        As of every :class:`.ForbiddenRegion`.
    """

    kind = "box"
    formula = staticmethod(formulas.box)
    curvature_formula = staticmethod(formulas.box_curvature)

    def __init__(
        self,
        *,
        centre: Vector3,
        size: Vector3,
        K: float,
        switching_gain: float,
        rpy: Vector3 = (0.0, 0.0, 0.0),
        margin: float = 0.0,
        points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        self.size = vector(size, 3, "size of a box")
        if (self.size <= 0.0).any():
            raise ConfigurationError(f"size of a box must be three positive lengths, not {self.size}")
        half = 0.5 * self.size
        self.parameters = tuple(half.tolist())
        pose = Pose(Pose.from_xyz_rpy((0.0, 0.0, 0.0), rpy).R, vector(centre, 3, "centre of a box"))
        length = float(half.min())
        super().__init__(
            pose, length=length, K=K, switching_gain=switching_gain, margin=margin, points=points, name=name
        )

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """See :meth:`.PointConstraint.mesh`."""
        return mesh_of(coal.Box(*self.size))
