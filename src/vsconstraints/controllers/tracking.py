"""Tracking alone: the unconstrained baseline."""

from __future__ import annotations

from .demands import Nothing
from .law import Law
from .least_norm import RANK_TOLERANCE
from .resolvers import Priority


class Tracking(Law):
    """The task alone: ignores the rows, and so tells which of them a scenario challenges at all.

    q̈ = q̈₀ + J† (b − J q̈₀), of all q̈ with the least ‖J q̈ − b‖ the one nearest to the task's q̈₀.
    In a singular configuration the directions whose singular values fall below the tolerance are left alone,
    so that the command stays finite (see :func:`.least_norm`) and its status stays ``ok``; next to one it can
    be large.

    Parameters
    ----------
    rank_tolerance
        Singular values below this fraction of the largest one count as zero.
    """

    name = "tracking"

    def __init__(self, *, rank_tolerance: float = RANK_TOLERANCE) -> None:
        super().__init__(Nothing(), Priority(rank_tolerance))
