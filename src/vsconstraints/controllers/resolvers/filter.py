"""The safety filter: as near as possible to the tracking command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from ...compiled.structures import NEAREST, WEIGHED
from ...errors import unknown_name
from ...rows import Array, BoolArray, Rows
from ..least_norm import LeastNorm
from ..ranges import Choices, Declared, Range
from .hierarchy import Hierarchy

METRICS = {"joint": NEAREST, "task": WEIGHED}
"""What the distance to the tracking command is measured in."""


@dataclass(frozen=True, kw_only=True)
class Filter(Hierarchy):
    """Of all q̈ in the box that violate the demands least, the one nearest to the command that tracks.

    One quadratic program subject to A q̈ ≤ c: the safety filter of control barrier functions (Ames, Xu, Grizzle and
    Tabuada 2017). What is nearest depends on the metric:

    - ``joint``: min ‖q̈ − q̈_track‖². It spreads over all joints what a row takes from one, and so gives up some of
      every part of the task, of those too that the rows would allow: it reaches its goal later.
    - ``task``: min ‖J(q̈ − q̈_track)‖² + damping ‖J‖² ‖q̈ − q̈_track‖², the metric of task-consistent filters (Morton and
      Pavone 2025). Where the damping is small beside the gains of J, and the task needs all joints, this is
      :class:`Hierarchy`; as it grows, it becomes the joint metric.

    Parameters
    ----------
    metric
        ``"joint"`` or ``"task"``.
    damping
        Weight of the joints in the metric ``task``, relative to ‖J‖² in the Frobenius norm; the metric ``joint`` has no
        use for it.
    solver, weights, max_acceleration, rank_tolerance
        See :class:`vsconstraints.controllers.HierarchicalQP`.
    """

    metric: Literal["joint", "task"] = "joint"

    name = "filter"
    ranges: ClassVar[Mapping[str, Declared]] = {"metric": Choices(tuple(METRICS)), "damping": Range(1e-8, 1.0)}

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (isinstance(self.metric, str) and self.metric in METRICS):
            raise unknown_name("metric", self.metric, tuple(METRICS))

    @property
    def aim(self) -> int:
        """See :class:`.Hierarchy`."""
        return METRICS[self.metric]

    def near(self, rows: Rows, tracking: LeastNorm, c: Array) -> tuple[LeastNorm, BoolArray]:
        """See :class:`.Hierarchy`."""
        return (tracking if self.metric == "task" else at(tracking.qdd)), np.zeros(c.size, dtype=np.bool_)


def at(qdd: Array) -> LeastNorm:
    """The problem whose residual is the distance to these accelerations (n,) in the joints."""
    return LeastNorm(qdd, np.eye(qdd.size), np.ones(qdd.size))
