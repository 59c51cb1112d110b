"""The paper's law: sliding mode on the active rows, tracking in their null space."""

from __future__ import annotations

from .demands import Switch
from .law import Law
from .least_norm import RANK_TOLERANCE
from .resolvers import Priority


class SlidingMode(Law):
    """The paper's law: a sliding mode on the active rows, tracking in their null space.

    Eqs. (10), (11) and (15): the rows with φ ≥ 0 demand A₁ q̈ = −u⁺, the task acts in the null space of A₁.
    L_fφ is not used. If the active rows have lost full row rank the status is ``rank-loss``: the command then meets
    their demands in the least-squares sense, and section 5.2 advises to abort. Of all q̈ that do as well for rows and
    task it is the nearest to the task's q̈₀.

    Parameters
    ----------
    rank_tolerance
        Singular values below this fraction of the largest one count as zero, of the active rows once each is divided
        by its length (see :func:`vsconstraints.controllers.task_priority.resolve`).
    """

    name = "sliding-mode"

    def __init__(self, *, rank_tolerance: float = RANK_TOLERANCE) -> None:
        super().__init__(Switch(), Priority(rank_tolerance))
