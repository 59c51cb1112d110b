"""Forbidden regions of robot points: sphere, box, half-space, cylinder, capsule and custom ones.

See section 4.3.6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np

from ..errors import ConfigurationError
from ..formulas import regions as formulas
from ..formulas.regions import SMALL
from ..robots.geometry import Pose, Vector3, vector
from ..robots.kinematics import RobotPoint
from ..rows import Array
from ..vision.scene import PointMotion, Scene, State
from .base import (
    PositionConstraint,
    RowBlock,
    Trace,
    require_margin,
    require_positive,
    to_first_order,
)
from .by_formula import CompiledRowSpec
from .meshes import Mesh, mesh_of, traced


class PointConstraint(PositionConstraint):
    """Constraint on the position y = p (3,) of robot points, in the base frame [m].

    A custom constraint defines ``kind``, :meth:`sigma` in metres and :meth:`gradient`. ``length``
    [m] is its characteristic length; ``name`` is that of the obstacle, for labels if there are
    several.
    """

    unit = "m"
    coordinates = 3

    def __init__(
        self,
        *,
        K: float,
        switching_gain: float,
        length: float,
        points: Sequence[RobotPoint] = (RobotPoint(),),
        name: str = "",
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        if not points:
            raise ConfigurationError(f"{self.kind} needs at least one robot point")
        self.scale = self.length = require_positive(length, f"length of {self.kind}")
        self.name = name
        self.points = tuple(points)

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """Return the labels, one per point."""
        prefix = f"{self.name}, " if self.name else ""
        return tuple(f"{self.kind}[{prefix}{point.label}]" for point in self.points)

    def rows(self, state: State, points: slice) -> RowBlock:
        """Return the rows by the chain rule from Cartesian positions to joints (eqs. 30 and 31)."""
        robot = state.robot
        J = robot.point_J[points]
        velocity = J @ robot.qd
        motion = PointMotion(robot.points[points], J, velocity, robot.point_drift[points])
        relative_motion = self.relative(motion, state)
        return self.chain_rule(relative_motion)

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return the compiled form of the formula for the points concerned."""
        from ..compiled.constraint_rows import point_rows

        return self.formula_form(point_rows, range(points.start, points.stop))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return −σ / ‖∂σ/∂p‖ [m]: exact where σ is a signed distance, of first order elsewhere."""
        y = self.displaced(trace.points[:, points], trace.t)
        return to_first_order(self.sigma(y), self.gradient(y))

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """Return the forbidden region in the frame of its formula, or None if it is not drawn.

        See :meth:`.Constraint.meshes`.
        """
        return None

    def meshes(self, t: float, reach: float = np.inf) -> list[Mesh]:
        """Return the mesh at its position at that time."""
        mesh = self.mesh(reach)
        if mesh is None:
            return []
        points = mesh.points
        if self.frame is not None:
            points = Pose(*self.frame).act(points)
        moved: Array = np.zeros(3)
        if self.motion is not None:
            moved = self.motion.displacement(t)
        return [Mesh(points + moved, mesh.triangles)]


class ForbiddenRegion(PointConstraint):
    """Constraint margin − d(p) ≤ 0 for robot points (section 4.3.6).

    d is the Euclidean signed distance to a region: positive outside, and minus the distance to the
    surface inside, so that a point inside leaves the region on the shortest way. If several surface
    points are equally near, the gradient leads to one of them, always the same one. The gradient is
    a unit vector everywhere.

    A custom region defines ``kind``, its formula (value and derivatives of the depth −d, as a
    function of x, y and z in its own frame) and, if known, the formula of the curvature. ``pose``
    is the pose of the region's frame in the base frame, and ``margin`` [m] the distance to be kept.
    The other arguments are those of :class:`PointConstraint`.
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
        super().__init__(
            K=K, switching_gain=switching_gain, length=length, points=points, name=name
        )
        self.pose = pose
        self.margin = require_margin(margin, f"a {self.kind}")

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """Return the surface in the region's frame.

        It is that of its solid, or traced from the frame's origin if no solid is known.
        """
        solid = self.solid()
        if solid is not None:
            return mesh_of(solid, reach)

        def depth(points: Array) -> Array:
            return self.sigma(self.pose.act(points)) - self.margin

        return traced(depth)

    def solid(self) -> coal.CollisionGeometry | None:
        """Return the region as a solid in its own frame, or None if it is not known."""
        return None

    @property
    def pose(self) -> Pose:
        """Pose of the region's frame in the base frame."""
        assert self.frame is not None
        return Pose(*self.frame)

    @pose.setter
    def pose(self, pose: Pose) -> None:
        self.frame = pose.R, pose.t


@dataclass(kw_only=True, eq=False, repr=False)
class KnownRegion(ForbiddenRegion):
    """Region whose parameters are those of its formula, in addition to those of every region."""

    K: float  #: Approach time constant [s].
    switching_gain: float  #: u⁺ [m/s].
    margin: float = 0.0  #: Margin [m].
    #: Robot points that must stay out; the tip by default.
    points: Sequence[RobotPoint] = (RobotPoint(),)
    name: str = ""  #: Name of the obstacle, for labels if there are several.

    def place(self, R: Array, t: Array, length: float, *parameters: float) -> None:
        """Place the region by the axes R and the origin t of its frame.

        Set its characteristic length and parameters, too.
        """
        self.parameters = parameters
        gains = {"K": self.K, "switching_gain": self.switching_gain}
        ForbiddenRegion.__init__(
            self,
            Pose(R, t),
            length=length,
            margin=self.margin,
            points=self.points,
            name=self.name,
            **gains,
        )


@dataclass(kw_only=True, eq=False, repr=False)
class ForbiddenSphere(KnownRegion):
    """Robot points stay out of a sphere.

    r − ‖p − c‖ + margin ≤ 0 (eqs. 47 and 48). At the exact centre, the gradient is that of leaving
    along +z.
    """

    kind = "sphere"
    formula = staticmethod(formulas.sphere)
    curvature_formula = staticmethod(formulas.sphere_curvature)
    centre: Vector3  #: c in the base frame [m].
    radius: float  #: r [m].

    def __post_init__(self) -> None:
        self.radius = require_positive(self.radius, "radius of a sphere")
        centre = vector(self.centre, 3, "centre of a sphere")
        self.place(np.eye(3), centre, self.radius, self.radius)

    def solid(self) -> coal.CollisionGeometry:
        """Return the sphere."""
        return coal.Sphere(self.radius)


@dataclass(kw_only=True, eq=False, repr=False)
class ForbiddenBox(KnownRegion):
    """Robot points stay out of a box, which may be rotated.

    Inside, if several faces are equally near, the way out is along the first of the box's axes; at
    the centre, it is along the shortest axis in the positive direction.
    """

    kind = "box"
    formula = staticmethod(formulas.box)
    curvature_formula = staticmethod(formulas.box_curvature)
    centre: Vector3  #: Centre in the base frame [m].
    size: Vector3  #: Lengths of the edges [m].
    rpy: Vector3 = (0.0, 0.0, 0.0)  #: Roll, pitch and yaw of the axes in the base frame [rad].

    def __post_init__(self) -> None:
        size = vector(self.size, 3, "size of a box")
        if (size <= 0.0).any():
            raise ConfigurationError(f"size of a box must be three positive lengths, not {size}")
        half = 0.5 * size
        centre = vector(self.centre, 3, "centre of a box")
        R = Pose.from_xyz_rpy((0.0, 0.0, 0.0), self.rpy).R
        self.place(R, centre, float(half.min()), *half.tolist())

    def solid(self) -> coal.CollisionGeometry:
        """Return the box."""
        return coal.Box(*self.size)


@dataclass(kw_only=True, eq=False, repr=False)
class ForbiddenHalfSpace(KnownRegion):
    """Robot points stay on one side of a plane: above a table, in front of a wall.

    margin − n·(p − a) ≤ 0.
    """

    kind = "half-space"
    formula = staticmethod(formulas.half_space)
    curvature_formula = staticmethod(formulas.half_space_curvature)
    point: Vector3  #: a, a point of the plane, in the base frame [m].
    normal: Vector3  #: n, pointing out of the forbidden side; of any length.
    length: float = 0.1  #: Characteristic length [m]: a half-space has no size of its own.

    def __post_init__(self) -> None:
        n = vector(self.normal, 3, "normal of a half-space")
        size = float(np.sqrt(n @ n))
        if size < SMALL:
            raise ConfigurationError(f"normal of a half-space must have a direction, not {n}")
        point = vector(self.point, 3, "point of a half-space")
        self.place(frame_along(n / size), point, self.length)

    def solid(self) -> coal.CollisionGeometry:
        """Return the half-space below z = 0."""
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)


@dataclass(kw_only=True, eq=False, repr=False)
class RegionAroundAxis(KnownRegion):
    """Region of a given radius around the axis from one point to another.

    The axis is the z axis of the region's frame.
    """

    start: Vector3  #: Start of the axis in the base frame [m]; the end follows.
    end: Vector3
    radius: float  #: Radius [m].

    def __post_init__(self) -> None:
        self.radius = require_positive(self.radius, f"radius of a {self.kind}")
        start = vector(self.start, 3, f"start of a {self.kind}")
        end = vector(self.end, 3, f"end of a {self.kind}")
        along = end - start
        size = float(np.sqrt(along @ along))
        if size < SMALL:
            raise ConfigurationError(
                f"start and end of a {self.kind} must be different points, not both {start}"
            )
        half_length = 0.5 * size
        width = self.radius
        if self.kind == "cylinder":
            width = min(self.radius, half_length)
        middle = 0.5 * (start + end)
        self.place(frame_along(along / size), middle, width, self.radius, half_length)


class ForbiddenCylinder(RegionAroundAxis):
    """Robot points stay out of a cylinder with flat ends.

    Inside, if side and end are equally near, the way out is through the side. On the axis, it is a
    fixed direction across the axis; in the middle of a flat cylinder, it is through the end.
    """

    kind = "cylinder"
    formula = staticmethod(formulas.cylinder)
    curvature_formula = staticmethod(formulas.cylinder_curvature)

    def solid(self) -> coal.CollisionGeometry:
        """Return the cylinder."""
        return coal.Cylinder(self.radius, 2.0 * self.parameters[1])


class ForbiddenCapsule(RegionAroundAxis):
    """Robot points stay out of a capsule, a cylinder with round ends.

    radius + margin − ‖p − nearest point of a segment‖ ≤ 0, as for a pipe with round ends. On the
    segment, the gradient is that of leaving along a fixed direction across the segment.
    """

    kind = "capsule"
    formula = staticmethod(formulas.capsule)
    curvature_formula = staticmethod(formulas.capsule_curvature)

    def solid(self) -> coal.CollisionGeometry:
        """Return the capsule."""
        return coal.Capsule(self.radius, 2.0 * self.parameters[1])


def frame_along(z: Array) -> Array:
    """Return a rotation matrix whose third column is the unit vector ``z`` (3,)."""
    least_aligned = int(np.argmin(np.abs(z)))
    x = np.cross(z, np.eye(3)[least_aligned])
    x /= np.sqrt(x @ x)
    y = np.cross(z, x)
    return np.stack((x, y, z), axis=1)
