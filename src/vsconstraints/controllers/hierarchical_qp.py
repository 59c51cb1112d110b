"""A hierarchical quadratic program: the same rows as inequalities, with strict priorities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from ..errors import unknown_name
from .demands import Barrier, Demand, Switch
from .law import Law
from .least_norm import RANK_TOLERANCE
from .resolvers.hierarchy import AUTO, Hierarchy


class HierarchicalQP(Law):
    """Strict priorities: (1) rows, (2) task, (3) the acceleration nearest to q̈₀: the resolver :class:`.Hierarchy`.

    With the demands A q̈ ≤ c of the rows, of all q̈ in the box |q̈| ≤ q̈_max (level 0, always met)

    1. those with the least ‖W max(0, A q̈ − c)‖;
    2. of these, those with the least ‖J q̈ − b‖;
    3. of these, the one with the least ‖q̈ − q̈₀‖, q̈₀ being the task's ``rest``.

    Where no row resists, the command is that of :class:`~vsconstraints.controllers.Tracking`, bit by bit.
    Where rows contradict each other the command has the status ``relaxed`` and says which demands are unmet
    and by how much. Level 1 measures every demand in the unit of its φ per second: how rows of different
    kinds share an unavoidable violation depends on these units; nothing is normalised silently, ``weights``
    change it.

    How it is computed, and how strict level 2 is: see :class:`vsconstraints.controllers.resolvers.Hierarchy`.

    Parameters
    ----------
    rows
        The demands. ``"barrier"``: L_fφ + L_gφ q̈ ≤ −αφ for every row, so that φ decays exponentially to its
        bound and never crosses it. ``"active"``: L_gφ q̈ ≤ −u⁺ for the rows with φ ≥ 0 only, the inequality
        twin of eq. (15).
    alpha
        Rate α of the barrier [1/s].
    solver
        ``"auto"``: the dual active-set method of :mod:`vsconstraints.compiled.least_distance`, compiled together with
        all of this law, and where there is no compiler ``"daqp"``. Or the name of a QP solver, see
        :func:`vsconstraints.qp.solver_names`. If its answer fails the check of the optimality conditions, others are
        asked (:data:`vsconstraints.qp.FALLBACKS`) and the command says so.
    weights
        Diagonal of W by the beginning of the label, for example ``{"fov": 2.0, "range[joint 6]": 5.0}``; the
        longest matching beginning counts, 1 where none matches. From 1e-10 to 1e10: beside rows of so much more weight
        violations of light ones are lost in rounding. One that begins no label is told of in
        ``Command.remark``, and in the reason of a simulation.
    max_acceleration
        q̈_max [rad/s² or m/s²]; None for no box.
    damping
        Weight of level 3 within the QP, relative to ‖J‖² in the Frobenius norm. Much smaller ones make the QP hard to
        solve.
    rank_tolerance
        Singular values of J below this fraction of the largest one count as zero.

    Attributes
    ----------
    solvers
        The solver asked and those behind it, with their warm starts and the count of their failures;
        :meth:`reset` clears both.

    Raises
    ------
    ConfigurationError
        at construction, if an option cannot be used or if the solver is unknown or not installed.
    """

    name = "hierarchical-qp"

    def __init__(
        self,
        *,
        rows: Literal["barrier", "active"] = "barrier",
        alpha: float = 20.0,
        solver: str = AUTO,
        weights: Mapping[str, float] | None = None,
        max_acceleration: float | None = None,
        damping: float = 1e-8,
        rank_tolerance: float = RANK_TOLERANCE,
    ) -> None:
        demand, self._alpha = _demand(rows, alpha), alpha
        resolver = Hierarchy(
            solver=solver,
            weights=weights,
            max_acceleration=max_acceleration,
            damping=damping,
            rank_tolerance=rank_tolerance,
        )
        super().__init__(demand, resolver)

    @property
    def rows(self) -> str:
        """Which demands: ``"barrier"`` or ``"active"``."""
        return "barrier" if isinstance(self.demand, Barrier) else "active"

    @rows.setter
    def rows(self, rows: Any) -> None:
        self.demand = _demand(rows, self._alpha)

    @property
    def alpha(self) -> float:
        """Rate α of the barrier [1/s]."""
        return self._alpha

    @alpha.setter
    def alpha(self, alpha: float) -> None:
        self.demand, self._alpha = _demand(self.rows, alpha), Barrier(alpha).alpha


def _demand(rows: object, alpha: float) -> Demand:
    if not (isinstance(rows, str) and rows in ("barrier", "active")):
        raise unknown_name("form of rows", rows, ("barrier", "active"))
    barrier = Barrier(alpha)
    return barrier if rows == "barrier" else Switch()
