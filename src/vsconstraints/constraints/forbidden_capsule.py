"""Robot points stay out of a capsule: section 4.3.6."""

from __future__ import annotations

from collections.abc import Sequence

from ..formulas import regions as formulas
from ..geometry import Vector3, vector
from ..kinematics import RobotPoint
from ..renamed import renamed
from .base import demand_positive
from .forbidden_region import ForbiddenRegion, axis_pose


@renamed(robot_points="points")
class ForbiddenCapsule(ForbiddenRegion):
    """Robot points stay out of a cylinder with round ends.

    Radius + margin − ‖p − nearest point of a segment‖ ≤ 0: a pipe with round ends.

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
    points
        Points that must stay out; the tip if not given.
    name
        Name of the obstacle, for labels when there are several.
    """

    kind = "capsule"
    formula = staticmethod(formulas.capsule)
    curvature_formula = staticmethod(formulas.capsule_curvature)

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
        demand_positive(radius, "radius of a capsule")
        self.start, self.end = vector(start, 3, "start of a capsule"), vector(end, 3, "end of a capsule")
        pose, length = axis_pose(self.start, self.end, "capsule")
        self.radius = float(radius)
        self.parameters = self.radius, 0.5 * length
        super().__init__(
            pose,
            length=self.radius,
            K=K,
            switching_gain=switching_gain,
            margin=margin,
            points=points,
            name=name,
        )
