"""The paper's law: sliding mode on the active rows, tracking in their null space."""

from __future__ import annotations

from typing import ClassVar

from ..kernels.layout import SLIDING
from ..rows import Array, BoolArray, Command, Rows, Task
from .base import Controller
from .compiled import BoundLaw, bound_law, compiled_command
from .options import rank_tolerance as check_rank_tolerance
from .task_priority import prioritise
from .tracking import RANK_TOLERANCE


class SlidingMode(Controller):
    """The paper's law: a sliding mode on the active rows, tracking in their null space.

    Eqs. (10), (11) and (15): the rows with φ ≥ 0 demand A₁ q̈ = −u⁺, the task acts in the null space of A₁.
    L_fφ is not used. If the active rows have lost full row rank the status is ``rank-loss``: the command then meets
    their demands in the least-squares sense, and section 5.2 advises to abort.

    Parameters
    ----------
    rank_tolerance
        Singular values below this fraction of the largest one count as zero, of the active rows once each is divided
        by its length (see :func:`vsconstraints.controllers.task_priority.resolve`).
    """

    name = "sliding-mode"
    _checks: ClassVar = {"rank_tolerance": check_rank_tolerance}

    def __init__(self, *, rank_tolerance: float = RANK_TOLERANCE) -> None:
        self.rank_tolerance = rank_tolerance

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        return prioritise(rows, task, rows.phi >= 0.0, -rows.switching_gain, self.rank_tolerance)

    def _compiled(self, rows: Rows, task: Task) -> Command | None:
        return compiled_command(rows, task, self.rank_tolerance, SLIDING)

    def _bound(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        return bound_law(rows, task, acted, qdd, self.rank_tolerance, SLIDING)
