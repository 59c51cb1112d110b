"""What forbidden boxes, cylinders, capsules and half-spaces share: a signed distance and its derivatives."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import ConfigurationError
from ..formulas.regions import SMALL
from ..geometry import Pose
from ..kinematics import RobotPoint
from ..rows import Array
from .point_constraint import PointConstraint


class ForbiddenRegion(PointConstraint):
    """Margin − d(p) ≤ 0 for any robot points (section 4.3.6), d the Euclidean signed distance to a region.

    d is positive outside and minus the distance to the surface inside, so that a point inside is led out the shortest
    way. Where several surface points are equally near (edges and corners seen from inside, axes, centres) the
    gradient is the one that leads to one of them, always the same; it is a unit vector everywhere.

    An own region gives ``kind`` and :meth:`distance`, :meth:`outwards` and :meth:`bending` in its own frame.

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
    robot_points
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
        robot_points: Sequence[RobotPoint],
        name: str,
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain, length=length, robot_points=robot_points, name=name)
        if not (np.isfinite(margin) and margin >= 0.0):
            raise ConfigurationError(f"margin of a {self.kind} must be zero or more metres, not {margin}")
        self.pose, self.margin = pose, float(margin)

    @abstractmethod
    def distance(self, x: Array) -> Array:
        """(...) signed distance [m] of points x (..., 3) in the region's frame."""

    @abstractmethod
    def outwards(self, x: Array) -> Array:
        """(..., 3) ∂d/∂x, a unit vector, in the region's frame."""

    @abstractmethod
    def bending(self, x: Array, velocity: Array) -> Array:
        """(...) ẋᵀ (∂²d/∂x²) ẋ in the region's frame."""

    def sigma(self, y: Array) -> Array:
        """Margin − d."""
        return self.margin - self.distance(self._local(y))

    def gradient(self, y: Array) -> Array:
        """−∂d/∂p."""
        gradient: Array = -(self.outwards(self._local(y)) @ self.pose.R.T)
        return gradient

    def curvature(self, y: Array, velocity: Array) -> Array:
        """−ṗᵀ (∂²d/∂p²) ṗ, exactly."""
        return -self.bending(self._local(y), velocity @ self.pose.R)

    def _local(self, y: Array) -> Array:
        local: Array = (y - self.pose.t) @ self.pose.R
        return local


class RegionByFormula(ForbiddenRegion):
    """A region whose distance and derivatives are one formula of :mod:`vsconstraints.formulas.regions`.

    Attributes
    ----------
    lengths
        What the formula takes between point and velocity [m].
    """

    lengths: tuple[float, ...] = ()

    @property
    @abstractmethod
    def formula(self) -> Callable[..., tuple[Any, Any, Any, Any, Any]]:
        """From x, y, z in the region's frame, its lengths, and ẋ, ẏ, ż: d, its three derivatives and its bend."""

    def distance(self, x: Array) -> Array:
        """See :class:`ForbiddenRegion`."""
        distance: Array = self._evaluate(x, np.zeros(3))[0]
        return distance

    def outwards(self, x: Array) -> Array:
        """See :class:`ForbiddenRegion`."""
        return np.stack(self._evaluate(x, np.zeros(3))[1:4], axis=-1)

    def bending(self, x: Array, velocity: Array) -> Array:
        """See :class:`ForbiddenRegion`."""
        bending: Array = self._evaluate(x, velocity)[4]
        return bending

    def _evaluate(self, x: Array, velocity: Array) -> tuple[Any, Any, Any, Any, Any]:
        point, motion = (x[..., 0], x[..., 1], x[..., 2]), (velocity[..., 0], velocity[..., 1], velocity[..., 2])
        return self.formula(*point, *self.lengths, *motion)


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
