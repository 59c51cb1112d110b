"""Robot points stay out of a cylinder: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

from ..formulas import regions as formulas
from ..geometry import Vector3, vector
from ..kinematics import RobotPoint
from ..renamed import renamed
from .base import demand_positive
from .forbidden_region import ForbiddenRegion, axis_pose


@renamed(robot_points="points")
class ForbiddenCylinder(ForbiddenRegion):
    """Robot points stay out of a cylinder with flat ends.

    Margin − d(p) ≤ 0 for a cylinder with flat ends.

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
    points
        Points that must stay out; the tip if not given.
    name
        Name of the obstacle, for labels when there are several.
    """

    kind = "cylinder"
    formula = staticmethod(formulas.cylinder)
    curvature_formula = staticmethod(formulas.cylinder_curvature)

    def __init__(
        self,
        *,
        start: Vector3,
        end: Vector3,
        radius: float,
        K: float,
        switching_gain: float,
        margin: float = 0.0,
        points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        demand_positive(radius, "radius of a cylinder")
        self.start, self.end = vector(start, 3, "start of a cylinder"), vector(end, 3, "end of a cylinder")
        pose, length = axis_pose(self.start, self.end, "cylinder")
        self.radius = float(radius)
        self.parameters = self.radius, 0.5 * length
        super().__init__(
            pose,
            length=min(self.parameters),
            K=K,
            switching_gain=switching_gain,
            margin=margin,
            points=points,
            name=name,
        )
