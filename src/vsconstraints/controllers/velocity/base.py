"""Base class of controllers that command joint speeds."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np

from ...errors import InvalidInput, SolverError, format_value
from ...rows import UNKNOWN, Array, Command, Rows, Task
from ..base import Controller, innermost, require_known
from ..ranges import positive_number


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
    last: Array = UNKNOWN  #: (n,) last commanded q̇; (0,) before the first command.
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
        self.last = UNKNOWN

    @abstractmethod
    def solve(self, rows: Rows, task: Task) -> Any:
        """Compute the joint speeds q̇ (n,), or a :class:`.Command` with them as ``qd``.

        Rows and task are finite and have matching shapes; ``task.qd``, ``task.error`` and
        ``task.error_rate`` are given.
        """

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
        floats = isinstance(qd, np.ndarray) and qd.dtype.kind == "f"
        if not (floats and qd.shape == (n,) and np.isfinite(qd).all()):
            raise SolverError(f"the law gave {format_value(qd)}, not {n} finite joint speeds")
        before = self.last if len(self.last) == n else task.qd
        assert self.period is not None
        qdd = (qd - before) / self.period
        self.last = qd.copy()
        if isinstance(given, Command):
            given.qdd = qdd
            return given
        return Command(qdd, "ok", np.zeros(len(rows.labels), np.bool_), rows.labels, qd=qd)

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
