"""Laws by their compiled functions, where there are any."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..compiled import entry, load
from ..rows import ARRAYS, UNKNOWN, Array, BoolArray, Command, IntArray, Rows, Task, keep_box
from .demands import Demand

if TYPE_CHECKING:
    from ..compiled.structures import LawArrays

BOOL, COUNT, EMPTY = np.dtype(np.bool_), np.dtype(np.int64), np.empty
"""Looked up once: that takes a third of the time of making a small array."""

NO_SLACK, NO_COUNT, NO_MEMORY = np.empty(0), np.zeros(1, COUNT), np.empty((0, 0))
"""What is handed to laws that write neither, and remember nothing."""

SCRATCH = 4096
"""Numbers of scratch of a law: enough for 30 rows, seven joints and eight features. Beyond that arrays are made."""

NOT_FOR_COMPILED = Exception
"""Raised for arrays of other types, layouts or numbers of dimensions, some of them errors of numba's own: those are for
the definition, which answers, or says what is wrong."""


class CompiledLaw:
    """A compiled law for rows of some labels.

    Attributes
    ----------
    arrays, address
        The law as compiled loops take it, and where they find it.
    labels, remark
        Of the rows; and what is to be said of them and the options.
    measures, whole
        Whether it tells what it leaves unmet, and whether it uses more than usual of the rows.
    """

    __slots__ = ("_follow", "_follow_whole", "_frozen", "address", "arrays", "labels", "measures", "remark", "whole")

    def __init__(self, arrays: LawArrays, labels: tuple[str, ...], remark: str, measures: bool, whole: bool) -> None:
        laws = load("laws")
        self._follow, self._follow_whole = laws.follow.unchecked, laws.follow_whole.unchecked
        self.arrays, self.labels, self.remark, self.measures, self.whole = arrays, labels, remark, measures, whole
        self._frozen = load("structures").pack_struct(arrays)
        self.address = int(self._frozen.ctypes.data)

    def call(self, rows: Rows, task: Task) -> tuple[Any, ...]:
        """The function that answers, of :mod:`vsconstraints.compiled.laws`, and what it takes before its outputs."""
        phi, gain, scale, box = rows.phi, rows.switching_gain, rows.scale, (rows.qdd_min, rows.qdd_max)
        if self.whole or (rows.qdd_max is not UNKNOWN or rows.qdd_min is not UNKNOWN or task.rest is not UNKNOWN):
            known = rows.sigma, rows.sigma_dot, rows.K, gain, scale, *box
            return (
                self._follow_whole, self.address, len(rows.labels), phi, rows.Lg, rows.Lf, *known, task.J, task.b,
                task.error, task.error_rate, task.rest,
            )  # fmt: skip
        return (
            self._follow,
            self.address,
            len(rows.labels),
            phi,
            rows.Lg,
            rows.Lf,
            gain,
            scale,
            task.J,
            task.b,
        )

    def __call__(self, rows: Rows, task: Task) -> tuple[int, Array, BoolArray, Array, int]:
        """Its code, q̈ (n,), the rows that acted (m,), slack (m,) or (0,), and iterations."""
        J = task.J
        m = len(rows.labels)
        qdd, acted = EMPTY(J.shape[1]), EMPTY(m, BOOL)
        slack, count = (EMPTY(m), EMPTY(1, COUNT)) if self.measures else (NO_SLACK, NO_COUNT)
        if self.whole or (rows.qdd_max is not UNKNOWN or rows.qdd_min is not UNKNOWN or task.rest is not UNKNOWN):
            function, *arguments = self.call(rows, task)
            code = function(*arguments, qdd, acted, slack, count)
        else:
            # as call has it, without a tuple in between, which takes longer
            gain, scale = rows.switching_gain, rows.scale
            code = self._follow(
                self.address, m, rows.phi, rows.Lg, rows.Lf, gain, scale, J, task.b, qdd, acted, slack, count
            )
        return code, qdd, acted, slack, int(count[0]) if self.measures else 0


def compiled_law(
    demand: Demand,
    resolver: Any,
    labels: tuple[str, ...],
    *,
    memory: Array = NO_MEMORY,
    last_rates: Array = UNKNOWN,
    period: float | None = None,
    always: bool = False,
) -> CompiledLaw | None:
    """A demand and a :class:`.Resolver` for rows of some labels; None where they have no compiled form.

    Parameters
    ----------
    demand, resolver, labels
        What the law consists of, and names of its m rows.
    memory, last_rates
        (m, f) and (m,) what the demand remembers, written by every call.
    period
        T_s [s], if it is known.
    always
        Whether the resolver's form is asked for even where its options ask for a solver that is not compiled.
    """
    function, otherwise = resolver.loaded(always)
    if function is None:
        return None
    laws, address, structures = load("laws"), load("parts").address, load("structures")
    asks = laws.demand(
        type(demand).formula, len(demand.parameters), len(demand.remembers), demand.relative, demand.everywhere
    )
    if asks is None:
        return None
    m = len(labels)
    arrays = structures.LawArrays(
        address(function),
        address(asks),
        address(load("task_priority").track),
        address(otherwise) if otherwise else 0,
        int(resolver.tracks(demand)),
        math.nan if period is None else period,
        resolver.options,
        np.array(demand.parameters, dtype=np.float64),
        resolver.row_weights(labels),
        memory,
        last_rates,
        np.empty(m),
        np.empty(m),
        np.empty_like(memory),
        np.empty(m),
        np.full(1, math.nan),
        structures.Scratch(np.empty(SCRATCH), np.zeros(1, COUNT)),
    )
    whole = bool(resolver.uses or {"sigma", "sigma_dot", "K"} & {*demand.uses})
    return CompiledLaw(arrays, labels, resolver.remark(labels), resolver.measures, whole)


def in_usual_layout(rows: object, task: object) -> tuple[Rows, Task] | None:
    """The same rows and task in plain contiguous, writable arrays; None if they are so, or if something is wrong."""
    if not (isinstance(rows, Rows) and isinstance(task, Task)):
        return None
    arrays = [rows.phi, rows.Lg, rows.Lf, rows.switching_gain, rows.scale, rows.sigma, rows.sigma_dot, rows.K]
    arrays += [rows.qdd_min, rows.qdd_max, task.J, task.b, task.error, task.error_rate, task.rest]
    if not all(type(array) in ARRAYS and array.dtype == np.float64 for array in arrays):
        return None
    if all(type(array) is np.ndarray and array.flags.carray for array in arrays):
        return None
    phi, Lg, Lf, gain, *others = (np.array(array, order="C") for array in arrays)
    return Rows(phi, Lg, Lf, gain, rows.labels, *others[:6]), Task(*others[6:])


class BoundLaw:
    """A compiled law on arrays that stay where they are, for loops: every call overwrites what the one before wrote.

    Attributes
    ----------
    solve
        Writes ``acted`` (m,) and ``qdd`` (n,), and returns 0 if they hold the answer; if not, the controller's
        ``command`` has to be asked.
    arrays
        The law as compiled loops take it, with ``slack`` (m,) or (0,) and ``count`` (1,) of iterations.
    answer
        Where compiled code finds what it writes: see :class:`vsconstraints.compiled.structures.Answer`.
    """

    __slots__ = (
        "_answers", "_code", "_command", "_frozen", "_function", "_made", "_rows", "acted", "answer", "arrays", "count",
        "qdd", "slack", "solve",
    )  # fmt: skip

    def __init__(self, resolver: Any, made: Any, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> None:
        self._answers, self._made, self.arrays, self._command = resolver.answers, made, made.arrays, resolver.command
        self.acted, self.qdd, self._rows, self._code = acted, qdd, rows, 0
        self.slack = np.empty(len(made.labels)) if made.measures else NO_SLACK
        self.count: IntArray = np.zeros(1, COUNT)
        structures = load("structures")
        outputs = qdd, acted, self.slack, self.count
        self._frozen = structures.pack_struct(structures.Answer(*outputs, NO_SLACK))
        self.answer = int(self._frozen.ctypes.data)
        function, *arguments = made.call(rows, task)
        self._function = partial(entry(function), *arguments, *outputs)
        self.solve: Callable[[], int] = self._solve if made.measures else self._function

    def _solve(self) -> int:
        self._code = code = self._function()
        return 0 if code in self._answers else code

    @property
    def address(self) -> int:
        """Where compiled code finds the law."""
        place: int = self._made.address
        return place

    def command(self, code: int | None = None) -> Command | None:
        """The last answer, in arrays of its own, by its code if that is known; None if it is none."""
        code, made = self._code if code is None else code, self._made
        slack, count = (self.slack.copy(), int(self.count[0])) if made.measures else (NO_SLACK, 0)
        command: Command | None = self._command(code, self.qdd.copy(), self.acted.copy(), made.labels, slack, count)
        if command is not None and self._rows.qdd_max is not UNKNOWN:
            keep_box(self._rows, command)
        if made.remark and command is not None:
            command.remark = made.remark
        return command
