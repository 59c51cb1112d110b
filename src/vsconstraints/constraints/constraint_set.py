"""All constraints of a scene as one block of labelled rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import ConfigurationError
from ..robots.kinematics import RobotPoint
from ..rows import Array
from ..rows.factors import RowFactors
from ..rows.readable import counted, enumerated, in_one_line
from ..vision.scene import Scene
from .base import Constraint, Trace
from .joint_limits import SpeedConstraint


def robot_points(constraints: Sequence[Constraint]) -> tuple[RobotPoint, ...]:
    """Return the robot points that these constraints need, one constraint after the other."""
    return tuple(point for constraint in constraints for point in constraint.points)


class Block(NamedTuple):
    """Constraint with its number of rows, and the range of its robot points among the scene's."""

    constraint: Constraint
    row_count: int
    points: slice


class ConstraintSet:
    """Constraints that are evaluated together, with their constant parts prepared once.

    Each of the m rows has a unique label (``labels``), a kind (``kinds``), the natural unit of its
    clearance (``units``), ``switching_gain``, ``scale``, ``K``, ``approach_time`` (K [s], or 0 if φ
    is not σ + K σ̇) and ``characteristic_length`` in its unit. Raises ConfigurationError if two
    rows have the same label, or if the scene was not built with the robot points of these
    constraints.
    """

    def __init__(self, constraints: Sequence[Constraint], scene: Scene) -> None:
        self.constraints = tuple(constraints)
        self.scene = scene
        if robot_points(self.constraints) != scene.points:
            raise ConfigurationError("build the scene with points=robot_points(constraints)")
        labels: list[str] = []
        kinds: list[str] = []
        units: list[str] = []
        self._blocks: list[Block] = []
        first_point = 0
        for constraint in self.constraints:
            names = constraint.labels(scene)
            labels += names
            kinds += [constraint.kind] * len(names)
            units += constraint.units(scene)
            end_point = first_point + len(constraint.points)
            points = slice(first_point, end_point)
            self._blocks.append(Block(constraint, len(names), points))
            first_point = end_point
        self.labels = tuple(labels)
        self.kinds = tuple(kinds)
        self.units = tuple(units)
        repeated = sorted({name for name in labels if labels.count(name) > 1})
        if repeated:
            raise ConfigurationError(
                f"rows must have different labels: {', '.join(repeated)} appears more than once; "
                f"give names"
            )
        gives_phi = [isinstance(each, SpeedConstraint) for each in self.constraints]
        self.K = self._by_row([each.K for each in self.constraints])
        gains = self._by_row([each.switching_gain for each in self.constraints])
        scales = self._by_row([each.scale for each in self.constraints])
        # shared by the rows of every step and by the scores: no controller may change them or make
        # them writable
        approach_time = np.where(self._by_row(gives_phi) > 0.0, 0.0, self.K)
        self.approach_time = _unchangeable(approach_time)
        self.switching_gain = _unchangeable(gains)
        self.scale = _unchangeable(scales)
        lengths = [each.characteristic_length(scene) for each in self.constraints]
        self.characteristic_length = _concatenated(lengths)

    def _by_row(self, values: Sequence[float]) -> Array:
        """Return an array (m,) that repeats the value of each constraint for each of its rows."""
        row_counts = [block.row_count for block in self._blocks]
        repeated: Array = np.repeat(values, row_counts).astype(np.float64)
        return repeated

    @in_one_line
    def __repr__(self) -> str:
        kinds = [f"{self.kinds.count(kind)} {kind}" for kind in dict.fromkeys(self.kinds)]
        rows = counted(len(self.labels), "row")
        return f"<ConstraintSet: {rows} ({enumerated(kinds, 8)})>"

    def scaled(self, factors: RowFactors) -> ConstraintSet:
        """Return the set with a law's factors on K and u⁺.

        Raises ConfigurationError if a constraint does not allow them.
        """
        if not factors.options():
            return self
        scaled = [each.scaled(*factors.of(each.kind)) for each in self.constraints]
        return ConstraintSet(scaled, self.scene)

    def has_unknown_motion(self, scene: Scene) -> bool:
        """True if the target or a forbidden region moves in a way unknown to controllers."""
        motions = [scene.motion]
        motions += [getattr(constraint, "motion", None) for constraint in self.constraints]
        return any(motion is not None and not motion.known for motion in motions)

    def blocks(self) -> list[Block]:
        """Return every constraint with its numbers of rows and robot points."""
        return list(self._blocks)

    def clearance(self, trace: Trace) -> Array:
        """Return the clearance (T, m): the signed distance of each row to its boundary.

        It is given in the row's natural unit and positive where the row is satisfied. Rows of a
        custom constraint that raises an exception or returns another shape are NaN.
        """
        sample_count = len(trace.q)
        parts = [np.empty((sample_count, 0))]
        for constraint, row_count, points in self._blocks:
            unknown = np.full((sample_count, row_count), np.nan)
            try:
                clearance = np.asarray(constraint.clearance(trace, points), dtype=np.float64)
            # an exception in a custom constraint must not discard the simulated run
            except Exception:
                clearance = unknown
            parts.append(clearance if clearance.shape == unknown.shape else unknown)
        return np.concatenate(parts, axis=1)

    def sampling_band(self, Ts: float) -> Array:
        """Return the violation depth (m,) caused by sampling with ``Ts`` [s] alone.

        It is given in each row's natural unit.
        """
        bands = [each.sampling_band(self.scene, Ts) for each in self.constraints]
        return _concatenated(bands)


def _concatenated(vectors: Sequence[Array]) -> Array:
    """Return vectors as one, which is empty if there are none."""
    return np.concatenate([np.empty(0), *vectors])


def _unchangeable(values: Array) -> Array:
    """Return a copy in memory that NumPy refuses to make writable."""
    return np.ndarray(values.shape, values.dtype, values.tobytes())
