"""Robot points stay out of a cylinder: section 4.3.6."""

from __future__ import annotations

import coal
import numpy as np

from ..formulas import regions as formulas
from .forbidden_region import RegionAroundAxis
from .meshes import Mesh, mesh_of


class ForbiddenCylinder(RegionAroundAxis):
    """Robot points stay out of a cylinder with flat ends.

    Margin − d(p) ≤ 0 for a cylinder with flat ends.

    Inside, where side and end are equally near, the way out is through the side; on the axis it is a fixed direction
    across it; in the middle of a flat cylinder, through the end.

    See :class:`.RegionAroundAxis` for the parameters.
    """

    kind = "cylinder"
    formula = staticmethod(formulas.cylinder)
    curvature_formula = staticmethod(formulas.cylinder_curvature)

    @property
    def half_width(self) -> float:
        """Half of the least width [m], the characteristic length."""
        return min(self.parameters)

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """See :meth:`.PointConstraint.mesh`."""
        return mesh_of(coal.Cylinder(self.radius, 2.0 * self.parameters[1]))
