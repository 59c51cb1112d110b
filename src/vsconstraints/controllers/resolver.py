"""Base class of resolvers, which compute q̈ from bounds and task, with the two simplest ones.

A resolver is one half of a law; :mod:`vsconstraints.controllers.demand` is the other. A new
resolver is a compiled function, a class with its options, and an entry in
:data:`vsconstraints.controllers.resolvers.RESOLVERS`.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from ..compiled.codes import NEEDS_PYTHON, RANK_LOSS, SOLVED, TOLERANCE
from ..errors import SolverError
from ..formulas import formula
from ..formulas.row import BOUND, EQUAL, PUSH, Row
from ..qp import SolverChain
from ..rows import Array, Command, IntArray, Rows, Task
from ..rows.checks import beyond_rounding
from .compiled import NO_SLACK, CompiledAnswer, CompiledLaw, in_usual_layout
from .demand import Demand
from .least_norm import RANK_TOLERANCE, rank_loss
from .ranges import Part, option, rank_tolerance

COMPILED = "compiled"  #: Name of the compiled solver in commands.
#: Fields of the task that a resolver may use in addition to J and b, with printed symbols.
USES: dict[str, str] = {"error": "e", "error_rate": "ė"}


@formula
def remembered(row: Row) -> Any:
    """Return the memory of the row twice: as its bound and as its next memory."""
    return row.memory[0], row.memory[0]


class Known(Demand):
    """Bounds that are computed beforehand and stored in the memory of the law."""

    name = "known"
    formula = staticmethod(remembered)
    remembers = (np.inf,)
    everywhere = True


class KnownPush(Known):
    """Bounds as of ``Known``, relative to L_gφ q̈ of tracking."""

    relative = True


@dataclass(frozen=True)
class Resolver(Part, ABC):
    """Method that computes q̈ from the bounds of the rows and the task.

    A frozen dataclass; its fields are the options.
    """

    name: ClassVar[str]  #: Name in reports.
    #: Module and name of the compiled form, see
    #: :class:`vsconstraints.compiled.workspace.LawArrays`.
    kernel: ClassVar[tuple[str, str]]
    #: Module and name of the fallback, with the same options, where the kernel has no answer.
    otherwise: ClassVar[tuple[str, str] | None] = None
    #: Kind of bound that is needed of a demand, see :mod:`vsconstraints.formulas.row`.
    purpose: ClassVar[int] = BOUND
    uses: ClassVar[tuple[str, ...]] = ()  #: Keys of ``USES``.
    #: True if the compiled form is tried first, false if a QP solver is requested by name.
    compiles: ClassVar[bool] = True
    measures: ClassVar[bool] = False  #: True if commands report their slack.
    #: Return codes with which the compiled form has an answer.
    answers: ClassVar[Collection[int]] = (SOLVED,)

    def solve(self, rows: Rows, task: Task, c: Array, solvers: SolverChain | None) -> Command:
        """Compute the command for the bounds c (m,) of the rows, of the kind :attr:`purpose`.

        Raises SolverError if a number leaves the range of floating point.
        """
        command = self.command_compiled(rows, task, c)
        if command is None:
            raise SolverError("squares of L_gφ, J or q̈ are beyond the range of floating point")
        return command

    def command_compiled(self, rows: Rows, task: Task, c: Array) -> Command | None:
        """Compute the command by the compiled form alone; None if it has no answer."""
        # a demand whose bounds are the memory that it is given
        demand = KnownPush() if self.purpose == PUSH else Known()
        memory = np.array(c[:, None], dtype=np.float64)
        law = CompiledLaw(demand, self, rows.labels, memory=memory)
        m = len(c)
        copied = in_usual_layout(rows, task)
        if copied is not None:
            rows, task = copied
        n = task.J.shape[1]
        qdd = np.full(n, np.nan)
        acted = np.zeros(m, dtype=np.bool_)
        slack = np.zeros(m if self.measures else 0)
        count = np.zeros(1, dtype=np.int64)
        function, *arguments = law.call(rows, task)
        code = function(*arguments, qdd, acted, slack, count)
        if code == RANK_LOSS:
            command = Command(qdd, "ok", acted, rows.labels)
            return rank_loss(rows, command, self.options[TOLERANCE])
        if code == NEEDS_PYTHON:
            is_finite = np.isfinite(qdd).all()
            # the caller's check refuses an answer beyond rounding, and names the rows
            if is_finite and beyond_rounding(rows, qdd):
                return Command(qdd, "ok", acted, rows.labels)
        answer = CompiledAnswer(code, qdd, acted, slack, int(count[0]))
        return self.command(answer, rows.labels)

    def tracks(self, demand: Demand) -> bool:
        """True if the bounds used of this demand depend on the tracking command."""
        if self.purpose == PUSH:
            return not demand.relative or demand.sees_tracking
        return demand.tracks or (self.purpose == EQUAL and not demand.everywhere)

    @property
    def options(self) -> Array:
        """Options of the compiled form; the rank tolerance is the first."""
        return np.array([getattr(self, each.name) for each in fields(self)])

    def solvers(self) -> SolverChain | None:
        """Create the chain of QP solvers of one law; None if none is needed."""
        return None

    def row_weights(self, labels: tuple[str, ...]) -> Array:
        """Return the weight (m,) of each row's violation; (0,) if all are 1."""
        return NO_SLACK

    def remark(self, labels: tuple[str, ...]) -> str:
        """Return a remark on the options and these row labels; empty if there is none.

        Remarks tell the user about input that is usable but suspicious.
        """
        return ""

    def command(self, answer: CompiledAnswer, labels: tuple[str, ...]) -> Command | None:
        """Return the command for the output of the compiled form; None if it has no answer."""
        if answer.code not in self.answers:
            return None
        return Command(answer.qdd, "ok", answer.acted, labels)


@dataclass(frozen=True)
class Priority(Resolver):
    """Task priority (eq. 15): active rows meet L_gφ q̈ = c, the task acts in their null space.

    If rows with φ ≥ 0 are linearly dependent, the status is ``rank-loss`` (section 5.2), and the
    demands are met in the least-squares sense.
    """

    rank_tolerance: float = option(
        RANK_TOLERANCE,
        "singular values below this fraction of the largest one count as zero; the active rows "
        "are divided by their length first",
    )

    name = "priority"
    kernel = ("task_priority", "priority")
    purpose = EQUAL

    def __post_init__(self) -> None:
        object.__setattr__(self, "rank_tolerance", rank_tolerance(self.rank_tolerance))


class Additive(Priority):
    """Sum q̈ = q̈_track + Σ min(0, cᵢ − L_gφᵢ q̈_track) L_gφᵢ†: no priority of rows or task.

    The singular values of J below ``rank_tolerance`` times the largest one count as zero.
    """

    name = "additive"
    kernel = ("task_priority", "additive")
    purpose = PUSH


def unmet(labels: tuple[str, ...], slack: Array, fixed: IntArray) -> str:
    """Describe the unmet demands and the rows that no q̈ influences; empty if all are met."""
    exceeded = np.flatnonzero(slack > 0.0)
    if not exceeded.size:
        return ""
    amounts = ", ".join(f"{labels[i]} by {slack[i]:.3g}" for i in exceeded)
    without = ", ".join(labels[i] for i in exceeded if i in fixed)
    why = f"; no acceleration influences {without}" if without else ""
    return f"no acceleration meets every demand; unmet, in units of φ per second: {amounts}{why}"


def row_weights(labels: Sequence[str], weights: Mapping[str, float]) -> Array:
    """Return the level-1 weight (m,) of each label: of its longest matching prefix, or 1."""
    of_rows = []
    for label in labels:
        prefixes = [prefix for prefix in weights if label.startswith(prefix)]
        longest = max(prefixes, key=len, default=None)
        of_rows.append(1.0 if longest is None else weights[longest])
    return np.array(of_rows)
