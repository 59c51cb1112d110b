"""Robot points stay out of a sphere: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np

from ..formulas import regions as formulas
from ..robots.geometry import Pose, Vector3, vector
from ..robots.kinematics import RobotPoint
from ..rows import Array
from .base import demand_positive
from .forbidden_region import ForbiddenRegion
from .meshes import Mesh, mesh_of


class ForbiddenSphere(ForbiddenRegion):
    """Robot points stay out of a sphere.

    r − ‖p − c‖ + margin ≤ 0 (eqs. 47 and 48) for any robot points.

    At the very centre, where every direction leads out, the gradient is that of leaving along +z.

    Parameters
    ----------
    centre
        (3,) c in the base frame [m].
    radius
        r [m].
    K, switching_gain, margin, points, name
        As of every :class:`.ForbiddenRegion`.
    """

    kind = "sphere"
    formula = staticmethod(formulas.sphere)
    curvature_formula = staticmethod(formulas.sphere_curvature)

    def __init__(
        self,
        *,
        centre: Vector3,
        radius: float,
        K: float,
        switching_gain: float,
        margin: float = 0.0,
        points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        demand_positive(radius, "radius of a sphere")
        self.radius = float(radius)
        self.parameters = (self.radius,)
        pose = Pose(np.eye(3), vector(centre, 3, "centre of a sphere"))
        super().__init__(
            pose, length=self.radius, K=K, switching_gain=switching_gain, margin=margin, points=points, name=name
        )

    @property
    def centre(self) -> Array:
        """(3,) in the base frame [m]."""
        return self.pose.t

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """See :meth:`.PointConstraint.mesh`."""
        return mesh_of(coal.Sphere(self.radius))
