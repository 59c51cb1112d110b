"""Law ``resolved-rate``."""

from __future__ import annotations

from ..controllers.demand import Demand
from ..controllers.demands import Nothing
from ..controllers.least_norm import RANK_TOLERANCE, least_norm
from ..controllers.ranges import rank_tolerance as checked_tolerance
from ..controllers.resolver import Priority, Resolver
from ..rows import Array, Rows, Task
from .gain import VelocityLaw


class ResolvedRate(VelocityLaw):
    """Tracks the task by joint speeds, q̇ = J† (−λ e − ∂s/∂t), and ignores the rows.

    Resolved motion rate control (Whitney 1969), the control law of image- and pose-based visual
    servoing in ViSP's ``vpServo`` (Marchand, Spindler and Chaumette, IEEE Robotics & Automation
    Magazine 12(4), 2005). Directions in which J is singular are not used. Of all q̇ it is the
    shortest: the rest acceleration of redundant arms has no counterpart here.

    Parameters
    ----------
    rank_tolerance
        Singular values of J below this fraction of the largest one count as zero.
    """

    name = "resolved-rate"
    #: Rows change no command.
    ignores = (*VelocityLaw.ignores, "K", "dead_time")
    kernel = "resolved_rate"

    def __init__(
        self,
        *,
        gain: float = 2.0,
        gain_at_zero: float | None = None,
        slope_at_zero: float = 30.0,
        rank_tolerance: float = RANK_TOLERANCE,
    ) -> None:
        super().__init__(gain=gain, gain_at_zero=gain_at_zero, slope_at_zero=slope_at_zero)
        self.rank_tolerance = rank_tolerance

    @property
    def rank_tolerance(self) -> float:
        """Fraction of the largest singular value, checked whenever it is set."""
        return self._rank_tolerance

    @rank_tolerance.setter
    def rank_tolerance(self, value: float) -> None:
        self._rank_tolerance = checked_tolerance(value)

    def program(self) -> tuple[Demand, Resolver]:
        """See :class:`.VelocityLaw`."""
        return Nothing(), Priority(self.rank_tolerance)

    def solve(self, rows: Rows, task: Task) -> Array:  # type: ignore[override]
        """See :class:`.VelocityController`."""
        return least_norm(*self.task_of(task), self.rank_tolerance).qdd
