"""Base class of controllers: functions of rows and a task with an always finite answer."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np

from ..errors import InvalidInput, SolverError, format_value
from ..rows import OPTIONAL, Array, BoolArray, Command, Rows, Status, Task, keep_box
from ..rows.checks import beyond_rounding, check
from ..rows.factors import AS_THEY_ARE, RowFactors
from ..rows.readable import in_one_line
from .ranges import Part, positive, positive_number

if TYPE_CHECKING:
    from .compiled import BoundLaw


class Controller(Part, ABC):
    """Control law that computes joint accelerations from rows and a task.

    A new controller defines :attr:`name` and :meth:`solve`. The input is checked before and the
    answer after: a robot never receives a number that is not finite, nor one so large that the
    rounding of a row exceeds its switching gain. A command outside the box of the rows is clipped
    to it joint by joint.
    """

    name: ClassVar[str]  #: Name in files and reports.
    #: Factors on K and u⁺ of the rows that this law gets in simulations and on arms, see
    #: :class:`.RowFactors`; options of every law.
    factors: RowFactors = AS_THEY_ARE

    def command(self, rows: Rows, task: Task) -> Command:
        """Compute joint accelerations for these rows and this task.

        Raises InvalidInput if shapes disagree or a number is not finite. A failure inside the law
        does not raise: the status of the command is then ``failed``, with the reason, and its
        accelerations are zero.
        """
        return self.define(rows, task)

    def define(self, rows: Rows, task: Task) -> Command:
        """Return the command of :meth:`solve`, with input and answer checked."""
        check(rows, task)
        try:
            # numbers beyond the range of floating point are detected below
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                command: Any = self._solved(rows, task)  # custom laws are not type-checked
            fault = fault_of(command, rows, task)
        except (np.linalg.LinAlgError, SolverError) as error:
            fault = f"{type(error).__name__}: {error}"
        if fault:
            none = np.zeros(len(rows.labels), dtype=np.bool_)
            return Command(np.zeros(task.J.shape[1]), "failed", none, rows.labels, reason=fault)
        keep_box(rows, command)
        return command  # type: ignore[no-any-return]

    def _solved(self, rows: Rows, task: Task) -> Command:
        """Return what :meth:`solve` computes, as a command of accelerations."""
        return self.solve(rows, task)

    @in_one_line
    def __repr__(self) -> str:
        parameters = inspect.signature(type(self)).parameters.values()
        names = [
            parameter.name
            for parameter in parameters
            if parameter.kind is not parameter.VAR_KEYWORD
        ]
        given = [f"{name}={getattr(self, name)!r}" for name in names if hasattr(self, name)]
        return f"{type(self).__name__}({', '.join(given)})"

    @abstractmethod
    def solve(self, rows: Rows, task: Task) -> Command:
        """Compute the command; rows and task are finite and have matching shapes."""

    def reset(self, period: float | None = None) -> None:
        """Clear everything that is kept between calls.

        ``period`` is the sampling period T_s [s] of the next calls, if known. A law with
        ``"model"`` in :attr:`uses` also takes ``model``, a :class:`~vsconstraints.control.Model`,
        which gives rows and task at predicted states. Control steps and simulations pass it; they
        make no model for other laws.
        """

    @property
    def uses(self) -> tuple[str, ...]:
        """Required information beyond φ, L_gφ, u⁺ and scale of the rows and J and b of the task.

        The names are those printed in reports.
        """
        return ()

    @property
    def kernels(self) -> tuple[str, ...]:
        """Modules that this law needs and that compile slowly.

        See :func:`vsconstraints.compiled.load`.
        """
        return ()

    def unused(self) -> str:
        """Report the given options that this law :attr:`ignores`; empty if there is none."""
        observer = [key for key in ("observer", "dead_time") if positive(getattr(self, key, None))]
        given = [*self.factors.options(), *observer]
        used = [key for key in given if key not in self.ignores]
        # with a dead time in use, the observer is used too
        names = [
            key
            for key in given
            if key not in used and not (key == "observer" and "dead_time" in used)
        ]
        return (
            f"{' or '.join(names)} is given, but no command of the law depends on it"
            if names
            else ""
        )

    def remark(self, labels: tuple[str, ...]) -> str:
        """Return a remark on the options and these row labels; empty if there is none.

        Remarks tell the user about input that is usable but suspicious.
        """
        return ""

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """Return the compiled law on fixed arrays, for loops that refill them in every sample.

        It writes ``acted`` (m,) and ``qdd`` (n,). None for a law that is not compiled as a whole,
        and for a controller whose ``command`` was replaced.
        """
        return None


class Wrapper(Controller):
    """Law that calls another one, :attr:`law`, with other rows or another task.

    It has the factors and the remarks of that law.
    """

    law: Controller
    period: float | None = None
    model: Any = None
    own_uses: ClassVar[tuple[str, ...]]  #: Required information of the wrapper alone.
    _parts: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_parts": None}

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Clear everything, and reset the law.

        If no period or no model is given, the last one is kept.
        """
        if period is not None:
            self.period = positive_number("the sampling period", period)
        self.model = self.model if model is None else model
        self._parts = None
        if self.period is None:
            self.law.reset()
        else:
            restart(self.law, self.period, None if self.model is None else self.model_of_law)

    def model_of_law(self) -> Any:
        """Return the model for the inner law, if that uses one."""
        return self.model

    @property
    def uses(self) -> tuple[str, ...]:
        """Required information of the law and of the wrapper."""
        used = dict.fromkeys((*self.law.uses, *self.own_uses))
        return tuple(sorted(used, key=lambda name: (name == "model", name == "memory")))

    @property
    def kernels(self) -> tuple[str, ...]:
        """See :class:`Controller`."""
        return self.law.kernels

    def remark(self, labels: tuple[str, ...]) -> str:
        """See :class:`Controller`."""
        return self.law.remark(labels)


def innermost(law: Controller) -> Controller:
    """Return the law inside all wrappers; the law itself if it is no wrapper."""
    while isinstance(law, Wrapper):
        law = law.law
    return law


def fault_of(command: object, rows: Rows, task: Task) -> str:
    """Describe the fault in a law's answer to these rows and this task; empty if there is none."""
    n = task.J.shape[1]
    m = len(rows.labels)
    if not isinstance(command, Command):
        return f"the law gave {format_value(command)}, not a Command"
    for name, array, kind in (
        ("qdd", command.qdd, np.floating),
        ("acted", command.acted, np.bool_),
    ):
        if not (isinstance(array, np.ndarray) and np.issubdtype(array.dtype, kind)):
            return f"{name} must be an array of {kind.__name__}, not {format_value(array)}"
    if not (isinstance(command.status, str) and command.status in get_args(Status)):
        return (
            f"the law gave the status {format_value(command.status)}, which must be one of "
            f"{', '.join(get_args(Status))}"
        )
    if command.qdd.shape != (n,) or command.acted.shape != (m,):
        shapes = f"{command.qdd.shape} and {command.acted.shape}"
        return f"the law gave qdd and acted of the shapes {shapes}, not {(n,)} and {(m,)}"
    if not np.isfinite(command.qdd).all():
        return "the law gave accelerations that are not finite"
    slack: object = command.slack
    if not (
        slack is None
        or (isinstance(slack, np.ndarray) and slack.shape == (m,) and np.isfinite(slack).all())
    ):
        return f"slack must be None or {m} finite numbers, not {format_value(slack)}"
    return beyond_rounding(rows, command.qdd)


def require_known(
    who: str,
    rows: Rows,
    uses: Collection[str],
    period: float | None,
    remembered: tuple[str, ...] = (),
) -> None:
    """Raise InvalidInput if a used field of the rows or the sampling period is unknown.

    Raises it also if ``remembered``, the labels of the rows in memory, differ from those of these
    rows. ``who`` names the law in the message.
    """
    lacking = [
        f"rows.{name}"
        for name in OPTIONAL
        if name in uses and len(getattr(rows, name)) != len(rows.labels)
    ]
    if lacking:
        raise InvalidInput(f"{who} uses {', '.join(lacking)}, which these rows do not have")
    if "period" in uses and period is None:
        raise InvalidInput(
            f"{who} uses the sampling period: call reset(period=...) before the first command"
        )
    if remembered and remembered != rows.labels:
        raise InvalidInput(
            f"{who} keeps the state of other rows, {format_value(remembered)}: call reset() "
            f"before the first command for rows of another scene, {format_value(rows.labels)}"
        )


def require_model(who: str, rows: Rows, task: Task, model: Any) -> None:
    """Raise InvalidInput if there is no model, or it has other rows or another robot."""
    if model is None:
        raise InvalidInput(
            f"{who} uses a model: call it through ControlStep.command, or call "
            "reset(model=step.model()) of the control step that makes these rows"
        )
    if rows.labels != model.labels or task.J.shape[1] != len(model.present.q):
        raise InvalidInput(f"{who} has the model of other rows or of another robot")


def restart(controller: Controller, period: float, model: Callable[[], Any] | None = None) -> None:
    """Reset a controller with the sampling period [s] and a model, as far as it takes them.

    The ``reset`` of a custom law may take fewer arguments.
    """
    parameters = inspect.signature(controller.reset).parameters.values()
    given: dict[str, Any] = {}
    if any(
        parameter.name == "period" or parameter.kind is parameter.VAR_KEYWORD
        for parameter in parameters
    ):
        given["period"] = period
    if model is not None and "model" in controller.uses:
        given["model"] = model()
    controller.reset(**given)
