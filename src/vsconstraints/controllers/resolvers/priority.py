"""Rows first, the task in their null space: eq. (15)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...formulas.row import EQUAL
from ...qp import SolverChain
from ...rows import Array, Command, Rows, Task
from ..demands import Demand
from ..least_norm import RANK_TOLERANCE, track
from ..options import rank_tolerance
from ..task_priority import prioritise
from .base import Asked, Resolver


@dataclass(frozen=True)
class Priority(Resolver):
    """Rows that act meet their demands with equality, L_gφ q̈ = c; the task acts in their null space (eq. 15).

    If rows with φ ≥ 0 depend on each other the status is ``rank-loss``, and demands are met in the least-squares sense.

    Parameters
    ----------
    rank_tolerance
        Singular values below this fraction of the largest one count as zero, of the active rows once each is divided
        by its length (see :func:`vsconstraints.controllers.task_priority.resolve`).
    """

    rank_tolerance: float = RANK_TOLERANCE

    name = "priority"
    kernel: ClassVar[tuple[str, str]] = ("task_priority", "priority")

    def __post_init__(self) -> None:
        object.__setattr__(self, "rank_tolerance", rank_tolerance(self.rank_tolerance))

    def solve(self, rows: Rows, task: Task, asked: Asked, tracks: bool, solvers: SolverChain | None) -> Command:
        """See :class:`.Resolver`."""
        c = asked(EQUAL, track(task, self.rank_tolerance) if tracks else None)
        return prioritise(rows, task, c < np.inf, c, self.rank_tolerance)

    def tracks(self, demand: Demand) -> bool:
        """See :class:`.Resolver`."""
        return demand.tracks or not demand.everywhere

    @property
    def options(self) -> Array:
        """See :class:`.Resolver`."""
        return np.array([self.rank_tolerance])
