"""What every controller is: a function of rows and task, whose answer is always finite."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np

from ..errors import InvalidInput, SolverError, shown
from ..rows import OPTIONAL, Array, BoolArray, Command, Rows, Status, Task, keep_box
from ..rows.checks import beyond_rounding, check
from ..rows.factors import AS_THEY_ARE, RowFactors
from ..rows.readable import in_one_line
from .ranges import Part, positive, positive_number

if TYPE_CHECKING:
    from .compiled import BoundLaw


class Controller(Part, ABC):
    """A law that turns rows and a task into joint accelerations.

    A new controller gives :attr:`name` and :meth:`solve`. Input is checked before and the answer
    after: no number that is not finite ever reaches a robot, nor one so large that rounding alone
    of a row exceeds its switching gain. What is outside the box of the rows is brought into it
    joint by joint.
    """

    name: ClassVar[str]  #: In files and reports.
    #: On K and u⁺ of the rows that simulations and arms give this law, see :class:`.RowFactors`;
    #: options of every law.
    factors: RowFactors = AS_THEY_ARE

    def command(self, rows: Rows, task: Task) -> Command:
        """Joint accelerations for these rows and this task.

        InvalidInput if shapes disagree or a number is not finite. What goes wrong inside the law
        itself does not raise: the command's status is then ``failed``, with the reason, and its
        accelerations are zero.
        """
        return self.define(rows, task)

    def define(self, rows: Rows, task: Task) -> Command:
        """The command of :meth:`solve`, with input and answer checked."""
        check(rows, task)
        try:
            # numbers that leave the range of floating point are found below
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                command: Any = self.solve(rows, task)  # own laws are not type-checked
            fault = fault_of(command, rows, task)
        except (np.linalg.LinAlgError, SolverError) as error:
            fault = f"{type(error).__name__}: {error}"
        if fault:
            none = np.zeros(len(rows.labels), dtype=np.bool_)
            return Command(np.zeros(task.J.shape[1]), "failed", none, rows.labels, reason=fault)
        keep_box(rows, command)
        return command  # type: ignore[no-any-return]

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
        """Compute the command; rows and task are known to be finite and of matching shapes."""

    def reset(self, period: float | None = None) -> None:
        """Forget everything kept between calls; ``period`` is the sampling period T_s [s] of those
        to come, if known.

        A law whose :attr:`uses` have ``"model"`` takes ``model`` too: a
        :class:`~vsconstraints.control.Model`, which gives rows and task at predicted states.
        Control steps and simulations pass it; no other law has one made.
        """

    @property
    def uses(self) -> tuple[str, ...]:
        """What the law uses beside φ, L_gφ, u⁺ and the scale of rows and the task's J and b, as
        printed in reports.
        """
        return ()

    @property
    def kernels(self) -> tuple[str, ...]:
        """Modules of :mod:`vsconstraints.compiled` that take long to compile, as far as this law
        needs them.
        """
        return ()

    def unused(self) -> str:
        """Which options are given though this law :attr:`ignores` them, in a sentence; else
        empty.
        """
        observer = [key for key in ("observer", "dead_time") if positive(getattr(self, key, None))]
        given = [*self.factors.options(), *observer]
        used = [key for key in given if key not in self.ignores]
        # what shifts σ is observed
        names = [
            key
            for key in given
            if key not in used and not (key == "observer" and "dead_time" in used)
        ]
        return (
            f"no command of the law depends on {' or '.join(names)}, which it is given"
            if names
            else ""
        )

    def remark(self, labels: tuple[str, ...]) -> str:
        """What a user should know of these options and rows of these labels, though nothing is
        wrong; else empty.
        """
        return ""

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """The compiled law on arrays that stay where they are: for loops that fill them anew in
        every sample.

        It writes ``acted`` (m,) and ``qdd`` (n,). None for a law that is not compiled as a whole,
        and for a controller whose ``command`` was replaced.
        """
        return None


class Wrapper(Controller):
    """A law that asks another one, :attr:`law`, with other rows or another task; it has its factors
    and remarks.
    """

    law: Controller
    period: float | None = None
    model: Any = None
    own_uses: ClassVar[tuple[str, ...]]  #: What it uses beside what that law does.
    _parts: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_parts": None}

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Forget everything, and let the law forget; without a period or a model, those of the last
        reset stay.
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
        """The model that the law is given, if it uses one."""
        return self.model

    @property
    def uses(self) -> tuple[str, ...]:
        """What the law uses, and what is used beside it."""
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
    """The law that wrappers are around; the law itself where there is none."""
    while isinstance(law, Wrapper):
        law = law.law
    return law


def fault_of(command: object, rows: Rows, task: Task) -> str:
    """What is wrong with a law's answer to these rows and this task; empty if nothing is."""
    n = task.J.shape[1]
    m = len(rows.labels)
    if not isinstance(command, Command):
        return f"the law gave {shown(command)}, not a Command"
    for name, array, kind in (
        ("qdd", command.qdd, np.floating),
        ("acted", command.acted, np.bool_),
    ):
        if not (isinstance(array, np.ndarray) and np.issubdtype(array.dtype, kind)):
            return f"{name} must be an array of {kind.__name__}, not {shown(array)}"
    if not (isinstance(command.status, str) and command.status in get_args(Status)):
        return (
            f"the law gave the status {shown(command.status)}, which is none of "
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
        return f"slack must be None or {m} finite numbers, not {shown(slack)}"
    return beyond_rounding(rows, command.qdd)


def demand_known(
    who: str,
    rows: Rows,
    uses: Collection[str],
    period: float | None,
    remembered: tuple[str, ...] = (),
) -> None:
    """Raise InvalidInput where what it ``uses`` of rows or the sampling period is unknown, or other
    rows remembered.
    """
    lacking = [
        f"rows.{name}"
        for name in OPTIONAL
        if name in uses and len(getattr(rows, name)) != len(rows.labels)
    ]
    if lacking:
        raise InvalidInput(f"{who} uses {', '.join(lacking)}, which these rows do not give")
    if "period" in uses and period is None:
        raise InvalidInput(
            f"{who} uses the sampling period: tell it by reset(period=...) before the first command"
        )
    if remembered and remembered != rows.labels:
        raise InvalidInput(
            f"{who} remembers other rows, {shown(remembered)}: reset() the law before it is given "
            f"those of another "
            f"scene, {shown(rows.labels)}"
        )


def demand_model(who: str, rows: Rows, task: Task, model: Any) -> None:
    """Raise InvalidInput where there is no model, or it is of other rows or of another robot."""
    if model is None:
        raise InvalidInput(
            f"{who} uses a model: ask it by ControlStep.command, or tell it by "
            f"reset(model=step.model()) of the "
            "control step that makes these rows"
        )
    if rows.labels != model.labels or task.J.shape[1] != len(model.present.q):
        raise InvalidInput(f"{who} has the model of other rows or of another robot")


def restart(controller: Controller, period: float, model: Callable[[], Any] | None = None) -> None:
    """Reset a controller, with the sampling period [s] and a model if it takes them; users' laws
    may take less.
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
