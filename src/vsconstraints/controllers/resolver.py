"""Resolvers: ways to share q̈ among demands and task.

One half of a law; :mod:`vsconstraints.controllers.demand` is the other. A new resolver is a
compiled function, a class with its options, and an entry in
:data:`vsconstraints.controllers.resolvers.RESOLVERS`.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from ..compiled.workspace import NEEDS_PYTHON, RANK_LOSS, SOLVED
from ..errors import SolverError
from ..formulas import formula
from ..formulas.row import BOUND, EQUAL, PUSH, Row
from ..qp import SolverChain
from ..rows import Array, BoolArray, Command, IntArray, Rows, Task
from ..rows.checks import beyond_rounding
from .compiled import NO_SLACK, CompiledLaw, in_usual_layout
from .demand import Demand
from .least_norm import RANK_TOLERANCE, rank_loss
from .ranges import Part, option, rank_tolerance

COMPILED = "compiled"  #: What commands call the compiled solver.
#: What a resolver may use of the task beside J and b, as printed.
USES: dict[str, str] = {"error": "e", "error_rate": "ė"}


@formula
def remembered(row: Row) -> Any:
    """The row's memory, twice."""
    return row.memory[0], row.memory[0]


class Known(Demand):
    """Bounds that were computed beforehand and stand in the law's memory."""

    name = "known"
    formula = staticmethod(remembered)
    remembers = (np.inf,)
    everywhere = True


class KnownPush(Known):
    """Likewise, relative to L_gφ q̈ of tracking."""

    relative = True


@dataclass(frozen=True)
class Resolver(Part, ABC):
    """A way to share q̈ among the demands of rows and a task: a frozen dataclass, whose fields are
    options.
    """

    name: ClassVar[str]  #: In reports.
    #: Module and name of its compiled form, see
    #: :class:`vsconstraints.compiled.workspace.LawArrays`.
    kernel: ClassVar[tuple[str, str]]
    #: Of what answers, with the same options, where that does not.
    otherwise: ClassVar[tuple[str, str] | None] = None
    #: What it asks of demands: see :mod:`vsconstraints.formulas.row`.
    purpose: ClassVar[int] = BOUND
    uses: ClassVar[tuple[str, ...]] = ()  #: Which of ``USES`` it uses.
    #: Whether the compiled form is asked first; if not, a QP solver by name.
    compiles: ClassVar[bool] = True
    measures: ClassVar[bool] = False  #: Whether its commands report what they leave unmet.
    #: Codes with which the compiled form has an answer.
    answers: ClassVar[Collection[int]] = (SOLVED,)

    def solve(self, rows: Rows, task: Task, c: Array, solvers: SolverChain | None) -> Command:
        """The command for what rows ask for, c (m,), see :attr:`purpose`; SolverError if numbers
        leave the range.
        """
        command = self.share(rows, task, c)
        if command is None:
            raise SolverError("squares of L_gφ, J or q̈ are beyond the range of floating point")
        return command

    def share(self, rows: Rows, task: Task, c: Array) -> Command | None:
        """The same by the compiled form alone; None if it has no answer."""
        demand = (KnownPush if self.purpose == PUSH else Known)()
        memory = np.array(c[:, None], dtype=np.float64)
        qdd = np.full(task.J.shape[1], np.nan)
        acted = np.zeros(len(c), dtype=np.bool_)
        slack = np.zeros(len(c) if self.measures else 0)
        count = np.zeros(1, dtype=np.int64)
        law = CompiledLaw(demand, self, rows.labels, memory=memory)
        function, *arguments = law.call(*(in_usual_layout(rows, task) or (rows, task)))
        code = function(*arguments, qdd, acted, slack, count)
        if code == RANK_LOSS:
            return rank_loss(rows, Command(qdd, "ok", acted, rows.labels), self.options[0])
        # what was computed, but cannot be checked, is refused with the rows that say so
        if code == NEEDS_PYTHON and np.isfinite(qdd).all() and beyond_rounding(rows, qdd):
            return Command(qdd, "ok", acted, rows.labels)
        return self.command(code, qdd, acted, rows.labels, slack, int(count[0]))

    def tracks(self, demand: Demand) -> bool:
        """Whether what is asked of this demand depends on the tracking command."""
        if self.purpose == PUSH:
            return not demand.relative or demand.sees_tracking
        return demand.tracks or (self.purpose == EQUAL and not demand.everywhere)

    @property
    def options(self) -> Array:
        """What the compiled form takes; the rank tolerance first."""
        return np.array([getattr(self, each.name) for each in fields(self)])

    def solvers(self) -> SolverChain | None:
        """A chain of QP solvers for a law of its own; None if it needs none."""
        return None

    def row_weights(self, labels: tuple[str, ...]) -> Array:
        """(m,) weight of each row's violation; (0,) if all are 1."""
        return NO_SLACK

    def remark(self, labels: tuple[str, ...]) -> str:
        """What a user should know of these options and rows of these labels, though nothing is
        wrong; else empty.
        """
        return ""

    def command(
        self,
        code: int,
        qdd: Array,
        acted: BoolArray,
        labels: tuple[str, ...],
        slack: Array,
        iterations: int,
    ) -> Command | None:
        """The command of the compiled form's answer; None if the code says that there is none."""
        return Command(qdd, "ok", acted, labels) if code in self.answers else None


@dataclass(frozen=True)
class Priority(Resolver):
    """Rows that act meet their demands with equality, L_gφ q̈ = c; the task acts in their null
    space (eq. 15).

    If rows with φ ≥ 0 depend on each other the status is ``rank-loss`` (section 5.2), and demands
    are met in the least-squares sense.
    """

    rank_tolerance: float = option(
        RANK_TOLERANCE,
        "singular values below this fraction of the largest one count as zero, of the active rows "
        "once each is divided "
        "by its length",
    )

    name = "priority"
    kernel = ("task_priority", "priority")
    purpose = EQUAL

    def __post_init__(self) -> None:
        object.__setattr__(self, "rank_tolerance", rank_tolerance(self.rank_tolerance))


class Additive(Priority):
    """q̈ = q̈_track + Σ min(0, cᵢ − L_gφᵢ q̈_track) L_gφᵢ†: rows and task may each win.

    The singular values of J below ``rank_tolerance`` times the largest one count as zero.
    """

    name = "additive"
    kernel = ("task_priority", "additive")
    purpose = PUSH


def unmet(labels: tuple[str, ...], slack: Array, fixed: IntArray) -> str:
    """Which demands are unmet and by how much, and which rows nothing influences; empty if all are
    met.
    """
    exceeded = np.flatnonzero(slack > 0.0)
    if not exceeded.size:
        return ""
    amounts = ", ".join(f"{labels[i]} by {slack[i]:.3g}" for i in exceeded)
    without = ", ".join(labels[i] for i in exceeded if i in fixed)
    why = f"; no acceleration influences {without}" if without else ""
    return f"no acceleration meets every demand; unmet, in units of φ per second: {amounts}{why}"


def row_weights(labels: Sequence[str], weights: Mapping[str, float]) -> Array:
    """(m,) level-1 weight of each label: that of the longest key the label begins with, or 1."""
    keys = (
        max((prefix for prefix in weights if label.startswith(prefix)), key=len, default=None)
        for label in labels
    )
    return np.array([1.0 if key is None else weights[key] for key in keys])
