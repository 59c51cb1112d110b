"""What every resolver is: a way to share q̈ among demands and task."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...compiled import load
from ...compiled.structures import SOLVED
from ...qp import SolverChain
from ...rows import Array, BoolArray, Command, Rows, Task
from ..demands import Demand
from ..ranges import Declared

Asked = Callable[[int, Array | None], Array]
"""What the rows ask for: of a purpose (:mod:`vsconstraints.formulas.row`) and q̈ of tracking (n,), (m,)."""

NO_WEIGHTS = np.empty(0)

USES: dict[str, str] = {"error": "e", "error_rate": "ė"}
"""What a resolver may use of the task beside J and b, as printed."""


@dataclass(frozen=True)
class Resolver(ABC):
    """A way to share q̈ among the demands of rows and a task.

    A frozen dataclass: its fields are options. What it warm-starts is the law's, see :meth:`solvers`.

    Attributes
    ----------
    name
        In reports.
    kernel
        Module and name of its compiled form, see :class:`vsconstraints.compiled.structures.LawArrays`.
    otherwise
        Module and name of the compiled form that answers where this one does not, on the same options; None if there
        is none.
    uses
        Which of :data:`USES` it uses; it says so itself where that is not given.
    measures
        Whether its commands tell what they leave unmet.
    answers
        Codes with which the compiled form has an answer.
    ranges
        From where to where an option is worth searching; tolerances, limits and solvers are not.
    """

    name: ClassVar[str]
    kernel: ClassVar[tuple[str, str]]
    otherwise: ClassVar[tuple[str, str] | None] = None
    uses: ClassVar[tuple[str, ...]] = ()
    measures: ClassVar[bool] = False
    answers: ClassVar[Collection[int]] = (SOLVED,)
    ranges: ClassVar[Mapping[str, Declared]] = {}

    @abstractmethod
    def solve(self, rows: Rows, task: Task, asked: Asked, tracks: bool, solvers: SolverChain | None) -> Command:
        """The command, in NumPy.

        Parameters
        ----------
        rows, task
            Finite and of matching shapes.
        asked
            What the rows ask for.
        tracks
            Whether that depends on what tracking alone does.
        solvers
            What :meth:`solvers` has made.
        """

    @abstractmethod
    def tracks(self, demand: Demand) -> bool:
        """Whether what is asked of this demand depends on what tracking alone does."""

    @property
    @abstractmethod
    def options(self) -> Array:
        """What the compiled form takes."""

    @property
    def compiles(self) -> bool:
        """Whether the options have a compiled form."""
        return True

    def loaded(self) -> tuple[Any, Any]:
        """The compiled form, and that which answers otherwise; None where there is none."""
        return (_form(self.kernel), _form(self.otherwise)) if self.compiles else (None, None)

    def solvers(self) -> SolverChain | None:
        """A chain of QP solvers for a law of its own; None if it needs none."""
        return None

    def row_weights(self, labels: tuple[str, ...]) -> Array:
        """(m,) weight of each row's violation; (0,) if all are 1."""
        return NO_WEIGHTS

    def remark(self, labels: tuple[str, ...]) -> str:
        """What a user should know of these options and rows of these labels, though nothing is wrong; else empty."""
        return ""

    def command(
        self, code: int, qdd: Array, acted: BoolArray, labels: tuple[str, ...], slack: Array, iterations: int
    ) -> Command | None:
        """The command of the compiled form's answer; None if the code says that there is none."""
        return Command(qdd, "ok", acted, labels) if code in self.answers else None


def _form(kernel: tuple[str, str] | None) -> Any:
    module = None if kernel is None else load(kernel[0])
    return None if kernel is None or module is None else getattr(module, kernel[1])
