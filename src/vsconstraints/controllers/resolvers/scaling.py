"""Scalar task scaling: the tracking command, as much of it as all rows allow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...compiled.structures import SCALED
from ...formulas.row import share
from ...qp.lexicographic import ZERO_GRADIENT
from ...rows import Array, BoolArray, Rows
from ..demands import Demand
from ..least_norm import LeastNorm
from .filter import at
from .hierarchy import Hierarchy


@dataclass(frozen=True, kw_only=True)
class Scaling(Hierarchy):
    """q̈ = κ q̈_track with the largest κ in [0, 1] at which every row keeps its demand, κ L_gφ q̈_track ≤ c.

    Whichever row is the first to resist slows everything down, other parts of the task too: what any law should do
    better than. The direction of q̈ is that of tracking. This is the scaling of :class:`Saturation` without its null
    space. It scales the command of the present sample and predicts nothing: a reference governor, which moves the goal,
    is :class:`~vsconstraints.controllers.GoalGovernor`.

    Where c < 0 of a row that tracking leads outwards, even κ = 0 is too much, and no κ is right; nor where c < 0 of a
    row that tracking leads inwards, but not fast enough. Then κ is the largest that no row would by itself have
    smaller: 0 in the first case, what the other rows allow in the second. And the least ‖q̈ − κ q̈_track‖ that meets all
    demands, or violates them least, is added: that of :class:`Filter`. So a row that has to brake brakes, by the
    least acceleration, and q̈ is continuous where c changes its sign. The box limits κ as rows do.

    Parameters
    ----------
    solver, weights, max_acceleration, damping, rank_tolerance
        See :class:`vsconstraints.controllers.HierarchicalQP`.
    """

    name = "scaling"

    @property
    def aim(self) -> int:
        """See :class:`.Hierarchy`."""
        return SCALED

    def tracks(self, demand: Demand) -> bool:
        """See :class:`.Resolver`."""
        return True

    def near(self, rows: Rows, tracking: LeastNorm, c: Array) -> tuple[LeastNorm, BoolArray]:
        """See :class:`.Hierarchy`."""
        qdd = tracking.qdd
        influenced = np.linalg.norm(rows.Lg, axis=1) > ZERO_GRADIENT * rows.scale
        shares = np.where(influenced, share(c, rows.Lg @ qdd), 1.0)
        lower, upper = self.box(rows, qdd.size)
        kappa = min(shares.min(initial=1.0), share(upper, qdd).min(), share(-lower, -qdd).min())
        return at(kappa * qdd), (shares <= kappa) & (shares < 1.0)
