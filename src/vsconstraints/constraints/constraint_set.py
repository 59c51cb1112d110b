"""All constraints of a scene as one block of labelled rows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

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
        labels = [constraint.labels(scene) for constraint in self.constraints]
        counts = [len(names) for names in labels]
        self._counts = counts
        self.labels: tuple[str, ...] = tuple(name for names in labels for name in names)
        repeated = sorted({name for name in self.labels if self.labels.count(name) > 1})
        if repeated:
            raise ConfigurationError(
                f"rows must have different labels: {', '.join(repeated)} appears more than once; "
                f"give names"
            )
        ends = np.cumsum([0, *(len(constraint.points) for constraint in self.constraints)])
        self._points = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        kinds: list[str] = []
        units: list[str] = []
        for constraint, count in zip(self.constraints, counts, strict=True):
            kinds += [constraint.kind] * count
            units += constraint.units(scene)
        self.kinds = tuple(kinds)
        self.units = tuple(units)
        self.K = self._by_row([constraint.K for constraint in self.constraints])
        gives_phi = self._by_row([isinstance(c, SpeedConstraint) for c in self.constraints])
        gains = self._by_row([constraint.switching_gain for constraint in self.constraints])
        scales = self._by_row([constraint.scale for constraint in self.constraints])
        # shared by the rows of every step and by the scores: no controller may change them or make
        # them writable
        self.approach_time = _unchangeable(np.where(gives_phi > 0.0, 0.0, self.K))
        self.switching_gain = _unchangeable(gains)
        self.scale = _unchangeable(scales)
        lengths = [constraint.characteristic_length(scene) for constraint in self.constraints]
        self.characteristic_length = np.concatenate([np.empty(0), *lengths])

    def _by_row(self, values: Sequence[float]) -> Array:
        """Return a number of each constraint for each of its rows, (m,)."""
        repeated: Array = np.repeat(values, self._counts).astype(np.float64)
        return repeated

    @in_one_line
    def __repr__(self) -> str:
        kinds = [f"{self.kinds.count(kind)} {kind}" for kind in dict.fromkeys(self.kinds)]
        return f"<ConstraintSet: {counted(len(self.labels), 'row')} ({enumerated(kinds, 8)})>"

    def scaled(self, factors: RowFactors) -> ConstraintSet:
        """Return the set with a law's factors on K and u⁺.

        Raises ConfigurationError if a constraint does not allow them.
        """
        if not factors.options():
            return self
        return ConstraintSet(
            [each.scaled(*factors.of(each.kind)) for each in self.constraints], self.scene
        )

    def has_unknown_motion(self, scene: Scene) -> bool:
        """True if the target or a forbidden region moves in a way unknown to controllers."""
        motions = [
            scene.motion,
            *(getattr(constraint, "motion", None) for constraint in self.constraints),
        ]
        return any(motion is not None and not motion.known for motion in motions)

    def blocks(self) -> list[tuple[Constraint, int, slice]]:
        """Return every constraint, its number of rows, and the range of its robot points.

        The range refers to the robot points of the scene.
        """
        return list(zip(self.constraints, self._counts, self._points, strict=True))

    def clearance(self, trace: Trace) -> Array:
        """Return the clearance (T, m): the signed distance of each row to its boundary.

        It is given in the row's natural unit and positive where the row is satisfied. Rows of a
        custom constraint that raises an exception or returns another shape are NaN.
        """
        parts = [np.empty((len(trace.q), 0))]
        for constraint, r, at in self.blocks():
            try:
                clearance = np.asarray(constraint.clearance(trace, at), dtype=np.float64)
            # an exception in a custom constraint must not discard the simulated run
            except Exception:
                clearance = np.empty(0)
            shape = len(trace.q), r
            parts.append(clearance if clearance.shape == shape else np.full(shape, np.nan))
        return np.concatenate(parts, axis=1)

    def sampling_band(self, Ts: float) -> Array:
        """Return the violation depth (m,) caused by sampling with ``Ts`` [s] alone.

        It is given in each row's natural unit.
        """
        parts = [constraint.sampling_band(self.scene, Ts) for constraint in self.constraints]
        return np.concatenate([np.empty(0), *parts])


def _unchangeable(values: Array) -> Array:
    """Return a copy in memory that NumPy refuses to make writable."""
    return np.ndarray(values.shape, values.dtype, values.tobytes())
