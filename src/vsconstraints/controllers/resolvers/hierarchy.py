"""Strict priorities: rows, task, and the acceleration nearest to q̈₀."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...compiled.structures import RELAXED_ROWS, RELAXED_SHORT, SHORT, SOLVED, STRICT
from ...errors import ConfigurationError, InvalidInput, SolverError, shown
from ...formulas.row import BOUND
from ...qp import Cost, SolverChain, lexicographic
from ...qp.lexicographic import MET, ZERO_GRADIENT
from ...rows import Array, BoolArray, Command, Rows, Task
from ..demands import Demand
from ..least_norm import RANK_TOLERANCE, LeastNorm, least_norm
from ..options import Fixed, positive, rank_tolerance
from .base import NO_WEIGHTS, Asked, Resolver

AUTO = "auto"
"""Compiled where there is a compiler, and else daqp."""

DEFAULT = "daqp"

COMPILED = "compiled"
"""What commands call the compiled solver."""

HEAVIEST = 1e10
"""Largest weight of a row, and the inverse of the least: those without one have 1."""

ANSWERS = {SOLVED: (False, False), RELAXED_ROWS: (True, False), SHORT: (False, True), RELAXED_SHORT: (True, True)}
"""Codes of answers: whether demands are unmet, and whether levels 2 and 3 may be."""

UNPROVED = "rounding does not allow to prove that the task and the accelerations are the least that the rows allow"

IntArray = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class Hierarchy(Resolver):
    """Strict priorities: (1) rows, (2) task, (3) least ‖q̈ − q̈₀‖, as a lexicographic quadratic program.

    What the levels are: see :class:`vsconstraints.controllers.HierarchicalQP`.

    How it is computed: levels 2 and 3 are one strictly convex QP, min ½Σⱼ(gⱼ² + damping)vⱼ² in the
    coordinates v = Vᵀ(q̈ − q̈_track) of the singular vectors of J with relative gains g, with hard rows. Only if the hard
    rows are incompatible is level 1 computed, exactly; the violated rows then become equalities, which are eliminated
    with an orthonormal basis, and the QP is solved in the remaining coordinates. A large weight or soft rows in place
    of this were measured to be wrong.

    How strict level 2 is: where J leaves directions free and the damping has cost the task more than a residual of 1e-6
    ‖J‖‖q̈ − q̈_track‖, level 2 is found by itself, and level 3 within it. It then uses every direction within the rows
    whose gain is above ``rank_tolerance`` relative to J, however large the accelerations; ``max_acceleration`` is there
    to bound them. Two exceptions tame tasks that are nearly singular. Where J has a relative gain below 1e-3, level 2
    uses directions within the rows only above √damping. And where J leaves no direction free, the QP's minimiser is the
    answer: level 3 wins in directions whose relative gain is below √damping, and takes a fraction of damping/gⱼ² from
    others. If rounding does not allow to prove that levels 2 and 3 are met, the status is ``suboptimal``: the rows are
    met, and no known point that meets them has a smaller residual.

    Parameters
    ----------
    solver, weights, max_acceleration, damping, rank_tolerance
        See :class:`vsconstraints.controllers.HierarchicalQP`.
    """

    solver: str = AUTO
    weights: Mapping[str, float] | None = None
    max_acceleration: float | None = None
    damping: float = 1e-8
    rank_tolerance: float = RANK_TOLERANCE

    name = "hierarchy"
    kernel: ClassVar[tuple[str, str]] = ("hierarchical_qp", "descend")
    measures: ClassVar[bool] = True
    answers: ClassVar[Collection[int]] = ANSWERS

    def __post_init__(self) -> None:
        checked: dict[str, object] = {"damping": positive_number("damping", self.damping)}
        if self.max_acceleration is not None:
            checked["max_acceleration"] = positive_number("max_acceleration", self.max_acceleration)
        weights = self.weights
        if weights is not None:
            if not (isinstance(weights, Mapping) and all(isinstance(prefix, str) for prefix in weights)):
                raise ConfigurationError(f"weights must map beginnings of labels to numbers, not {shown(weights)}")
            checked["weights"] = Fixed({prefix: _weight(prefix, weight) for prefix, weight in weights.items()})
        checked["rank_tolerance"] = rank_tolerance(self.rank_tolerance)
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def compiles(self) -> bool:
        """Whether no solver is asked for by name."""
        return self.solver == AUTO

    @property
    def bound(self) -> float:
        """Half the width of the box that this is an option of, or infinity."""
        return math.inf if self.max_acceleration is None else self.max_acceleration

    @property
    def options(self) -> Array:
        """See :class:`.Resolver`."""
        return np.array([self.rank_tolerance, self.bound, self.damping, float(self.aim)])

    @property
    def aim(self) -> int:
        """What the levels below the rows are: one of those of :mod:`vsconstraints.compiled.structures`."""
        return STRICT

    def near(self, rows: Rows, tracking: LeastNorm, c: Array) -> tuple[LeastNorm, BoolArray]:
        """What these levels stay near to, as a least-norm problem, and the (m,) rows that have shaped it.

        Parameters
        ----------
        rows, tracking, c
            The rows, the task, and what the rows ask for.
        """
        return tracking, np.zeros(c.size, dtype=np.bool_)

    def box(self, rows: Rows, n: int) -> Array:
        """(2, n) least and greatest q̈: what ``max_acceleration`` leaves of what the rows allow, or what is nearest."""
        box: Array = np.array([[-self.bound], [self.bound]]) * np.ones(n)
        return np.clip(box, rows.qdd_min, rows.qdd_max) if len(rows.qdd_max) else box

    def solvers(self) -> SolverChain:
        """See :class:`.Resolver`."""
        return SolverChain(DEFAULT if self.solver == AUTO else self.solver)

    def tracks(self, demand: Demand) -> bool:
        """See :class:`.Resolver`."""
        return demand.tracks

    def row_weights(self, labels: tuple[str, ...]) -> Array:
        """See :class:`.Resolver`."""
        return row_weights(labels, self.weights) if self.weights else NO_WEIGHTS

    def remark(self, labels: tuple[str, ...]) -> str:
        """Which weights concern no label."""
        weights = self.weights or {}
        idle = [shown(prefix) for prefix in weights if not any(label.startswith(prefix) for label in labels)]
        return f"weights that begin no row's label: {', '.join(idle)}" if idle and labels else ""

    def command(
        self, code: int, qdd: Array, acted: BoolArray, labels: tuple[str, ...], slack: Array, iterations: int
    ) -> Command | None:
        """See :class:`.Resolver`."""
        if code not in self.answers:
            return None
        command = Command(qdd, "ok", acted, labels, "", slack, COMPILED if iterations else "", iterations)
        if code:
            relaxed, short = ANSWERS[code]
            command.status = "relaxed" if relaxed else "suboptimal"
            why = unmet(labels, slack, np.flatnonzero(~acted & (slack > 0.0)))
            command.reason = "; ".join(filter(None, (why, UNPROVED if short else "")))
        return command

    def solve(self, rows: Rows, task: Task, asked: Asked, tracks: bool, solvers: SolverChain | None) -> Command:
        """See :class:`.Resolver`."""
        assert solvers is not None
        tracking = least_norm(task.J, task.b, self.rank_tolerance, task.rest)
        c = asked(BOUND, tracking.qdd if tracks else None)
        tracking, shaped = self.near(rows, tracking, c)
        command = self._descend(rows, tracking, c, solvers)
        command.acted |= shaped
        return command

    def _descend(self, rows: Rows, tracking: LeastNorm, c: Array, solvers: SolverChain) -> Command:
        """The command of all levels."""
        which = np.flatnonzero(c < np.inf)
        A, c = rows.Lg[which], c[which]
        excess = A @ tracking.qdd - c
        lower, upper = self.box(rows, tracking.qdd.size)
        inside = bool(((lower <= tracking.qdd) & (tracking.qdd <= upper)).all())
        if inside and (excess <= 0.0).all():
            return self._tracks(rows, tracking)
        norms = np.sqrt(np.einsum("ij,ij->i", A, A))
        fixed = norms <= ZERO_GRADIENT * rows.scale[which]
        # a demand beyond the range of floating point exceeds nothing by a fraction of itself
        met = (excess < np.inf) & (excess <= MET * (norms * np.linalg.norm(tracking.qdd) + np.abs(c)))
        if inside and (met & ~fixed | (c >= 0.0) & fixed).all():
            return self._tracks(rows, tracking)
        return self._resist(rows, tracking, solvers, (which, A, c, fixed))

    @staticmethod
    def _tracks(rows: Rows, tracking: LeastNorm) -> Command:
        """No row resists."""
        m = len(rows.labels)
        return Command(tracking.qdd, "ok", np.zeros(m, dtype=np.bool_), rows.labels, slack=np.zeros(m))

    def _resist(
        self,
        rows: Rows,
        tracking: LeastNorm,
        solvers: SolverChain,
        demand: tuple[IntArray, Array, Array, BoolArray],
    ) -> Command:
        """Answer where some row, or the box, does not allow the tracking command."""
        which, A, c, fixed = demand
        free = which[~fixed]
        labels = [rows.labels[i] for i in free]
        weights = row_weights(labels, self.weights or {})
        cost = replace(task_cost(tracking, self.damping, self.rank_tolerance), strict=self.aim == STRICT)
        try:
            box = self.box(rows, tracking.qdd.size)
            optimum = lexicographic(A[~fixed], c[~fixed], weights, cost, solvers, box)
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


def unmet(labels: tuple[str, ...], slack: Array, fixed: NDArray[np.intp]) -> str:
    """Say which demands are unmet and by how much; empty if none is."""
    unmet = np.flatnonzero(slack > 0.0)
    if not unmet.size:
        return ""
    amounts = ", ".join(f"{labels[i]} by {slack[i]:.3g}" for i in unmet)
    why = (
        ""
        if not np.isin(unmet, fixed).any()
        else "; no acceleration influences " + ", ".join(labels[i] for i in unmet if i in fixed)
    )
    return f"no acceleration meets every demand; unmet, in units of φ per second: {amounts}{why}"


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
    """State levels 2 and 3 as one cost, ½Σⱼ(gⱼ² + damping)vⱼ² with v = Vᵀ(q̈ − q̈_track).

    g are the gains of J relative to the norm of all. With Jq̈ fixed, q̈ − q̈_track differs from q̈ − q̈₀ by
    a constant that is orthogonal to the null space of J, so that the damping term minimises ‖q̈ − q̈₀‖ there; and without
    rows the minimiser is q̈_track itself, whatever the damping.
    """
    size = float(np.linalg.norm(tracking.gains))
    relative = tracking.gains / size if size > 0.0 else tracking.gains
    return Cost(tracking.qdd, tracking.directions, relative, damping, rank_tolerance)


def _weight(prefix: str, value: object) -> float:
    """Return the weight as a float; raise ConfigurationError unless rounding leaves something of it and of 1."""
    weight = positive_number(f"weights[{prefix!r}]", value)
    if not 1.0 / HEAVIEST <= weight <= HEAVIEST:
        raise ConfigurationError(
            f"weights[{prefix!r}] must be between {1.0 / HEAVIEST:g} and {HEAVIEST:g}, not {shown(value)}: beside "
            "rows of so much more weight, light ones are lost in rounding"
        )
    return weight


def positive_number(name: str, value: object) -> float:
    """Return the value as a float; raise ConfigurationError unless it is a positive, finite number."""
    number = positive(value)
    if number is None:
        raise ConfigurationError(f"{name} must be a positive, finite number, not {shown(value)}")
    return number
