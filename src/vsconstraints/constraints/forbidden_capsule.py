"""Robot points stay out of a capsule: section 4.3.6."""

from __future__ import annotations

import coal
import numpy as np

from ..formulas import regions as formulas
from .forbidden_region import RegionAroundAxis
from .meshes import Mesh, mesh_of


class ForbiddenCapsule(RegionAroundAxis):
    """Robot points stay out of a cylinder with round ends.

    Radius + margin − ‖p − nearest point of a segment‖ ≤ 0: a pipe with round ends.

    On the segment, where every direction across it leads out, the gradient is that of leaving along a fixed one.

    See :class:`.RegionAroundAxis` for the parameters.
    """

    kind = "capsule"
    formula = staticmethod(formulas.capsule)
    curvature_formula = staticmethod(formulas.capsule_curvature)

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """See :meth:`.PointConstraint.mesh`."""
        return mesh_of(coal.Capsule(self.radius, 2.0 * self.parameters[1]))
