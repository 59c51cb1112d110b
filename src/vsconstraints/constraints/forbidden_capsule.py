"""Robot points stay out of a capsule: section 4.3.6."""

from __future__ import annotations

from ..formulas import regions as formulas
from .forbidden_region import RegionAroundAxis


class ForbiddenCapsule(RegionAroundAxis):
    """Robot points stay out of a cylinder with round ends.

    Radius + margin − ‖p − nearest point of a segment‖ ≤ 0: a pipe with round ends.

    On the segment, where every direction across it leads out, the gradient is that of leaving along a fixed one.

    See :class:`.RegionAroundAxis` for the parameters.
    """

    kind = "capsule"
    formula = staticmethod(formulas.capsule)
    curvature_formula = staticmethod(formulas.capsule_curvature)
