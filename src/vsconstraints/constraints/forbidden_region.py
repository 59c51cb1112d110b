"""What forbidden boxes, cylinders, capsules and half-spaces share: a signed distance and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..formulas.regions import SMALL
from ..geometry import Pose
from ..kinematics import RobotPoint
from ..renamed import renamed
from ..rows import Array
from .point_constraint import PointConstraint


@renamed(robot_points="points")
class ForbiddenRegion(PointConstraint):
    """Margin − d(p) ≤ 0 for any robot points (section 4.3.6), d the Euclidean signed distance to a region.

    d is positive outside and minus the distance to the surface inside, so that a point inside is led out the shortest
    way. Where several surface points are equally near (edges and corners seen from inside, axes, centres) the
    gradient is the one that leads to one of them, always the same; it is a unit vector everywhere.

    An own region gives ``kind``, its formula (value and derivatives of the depth −d from x, y and z in its own frame)
    and if it knows it the formula of the curvature.

    Parameters
    ----------
    pose
        Of the region's frame in the base frame.
    length
        Characteristic length [m].
    K, switching_gain
        Approach time constant [s] and u⁺ [m/s].
    margin
        Safety margin [m].
    points
        Points that must stay out.
    name
        Name of the obstacle, for labels when there are several.
    """

    def __init__(
        self,
        pose: Pose,
        *,
        length: float,
        K: float,
        switching_gain: float,
        margin: float,
        points: Sequence[RobotPoint],
        name: str,
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain, length=length, points=points, name=name)
        if not (np.isfinite(margin) and margin >= 0.0):
            raise ConfigurationError(f"margin of a {self.kind} must be zero or more metres, not {margin}")
        self.pose, self.margin = pose, float(margin)

    @property
    def pose(self) -> Pose:
        """Of the region's frame in the base frame."""
        assert self.frame is not None
        return Pose(*self.frame)

    @pose.setter
    def pose(self, pose: Pose) -> None:
        self.frame = pose.R, pose.t


def axis_pose(start: Array, end: Array, what: str) -> tuple[Pose, float]:
    """Frame at the middle between two points whose z axis leads from the first to the second, and their distance."""
    along = end - start
    length = float(np.sqrt(along @ along))
    if length < SMALL:
        raise ConfigurationError(f"start and end of a {what} must be different points, not both {start}")
    return Pose(frame_along(along / length), 0.5 * (start + end)), length


def frame_along(z: Array) -> Array:
    """A rotation matrix whose third column is the unit vector ``z`` (3,)."""
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.sqrt(x @ x)
    return np.stack((x, np.cross(z, x), z), axis=1)
