"""Constraints on where robot points are in space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..robots.geometry import Pose
from ..robots.kinematics import RobotPoint
from ..rows import Array
from ..vision.scene import PointMotion, Scene, State
from .base import PositionConstraint, RowBlock, Trace, demand_positive, to_first_order
from .by_formula import Form
from .meshes import Mesh


class PointConstraint(PositionConstraint):
    """A constraint on the position y = p (3,) of robot points, in the base frame [m].

    An own one gives ``kind``, :meth:`sigma` in metres and :meth:`gradient`.

    Parameters
    ----------
    points
        The points concerned; their names are used in labels.
    length
        Characteristic length [m].
    name
        Name of the obstacle, for labels when there are several.
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
        self.scale = self.length = demand_positive(length, f"length of {self.kind}")
        self.name, self.points = name, tuple(points)

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """One row per point."""
        prefix = f"{self.name}, " if self.name else ""
        return tuple(f"{self.kind}[{prefix}{point.label}]" for point in self.points)

    def rows(self, state: State, points: slice) -> RowBlock:
        """Chain rule from Cartesian positions to joints (eqs. 30 and 31)."""
        robot, J = state.robot, state.robot.point_J[points]
        motion = PointMotion(robot.points[points], J, J @ robot.qd, robot.point_drift[points])
        return self.chain_rule(self.relative(motion, state))

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """Rows of the formula for the points concerned."""
        return self.formula_form("point_rows", range(points.start, points.stop))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """−σ / ‖∂σ/∂p‖: exact where σ is a signed distance, to first order elsewhere [m]."""
        y = self.displaced(trace.points[:, points], trace.t)
        return to_first_order(self.sigma(y), self.gradient(y))

    def mesh(self, reach: float = np.inf) -> Mesh | None:
        """What it forbids, in the frame of its formula; see :meth:`.Constraint.meshes`. None: it is not drawn."""
        return None

    def meshes(self, t: float, reach: float = np.inf) -> list[Mesh]:
        """The mesh where it is then."""
        mesh = self.mesh(reach)
        if mesh is None:
            return []
        points = mesh.points if self.frame is None else Pose(*self.frame).act(mesh.points)
        moved = np.zeros(3) if self.motion is None else self.motion.displacement(t)
        return [Mesh(points + moved, mesh.triangles)]

    def characteristic_length(self, scene: Scene) -> Array:
        """The same length for every point."""
        return np.full(len(self.points), self.length)
