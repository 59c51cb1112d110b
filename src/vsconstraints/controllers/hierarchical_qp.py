"""A hierarchical quadratic program: the same rows as inequalities, with strict priorities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigurationError, InvalidInput, SolverError, shown, unknown_name
from ..kernels import load
from ..kernels.entry import entry
from ..qp import Cost, SolverChain, lexicographic
from ..qp.lexicographic import MET, ZERO_GRADIENT
from ..rows import Array, BoolArray, Command, Rows, Task
from .base import Controller
from .compiled import BOOL, NOT_FOR_COMPILED, BoundLaw, in_usual_layout
from .compiled_hierarchy import ANSWERS, COMPILED, BoundHierarchy, hierarchy_command, unmet
from .options import Fixed, positive, rank_tolerance
from .tracking import RANK_TOLERANCE, LeastNorm, least_norm

AUTO = "auto"
"""Compiled where there is a compiler, and else daqp."""

DEFAULT = "daqp"

HEAVIEST = 1e10
"""Largest weight of a row, and the inverse of the least: those without one have 1."""

IntArray = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class HierarchicalQP(Controller):
    """Strict priorities: (1) rows, (2) task, (3) least acceleration, as a lexicographic quadratic program.

    With the demands A q̈ ≤ c of the rows, of all q̈ in the box |q̈| ≤ q̈_max (level 0, always met)

    1. those with the least ‖W max(0, A q̈ − c)‖;
    2. of these, those with the least ‖J q̈ − b‖;
    3. of these, the one with the least ‖q̈‖.

    Where no row resists, the command is that of :class:`~vsconstraints.controllers.Tracking`, bit by bit.
    Where rows contradict each other the command has the status ``relaxed`` and says which demands are unmet
    and by how much. Level 1 measures every demand in the unit of its φ per second: how rows of different
    kinds share an unavoidable violation depends on these units; nothing is normalised silently, ``weights``
    change it.

    How it is computed: levels 2 and 3 are one strictly convex QP, min ½Σⱼ(gⱼ² + damping)vⱼ² in the
    coordinates v = Vᵀ(q̈ − J†b) of the singular vectors of J with relative gains g, with hard rows. Only if the hard
    rows are incompatible is level 1 computed, exactly; the violated rows then become equalities, which are eliminated
    with an orthonormal basis, and the QP is solved in the remaining coordinates. A large weight or soft rows in place
    of this were measured to be wrong.

    How strict level 2 is: where J leaves directions free and the damping has cost the task more than a residual of
    1e-6 ‖J‖‖q̈ − J†b‖, level 2 is found by itself, and level 3 within it. It then uses every direction within the rows
    whose gain is above ``rank_tolerance`` relative to J, however large the accelerations; ``max_acceleration`` is there
    to bound them. Two exceptions tame tasks that are nearly singular. Where J has a relative gain below 1e-3, level 2
    uses directions within the rows only above √damping. And where J leaves no direction free, the QP's minimiser is the
    answer: level 3 wins in directions whose relative gain is below √damping, and takes a fraction of damping/gⱼ² from
    others. If rounding does not allow to prove that levels 2 and 3 are met, the status is ``suboptimal``: the rows are
    met, and no known point that meets them has a smaller residual.

    Parameters
    ----------
    rows
        The demands. ``"barrier"``: L_fφ + L_gφ q̈ ≤ −αφ for every row, so that φ decays exponentially to its
        bound and never crosses it. ``"active"``: L_gφ q̈ ≤ −u⁺ for the rows with φ ≥ 0 only, the inequality
        twin of eq. (15).
    alpha
        Rate α of the barrier [1/s].
    solver
        ``"auto"``: the dual active-set method of :mod:`vsconstraints.kernels.least_distance`, compiled together with
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

    rows: Literal["barrier", "active"] = "barrier"
    alpha: float = 20.0
    solver: str = AUTO
    weights: Mapping[str, float] | None = None
    max_acceleration: float | None = None
    damping: float = 1e-8
    rank_tolerance: float = RANK_TOLERANCE
    solvers: SolverChain = field(init=False, repr=False)
    _weighted: dict[tuple[str, ...], tuple[Array, str]] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        if not (isinstance(self.rows, str) and self.rows in ("barrier", "active")):
            raise unknown_name("form of rows", self.rows, ("barrier", "active"))
        checked: dict[str, Any] = {name: _positive(name, getattr(self, name)) for name in ("alpha", "damping")}
        if self.max_acceleration is not None:
            checked["max_acceleration"] = _positive("max_acceleration", self.max_acceleration)
        if self.weights is not None:
            if not (isinstance(self.weights, Mapping) and all(isinstance(prefix, str) for prefix in self.weights)):
                given = shown(self.weights)
                raise ConfigurationError(f"weights must map beginnings of labels to numbers, not {given}")
            weights = {prefix: _weight(prefix, weight) for prefix, weight in self.weights.items()}
            checked["weights"] = Fixed(weights)
        checked["rank_tolerance"] = rank_tolerance(self.rank_tolerance)
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "solvers", SolverChain(DEFAULT if self.solver == AUTO else self.solver))

    def reset(self) -> None:
        """Forget the solvers' warm starts and the count of their failures."""
        self.solvers.reset()

    def _compiled(self, rows: Rows, task: Task) -> Command | None:
        kernels = load("hierarchical_qp") if self.solver == AUTO else None
        if kernels is None:
            return None
        try:
            labels = rows.labels
            m = len(labels)
            acted, slack, qdd = np.empty(m, BOOL), np.empty(m), np.empty(task.J.shape[1])
            code, iterations = kernels.descend(*self._arguments(rows, task, slack, acted, qdd))
            if code == kernels.DONE or code in ANSWERS:
                return hierarchy_command(qdd, code, acted, labels, slack, iterations, self._remark(labels))
        except NOT_FOR_COMPILED:  # labels that are no names among them
            usual = in_usual_layout(rows, task)
            return usual and self._compiled(*usual)
        if code == kernels.ASK:
            return None
        self.solvers.failures[COMPILED] += 1
        answer = self._defined(rows, task)
        reason = f"the {COMPILED} solver has no answer that passes the check"
        return replace(answer, fallback="; ".join(filter(None, (reason, answer.fallback))))

    def _bound(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        kernels = load("hierarchical_qp") if self.solver == AUTO else None
        if kernels is None:
            return None
        slack = np.empty(len(rows.labels))
        law = partial(entry(kernels.descend), *self._arguments(rows, task, slack, acted, qdd))
        return BoundHierarchy(law, rows.labels, acted, qdd, slack, self._remark(rows.labels))

    def _arguments(self, rows: Rows, task: Task, slack: Array, acted: BoolArray, qdd: Array) -> tuple[Any, ...]:
        """What :func:`vsconstraints.kernels.hierarchical_qp.descend` takes."""
        return (
            len(rows.labels),
            rows.phi,
            rows.Lg,
            rows.Lf,
            rows.switching_gain,
            rows.scale,
            task.J,
            task.b,
            self.rank_tolerance,
            self.rows == "barrier",
            self.alpha,
            self._weights_of(rows.labels)[0],
            math.inf if self.max_acceleration is None else self.max_acceleration,
            self.damping,
            slack,
            acted,
            qdd,
        )

    def _weights_of(self, labels: tuple[str, ...]) -> tuple[Array, str]:
        """:func:`row_weights`, and which of them concern no label; kept for the labels of the last call."""
        kept = self._weighted.get(labels)
        if kept is None:
            self._weighted.clear()
            weights = self.weights or {}
            idle = [shown(prefix) for prefix in weights if not any(label.startswith(prefix) for label in labels)]
            remark = f"weights that begin no row's label: {', '.join(idle)}" if idle and labels else ""
            kept = self._weighted.setdefault(labels, (row_weights(labels, weights), remark))
        return kept

    def _remark(self, labels: tuple[str, ...]) -> str:
        return self._weights_of(labels)[1]

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        remark = self._remark(rows.labels)
        return replace(self._answer(rows, task), remark=remark) if remark else self._answer(rows, task)

    def _answer(self, rows: Rows, task: Task) -> Command:
        # Numbers beyond the range of floating point are found by checks.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            tracking = least_norm(task.J, task.b, self.rank_tolerance)
            which, A, c = demands(rows, self.rows, self.alpha)
            excess = A @ tracking.qdd - c
            bound = math.inf if self.max_acceleration is None else self.max_acceleration
            inside = bound == math.inf or bool(np.abs(tracking.qdd).max() <= bound)
            if inside and (excess <= 0.0).all():
                return self._tracks(rows, tracking)
            norms = np.sqrt(np.einsum("ij,ij->i", A, A))
            fixed = norms <= ZERO_GRADIENT * rows.scale[which]
            # a demand beyond the range of floating point exceeds nothing by a fraction of itself
            met = (excess < np.inf) & (excess <= MET * (norms * np.linalg.norm(tracking.qdd) + np.abs(c)))
            if inside and (met & ~fixed | (c >= 0.0) & fixed).all():
                return self._tracks(rows, tracking)
            return self._resist(rows, tracking, bound, (which, A, c, fixed))

    @staticmethod
    def _tracks(rows: Rows, tracking: LeastNorm) -> Command:
        """No row resists."""
        m = len(rows.labels)
        return Command(tracking.qdd, "ok", np.zeros(m, dtype=np.bool_), rows.labels, slack=np.zeros(m))

    def _resist(
        self,
        rows: Rows,
        tracking: LeastNorm,
        bound: float,
        demand: tuple[IntArray, Array, Array, BoolArray],
    ) -> Command:
        """Answer where some row, or the box, does not allow the tracking command."""
        which, A, c, fixed = demand
        free = which[~fixed]
        labels = [rows.labels[i] for i in free]
        weights = row_weights(labels, self.weights or {})
        cost = task_cost(tracking, self.damping, self.rank_tolerance)
        try:
            optimum = lexicographic(A[~fixed], c[~fixed], weights, cost, self.solvers, bound)
        except InvalidInput as error:
            raise SolverError(f"beyond the range of floating point: {error}") from error
        acted = np.zeros(len(rows.labels), dtype=np.bool_)
        acted[free] = optimum.holding
        slack = np.zeros(len(rows.labels))
        slack[free] = optimum.violation
        slack[which[fixed]] = np.maximum(-c[fixed], 0.0)
        verified = optimum.verified
        return Command(
            optimum.x,
            "relaxed" if slack.any() else "suboptimal" if optimum.shortfall else "ok",
            acted,
            rows.labels,
            reason="; ".join(filter(None, (unmet(rows.labels, slack, which[fixed]), optimum.shortfall))),
            slack=slack,
            solver=verified.solver if verified else "",
            iterations=verified.answer.iterations if verified else 0,
            fallback=optimum.fallback,
        )


def demands(rows: Rows, form: Literal["barrier", "active"], alpha: float) -> tuple[IntArray, Array, Array]:
    """Collect what the rows ask of the acceleration, A q̈ ≤ c.

    Parameters
    ----------
    rows
        m constraint rows.
    form
        ``"barrier"``: A = L_g, c = −αφ − L_f for all rows. ``"active"``: A = L_g, c = −u⁺ where φ ≥ 0.
    alpha
        α [1/s].

    Returns
    -------
    tuple
        The (p,) indices of the rows that demand something, A (p, n) and c (p,) in units of φ per second.
    """
    if form == "barrier":
        return np.arange(rows.phi.size), rows.Lg, -alpha * rows.phi - rows.Lf
    which = np.flatnonzero(rows.phi >= 0.0)
    return which, rows.Lg[which], -rows.switching_gain[which]


def row_weights(labels: Sequence[str], weights: Mapping[str, float]) -> Array:
    """(m,) level-1 weight of each label: that of the longest key the label begins with, or 1."""
    values = np.ones(len(labels))
    if weights:
        for i, label in enumerate(labels):
            matching = [prefix for prefix in weights if label.startswith(prefix)]
            if matching:
                values[i] = weights[max(matching, key=len)]
    return values


def task_cost(tracking: LeastNorm, damping: float, rank_tolerance: float) -> Cost:
    """State levels 2 and 3 as one cost, ½Σⱼ(gⱼ² + damping)vⱼ² with v = Vᵀ(q̈ − J†b).

    g are the gains of J relative to the norm of all. With Jq̈ fixed, q̈ − J†b differs from q̈ by a constant
    that is orthogonal to the null space of J, so that the damping term minimises ‖q̈‖ there; and without rows
    the minimiser is J†b itself, whatever the damping.
    """
    size = float(np.linalg.norm(tracking.gains))
    relative = tracking.gains / size if size > 0.0 else tracking.gains
    return Cost(tracking.qdd, tracking.directions, relative, damping, rank_tolerance)


def _weight(prefix: str, value: object) -> float:
    """Return the weight as a float; raise ConfigurationError unless rounding leaves something of it and of 1."""
    weight = _positive(f"weights[{prefix!r}]", value)
    if not 1.0 / HEAVIEST <= weight <= HEAVIEST:
        raise ConfigurationError(
            f"weights[{prefix!r}] must be between {1.0 / HEAVIEST:g} and {HEAVIEST:g}, not {shown(value)}: beside "
            "rows of so much more weight, light ones are lost in rounding"
        )
    return weight


def _positive(name: str, value: object) -> float:
    """Return the value as a float; raise ConfigurationError unless it is a positive, finite number."""
    number = positive(value)
    if number is None:
        raise ConfigurationError(f"{name} must be a positive, finite number, not {shown(value)}")
    return number
