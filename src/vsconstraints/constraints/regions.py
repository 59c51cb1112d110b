"""Robot points stay out of regions: sphere, box, half-space, cylinder and capsule (section 4.3.6)."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np

from ..errors import ConfigurationError
from ..formulas import regions as formulas
from ..formulas.regions import SMALL
from ..robots.geometry import Pose, Vector3, vector
from ..robots.kinematics import RobotPoint
from ..rows import Array
from .base import demand_margin, demand_positive
from .meshes import Mesh, mesh_of, square, traced
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
