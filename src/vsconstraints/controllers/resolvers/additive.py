"""Tracking and a push of every row: the classical sum."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ...formulas.row import PUSH
from ...qp import SolverChain
from ...rows import Array, Command, Rows, Task
from ..demands import Demand
from ..least_norm import track
from .base import Asked
from .priority import Priority


class Additive(Priority):
    """q̈ = q̈_track + Σ min(0, cᵢ − L_gφᵢ q̈_track) L_gφᵢ†: rows and task may each win.

    Parameters
    ----------
    rank_tolerance
        Singular values of J below this fraction of the largest one count as zero.
    """

    name = "additive"
    kernel: ClassVar[tuple[str, str]] = ("task_priority", "additive")

    def solve(self, rows: Rows, task: Task, asked: Asked, tracks: bool, solvers: SolverChain | None) -> Command:
        """See :class:`.Resolver`."""
        free = track(task, self.rank_tolerance)
        push = asked(PUSH, free)
        return Command(free + pushes(rows, push), "ok", push < np.inf, rows.labels)

    def tracks(self, demand: Demand) -> bool:
        """See :class:`.Resolver`."""
        return not demand.relative or demand.sees_tracking


def pushes(rows: Rows, push: Array) -> Array:
    """Σ pushᵢ L_gφᵢ† (n,) of the rows whose push (m,) is not ∞."""
    squared = (rows.Lg * rows.Lg).sum(axis=1)
    # a row whose gradient vanishes cannot be pushed: its pseudoinverse is zero
    share = np.divide(push, squared, out=np.zeros_like(push), where=(push < np.inf) & (squared > 0.0))
    return np.asarray(share @ rows.Lg)
