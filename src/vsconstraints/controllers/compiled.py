"""Compiled form of laws: their workspaces and the calls of compiled functions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..compiled import load
from ..compiled.memory import Workspace, zeros
from ..compiled.workspace import Answer, LawArrays, RowArrays, Scratch, TaskArrays
from ..rows import ARRAYS, UNKNOWN, Array, BoolArray, Command, IntArray, Rows, Task, keep_box
from .demand import Demand

#: Data types, looked up once: the lookup takes a third of the time of making a small array.
BOOL = np.dtype(np.bool_)
COUNT = np.dtype(np.int64)
EMPTY = np.empty
#: Placeholders for laws without slack, without an iteration count, or without memory.
NO_SLACK = np.empty(0)
NO_COUNT = np.zeros(1, COUNT)
NO_MEMORY = np.empty((0, 0))
#: Scratch of a law for 32 rows, in floats: enough for 30 joints and eight features. Larger
#: problems allocate their arrays.
SCRATCH = 32768


class CompiledAnswer(NamedTuple):
    """Output of a compiled law.

    ``code`` is one of :mod:`vsconstraints.compiled.codes`. ``qdd`` is (n,), ``acted`` (m,),
    and ``slack`` (m,), or (0,) for laws that do not measure it.
    """

    code: int
    qdd: Array
    acted: BoolArray
    slack: Array
    iterations: int


def arrays_of(rows: Rows) -> RowArrays:
    """Return rows in the form that compiled functions take."""
    return RowArrays(*(getattr(rows, name) for name in RowArrays._fields))


def whole_call(workspace: Workspace, rows: Rows, task: Task) -> tuple[Any, ...]:
    """Return the function that uses all fields of rows and task, with its input arguments.

    The output arguments follow the inputs.
    """
    known = (
        rows.sigma,
        rows.sigma_dot,
        rows.K,
        rows.switching_gain,
        rows.scale,
        rows.qdd_min,
        rows.qdd_max,
    )
    of_task = task.J, task.b, task.error, task.error_rate, task.rest, task.qd
    return load("laws").follow_whole, workspace, (rows.phi, rows.Lg, rows.Lf, *known), of_task


def tracking_of(task: Any, n: int, k: int) -> Array:
    """Return the gains (5,) of tracking and rest motion, for n joints and k features.

    They are K_p(0), its slope and K_v/√K_p of the visual task, then d and (d/2)² of its q̈₀.
    """
    gains = task.gains
    rest = task.rest_of(n, k)
    return np.array([gains.Kp0, gains.Kp_slope, gains.damping, rest.damping, rest.stiffness])


def _function(place: tuple[str, str]) -> Any:
    """Return a compiled function by its module and name."""
    module, name = place
    return getattr(load(module), name)


class CompiledLaw:
    """Workspace of a demand and a resolver, for rows with fixed labels.

    ``workspace`` is the form that compiled functions take. ``arrays`` are the :class:`.LawArrays`,
    ``remark`` is a remark on labels and options. ``complete`` is true if no part of the law needs a
    step outside the functions of :mod:`vsconstraints.compiled`, also where these run in Python for
    want of a compiler. It is false if numba refuses the formula of the demand, if a solver is
    requested by name, or if the law's own class replaces ``solve``.
    Every call writes ``memory`` (m, f) and ``last_rates`` (m,), the memory of the demand.
    ``period`` is T_s [s], or None if it is unknown.
    """

    __slots__ = (
        "_follow",
        "_follow_whole",
        "_whole",
        "arrays",
        "complete",
        "labels",
        "measures",
        "remark",
        "workspace",
    )

    def __init__(
        self,
        demand: Demand,
        resolver: Any,
        labels: tuple[str, ...],
        *,
        memory: Array = NO_MEMORY,
        last_rates: Array = UNKNOWN,
        period: float | None = None,
    ) -> None:
        laws = load("laws")
        parts = load("parts")
        formula = type(demand).formula
        form = (
            len(demand.parameters),
            len(demand.remembers),
            demand.relative,
            demand.everywhere,
            demand.ahead,
        )
        bounds = laws.demand(formula, *form)
        self.complete = resolver.compiles and bounds is not None
        if bounds is None:
            bounds = laws.require_part(formula, *map(int, form))
        otherwise = 0
        if resolver.compiles and resolver.otherwise is not None:
            otherwise = parts.address(_function(resolver.otherwise))
        m = len(labels)
        room = SCRATCH * (1 + m // 32)
        self.arrays = LawArrays(
            resolver=parts.address(_function(resolver.kernel)),
            demand=parts.address(bounds),
            track=parts.address(load("task_priority").track),
            otherwise=otherwise,
            tracks=int(resolver.tracks(demand)),
            period=math.nan if period is None else period,
            options=resolver.options,
            parameters=np.array([*demand.parameters, demand.margin]),
            weights=resolver.row_weights(labels),
            memory=memory,
            last_rates=last_rates,
            speeds=UNKNOWN,
            squared=np.empty(m),
            asked=np.empty(m),
            after=np.empty_like(memory),
            tracked=np.empty(m),
            effort=np.full(1, math.nan),
            scratch=Scratch(np.empty(room), np.zeros(1, COUNT)),
            rows=zeros(RowArrays),
            task=zeros(TaskArrays),
            answer=zeros(Answer),
        )
        self.labels = labels
        self.remark = resolver.remark(labels)
        self.measures = resolver.measures
        self._whole = bool(resolver.uses or {"sigma", "sigma_dot", "K"} & {*demand.used})
        self.workspace = Workspace(self.arrays)
        self._follow = laws.follow.bind(self.workspace, typed=True)
        self._follow_whole = laws.follow_whole.bind(self.workspace, typed=True)

    def call(self, rows: Rows, task: Task) -> tuple[Any, ...]:
        """Return the compiled function for these rows and this task, with its input arguments.

        It is a function of :mod:`vsconstraints.compiled.laws`. Its output arguments follow the
        inputs.
        """
        if self._whole or (
            rows.qdd_max is not UNKNOWN or rows.qdd_min is not UNKNOWN or task.rest is not UNKNOWN
        ):
            return whole_call(self.workspace, rows, task)
        of_rows = rows.phi, rows.Lg, rows.Lf, rows.switching_gain, rows.scale
        return load("laws").follow, self.workspace, of_rows, task.J, task.b

    def __call__(self, rows: Rows, task: Task) -> CompiledAnswer:
        """Compute the answer for these rows and this task."""
        J = task.J
        m = len(rows.labels)
        qdd = EMPTY(J.shape[1])
        acted = EMPTY(m, BOOL)
        slack = NO_SLACK
        count = NO_COUNT
        if self.measures:
            slack = EMPTY(m)
            count = EMPTY(1, COUNT)
        if self._whole or (
            rows.qdd_max is not UNKNOWN or rows.qdd_min is not UNKNOWN or task.rest is not UNKNOWN
        ):
            _, _, *arguments = self.call(rows, task)
            code = self._follow_whole(*arguments, qdd, acted, slack, count)
        else:  # the same as in call(), inlined because a call takes longer
            of_rows = rows.phi, rows.Lg, rows.Lf, rows.switching_gain, rows.scale
            code = self._follow(of_rows, J, task.b, qdd, acted, slack, count)
        iterations = count.item() if self.measures else 0
        return CompiledAnswer(code, qdd, acted, slack, iterations)

    def demanded(self, rows: Rows, tracking: Array | None, purpose: int) -> Array:
        """Return the bounds c (m,) of the rows by the formula of the demand.

        ``tracking`` (n,) is the tracking command, None if it is not used. The next memory is
        written to ``arrays.after``. See :mod:`vsconstraints.formulas.row` for the values of
        ``purpose``.
        """
        arrays = self.arrays
        arrays.squared[:] = (rows.Lg * rows.Lg).sum(axis=1)
        arrays.effort[0] = math.nan
        tracked = UNKNOWN
        if tracking is not None:
            arrays.effort[0] = np.linalg.norm(tracking)
            tracked = rows.Lg @ tracking
        inputs = self.workspace.address, arrays_of(rows), tracked, purpose
        outputs = arrays.after, arrays.asked
        load("parts").call_int_pointer(arrays.demand, (*inputs, *outputs))
        c: Array = arrays.asked.copy()
        return c


class Wrapped:
    """Compiled law whose resolver is replaced by a compiled ``function``.

    For the attributes see the inner law. ``own`` are the arrays of the function, and ``changed``
    are the fields of :class:`.LawArrays` that differ from those of the inner law. Both workspaces
    are kept, because compiled functions hold their addresses.
    """

    def __init__(self, inner: Any, own: Any, function: Any, **changed: Any) -> None:
        self.labels = inner.labels
        self.remark = inner.remark
        self.measures = inner.measures
        self.own = own
        self._inner = inner
        self._workspace = Workspace(own)
        addresses = {
            "resolver": load("parts").address(function),
            "demand": self._workspace.address,
        }
        self.arrays: LawArrays = inner.arrays._replace(**addresses, **changed)
        self.workspace = Workspace(self.arrays)

    def call(self, rows: Rows, task: Task) -> tuple[Any, ...]:
        """See :meth:`.CompiledLaw.call`."""
        return whole_call(self.workspace, rows, task)


def in_usual_layout(rows: object, task: object) -> tuple[Rows, Task] | None:
    """Return rows and task in plain, contiguous, writable arrays.

    None if they have this layout already, or if one of them has a wrong type.
    """
    if not (isinstance(rows, Rows) and isinstance(task, Task)):
        return None
    of_rows = _fields_of(rows)
    labels = of_rows.pop("labels")
    of_task = _fields_of(task)
    arrays = [*of_rows.values(), *of_task.values()]
    if all(map(_is_usual, arrays)):
        return None
    if not all(map(_is_numeric, arrays)):
        return None
    return Rows(labels=labels, **_copies(of_rows)), Task(**_copies(of_task))


def _fields_of(structure: Rows | Task) -> dict[str, Any]:
    return {field.name: getattr(structure, field.name) for field in fields(structure)}


def _is_numeric(array: Any) -> bool:
    return type(array) in ARRAYS and array.dtype == np.float64


def _is_usual(array: Any) -> bool:
    return type(array) is np.ndarray and array.flags.carray


def _copies(arrays: dict[str, Any]) -> dict[str, Array]:
    return {name: np.array(array, order="C") for name, array in arrays.items()}


class BoundLaw:
    """Compiled law on fixed arrays, for loops: every call overwrites the previous answer.

    ``solve()`` writes ``acted`` (m,) and ``qdd`` (n,). It returns 0 if they hold the answer;
    otherwise call the ``command`` of the controller. ``arrays`` are those of the law, in its
    ``workspace``. ``slack`` is (m,) or (0,), and ``count`` (1,) is the number of iterations.
    ``answer`` is the workspace of the outputs, see :mod:`vsconstraints.compiled.workspace`.
    """

    def __init__(
        self, resolver: Any, law: Any, rows: Rows, task: Task, acted: BoolArray, qdd: Array
    ):
        self.resolver = resolver
        self.law = law
        self._rows = rows
        self._code = 0
        self.arrays = law.arrays
        self.workspace = law.workspace
        self.acted = acted
        self.qdd = qdd
        self.slack = np.empty(len(law.labels)) if law.measures else NO_SLACK
        self.count: IntArray = np.zeros(1, COUNT)
        outputs = (qdd, acted, self.slack, self.count)
        self.answer = Workspace(Answer(*outputs, NO_SLACK))
        function, workspace, *arguments = law.call(rows, task)
        bound = function.bind(workspace)
        # one partial is faster than two; self.law keeps the workspace alive
        self._function = partial(bound.func, *bound.args, *arguments, *outputs)
        self.solve: Callable[[], int] = self._solve if law.measures else self._function

    def _solve(self) -> int:
        self._code = code = self._function()
        return 0 if code in self.resolver.answers else code

    def command(self, code: int | None = None) -> Command | None:
        """Return the last answer as a command with copied arrays; None if there is no answer.

        ``code`` is the return code of that answer; None stands for the last code recorded by
        ``solve()``.
        """
        law = self.law
        slack = NO_SLACK
        iterations = 0
        if law.measures:
            slack = self.slack.copy()
            iterations = self.count.item()
        code = self._code if code is None else code
        answer = CompiledAnswer(code, self.qdd.copy(), self.acted.copy(), slack, iterations)
        command: Command | None = self.resolver.command(answer, law.labels)
        if command is not None and self._rows.qdd_max is not UNKNOWN:
            keep_box(self._rows, command)
        if law.remark and command is not None:
            command.remark = law.remark
        return command
