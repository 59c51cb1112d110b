"""What forbidden boxes, cylinders, capsules and half-spaces share: a signed distance and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..formulas.regions import SMALL
from ..robots.geometry import Pose, Vector3, vector
from ..robots.kinematics import RobotPoint
from ..rows import Array
from .base import demand_margin, demand_positive
from .meshes import Mesh, traced
from .point_constraint import PointConstraint


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
        Points that must stay out; the tip if not given.
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
        margin: float = 0.0,
        points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain, length=length, points=points, name=name)
        self.pose, self.margin = pose, demand_margin(margin, f"a {self.kind}")

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """Its surface in its own frame, traced from the frame's origin; regions whose shape is known give it."""
        return traced(lambda points: self.sigma(self.pose.act(points)) - self.margin)

    @property
    def pose(self) -> Pose:
        """Of the region's frame in the base frame."""
        assert self.frame is not None
        return Pose(*self.frame)

    @pose.setter
    def pose(self, pose: Pose) -> None:
        self.frame = pose.R, pose.t


class RegionAroundAxis(ForbiddenRegion):
    """A region of a radius around the axis from one point to another, which is the z axis of its frame.

    Parameters
    ----------
    start, end
        (3,) ends of the axis in the base frame [m].
    radius
        [m].
    K, switching_gain, margin, points, name
        As of every :class:`.ForbiddenRegion`.
    """

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
        demand_positive(radius, f"radius of a {self.kind}")
        self.start, self.end = vector(start, 3, f"start of a {self.kind}"), vector(end, 3, f"end of a {self.kind}")
        along = self.end - self.start
        size = float(np.sqrt(along @ along))
        if size < SMALL:
            raise ConfigurationError(f"start and end of a {self.kind} must be different points, not both {self.start}")
        pose = Pose(frame_along(along / size), 0.5 * (self.start + self.end))
        self.radius = float(radius)
        self.parameters = self.radius, 0.5 * size
        super().__init__(
            pose, length=self.half_width, K=K, switching_gain=switching_gain, margin=margin, points=points, name=name
        )

    @property
    def half_width(self) -> float:
        """Half of the least width [m], the characteristic length."""
        return self.radius


def frame_along(z: Array) -> Array:
    """A rotation matrix whose third column is the unit vector ``z`` (3,)."""
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.sqrt(x @ x)
    return np.stack((x, np.cross(z, x), z), axis=1)
