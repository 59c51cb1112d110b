"""Base class of controllers that command joint speeds."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Protocol

import numpy as np

from ..errors import InvalidInput, SolverError, format_value
from ..rows import UNKNOWN, Array, BoolArray, Command, Rows, Task
from .base import Controller, innermost, require_known
from .compiled import BoundLaw, CompiledAnswer, in_usual_layout
from .ranges import positive_number


class CompiledForm(Protocol):
    """Compiled form of a velocity law, such as a :class:`.Wrapped` law."""

    labels: tuple[str, ...]
    remark: str

    def __call__(self, rows: Rows, task: Task) -> CompiledAnswer:
        """Compute the answer for these rows and this task."""

    def command(self, answer: CompiledAnswer, labels: tuple[str, ...]) -> Command | None:
        """Return the command of an answer; None if the answer gives none."""


class VelocityController(Controller):
    """Control law that computes joint speeds from rows and a task.

    A new one defines :attr:`name` and :meth:`solve`, like any :class:`.Controller`, and works
    wherever that one does. Rows and task in terms of q̇ are :meth:`.Rows.velocity_form` and
    :meth:`.Task.velocity_form`.

    The command holds q̇ (``qd``) and, for loops that integrate accelerations, q̈ = (q̇ − q̇_last) /
    T_s (``qdd``), in which q̇_last is the law's own last command, ``last``; before the first, the
    present q̇. The sampling period T_s [s] must be told by :meth:`reset`.
    """

    period: float | None = None  #: T_s [s] of the last :meth:`reset` with one; None before.
    #: (n,) last commanded q̇, NaN before the first, in the array that compiled functions write.
    _speeds: Array = UNKNOWN
    _compiled: CompiledForm | None = None
    #: No command depends on u⁺.
    ignores: tuple[str, ...] = ("switching_gain", "speed_gain")

    @property
    def uses(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        return ("q̇",)

    def reset(self, period: float | None = None) -> None:
        """Forget the last command.

        If no sampling period T_s [s] is given, the last one is kept. Raises ConfigurationError if
        it is not positive.
        """
        if period is not None:
            self.period = positive_number("the sampling period", period)
        self._speeds = UNKNOWN
        self._compiled = None

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, value)
        # compiled functions have copied the options
        if name != "_speeds":
            vars(self)["_compiled"] = value if name == "_compiled" else None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_compiled": None, "_speeds": self._speeds.copy()}

    @property
    def last(self) -> Array:
        """(n,) last commanded q̇; (0,) before the first command."""
        return UNKNOWN if np.isnan(self._speeds).any() else self._speeds.copy()

    def speed_before(self, task: Task) -> Array:
        """Return the q̇ (n,) from which the command changes: the last one, or the present q̇."""
        last = self.last
        return last if len(last) == task.J.shape[1] else task.qd

    @abstractmethod
    def solve(self, rows: Rows, task: Task) -> Any:
        """Compute the joint speeds q̇ (n,), or a :class:`.Command` with them as ``qd``.

        Rows and task are finite and have matching shapes; ``task.qd``, ``task.error`` and
        ``task.error_rate`` are given.
        """

    def command(self, rows: Rows, task: Task) -> Command:
        """See :class:`.Controller`."""
        command = self.compute(rows, task)
        return self.define(rows, task) if command is None else command

    def compute(self, rows: Rows, task: Task) -> Command | None:
        """Return the command by compiled functions alone; None if :meth:`define` must be used.

        None is returned for invalid input, for laws without a compiled form, and for a QP solver
        that is requested by name.
        """
        try:
            law = self._compile(rows, task)
            if law is None:
                return None
            command = law.command(law(rows, task), rows.labels)
        # numba may raise anything for other array types or layouts, and for invalid labels
        except Exception:
            usual = in_usual_layout(rows, task)
            return usual and self.compute(*usual)
        if command is not None and law.remark:
            command.remark = law.remark
        return command

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        if type(self).command is not VelocityController.command:
            return None
        law = self._compile(rows, task)
        return None if law is None else BoundLaw(law, law, rows, task, acted, qdd)

    def compiled_form(self, rows: Rows, n: int) -> CompiledForm | None:
        """Create the compiled form for rows like these and n joints; None if there is none."""
        return None

    def _compile(self, rows: Rows, task: Task) -> CompiledForm | None:
        """Return the compiled form for these rows and this task; None if there is none.

        There is none without a sampling period, or if the last command had another number of
        joints. Before the first command, the array in which the commanded q̇ are kept is allocated.
        The form is created anew if the last one does not fit these rows.
        """
        law = self._compiled
        if law is not None and law.labels is rows.labels:
            return law
        n = task.J.shape[1]
        if not len(self._speeds):
            self._speeds = np.full(n, np.nan)
        if self.period is None or len(self._speeds) != n:
            return None
        if law is None or law.labels != rows.labels:
            law = self.compiled_form(rows, n)
        if law is not None:
            law.labels = rows.labels
        self._compiled = law
        return law

    def _solved(self, rows: Rows, task: Task) -> Command:
        """See :class:`.Controller`.

        Raises InvalidInput if the task lacks q̇, e or ė, or if the sampling period is unknown, and
        SolverError if the law's q̇ is not n finite numbers.
        """
        self._require_known(task)
        n = task.J.shape[1]
        given: Any = self.solve(rows, task)
        if isinstance(given, Command) and given.status == "failed":
            return given
        qd = given.qd if isinstance(given, Command) else given
        is_float_array = isinstance(qd, np.ndarray) and qd.dtype.kind == "f"
        is_float_vector = is_float_array and qd.shape == (n,)
        if not is_float_vector or not np.isfinite(qd).all():
            raise SolverError(f"the law gave {format_value(qd)}, not {n} finite joint speeds")
        assert self.period is not None
        qdd = (qd - self.speed_before(task)) / self.period
        self._remember(qd)
        if isinstance(given, Command):
            given.qdd = qdd
            return given
        acted = np.zeros(len(rows.labels), np.bool_)
        return Command(qdd, "ok", acted, rows.labels, qd=qd)

    def _remember(self, qd: Array) -> None:
        """Store the commanded q̇ (n,)."""
        if len(self._speeds) == len(qd):
            self._speeds[:] = qd
        else:
            self._speeds = qd.copy()
            self._compiled = None

    def _require_known(self, task: Task) -> None:
        k, n = task.J.shape
        sizes = {"qd": n, "error": k, "error_rate": k}
        lacking = [f"task.{name}" for name in sizes if len(getattr(task, name)) != sizes[name]]
        if lacking:
            raise InvalidInput(
                f"{self.name} commands joint speeds and uses {', '.join(lacking)}, which this task "
                f"does not give"
            )
        require_known(self.name, Rows.none(n), ("period",), self.period)

    def require_sigma(self, rows: Rows) -> None:
        """Raise InvalidInput unless the rows give σ and K."""
        require_known(self.name, rows, ("sigma", "K"), self.period)


def commands_velocity(law: Controller) -> bool:
    """True if a law, or the one inside its wrappers, commands joint speeds."""
    return isinstance(innermost(law), VelocityController)
