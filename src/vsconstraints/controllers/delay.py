"""Laws that compensate the delay of their commands."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..compiled import load
from ..errors import InvalidInput, SceneError
from ..rows import UNKNOWN, Array, BoolArray, Command, Rows, Task
from .base import Controller, Wrapper, require_known, require_model
from .compiled import BoundLaw, Wrapped, arrays_of
from .ranges import positive_number
from .velocity_controller import commands_velocity

MAX_PENDING = 100  #: Largest number of pending commands.
ROUNDING = 1e-9  #: Largest part of a period that counts as rounding of a whole number of periods.


def split_delay(name: str, delay: float, Ts: float) -> tuple[int, float]:
    """Return the whole periods of a delay [s], and its remainder [s].

    Raises InvalidInput if more than MAX_PENDING commands would be pending.
    """
    periods = delay / Ts
    if not periods <= MAX_PENDING:
        raise InvalidInput(
            f"{name} must not exceed {MAX_PENDING} sampling times, {MAX_PENDING * Ts:g} s, not "
            f"{delay} s"
        )
    whole = int(np.floor(periods + ROUNDING))
    has_rest = periods - whole > ROUNDING
    rest = max(delay - whole * Ts, 0.0) if has_rest else 0.0
    return whole, rest


class DelayCompensated(Wrapper):
    """Any law, on rows and task at the time when its command begins to act.

    That is ``command_delay`` [s] from now. The state at that time is predicted from the pending
    commands, each of which moves the joints as double integrators (reduction of an input delay:
    Artstein, IEEE Transactions on Automatic Control, 1982). An arm that takes velocities or
    positions has commanded speeds as soon as they act; one that takes accelerations, which shows in
    bounds of q̈ of the rows, reaches them within a period, as far as the bounds allow. A model
    evaluates rows and task there, starting from the last measurement. Bounds of q̈ are the present
    ones. If the model cannot evaluate that state, with a marker behind the camera, the law gets the
    present rows and task, and ``Command.remark`` reports this. Motion that is unknown to the model
    is predicted by an observer around the inner law, whose ``dead_time`` is then the sum of both
    delays.
    """

    name = "delay-compensated"
    own_uses = ("T_s", "memory", "model")

    def __init__(self, law: Controller, *, command_delay: float) -> None:
        self.law = law
        self.command_delay = command_delay
        self.factors = law.factors
        self.ignores = law.ignores

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "command_delay":
            value = positive_number("command_delay of a law, how late its commands act [s],", value)
        super().__setattr__(name, value)
        if name != "_parts":
            self._parts = None

    def unused(self) -> str:
        """See :class:`.Controller`."""
        return self.law.unused()

    def model_of_law(self) -> Any:
        """Return a model that starts at the state in which the command begins to act."""
        return self.model.ahead()

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class.

        Raises InvalidInput if there is no model or no sampling period, or if the model has other
        rows.
        """
        own = self._arrays(rows, task)
        kernels = load("delay")
        now = self.model.present
        n = task.J.shape[1]
        own.now[0] = now.t
        own.now[1 : 1 + n] = now.q
        own.now[1 + n :] = now.qd
        kernels.foresee(own)
        remark = ""
        try:
            q = own.now[1 : 1 + n].copy()
            qd = own.now[1 + n :].copy()
            then = self.model.at(own.now[0], q, qd)
            ahead = replace(then.rows, qdd_min=rows.qdd_min, qdd_max=rows.qdd_max)
            task = then.task
        except (SceneError, InvalidInput) as error:
            ahead = rows
            remark = f"the state at which the command acts could not be predicted: {error}"
        command = self.law.command(ahead, task)
        sent = command.qdd
        if own.speeds:
            # a failed command leaves the speeds as they are
            sent = command.qd if len(command.qd) else np.full(n, np.nan)
        kernels.send(own, arrays_of(rows), sent)
        command.remark = "; ".join(filter(None, (remark, command.remark)))
        return command

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        replaced = (
            type(self).command is not Controller.command
            or type(self).solve is not DelayCompensated.solve
        )
        if replaced or getattr(self.model, "step", None) is None or self.model.loop is None:
            return None
        then = self.model.step.now
        inner = self.law.bind(then.rows, then.task, acted, qdd)
        if inner is None:
            return None
        own = self._arrays(rows, task, inner.workspace.address)
        # the memory of the inner law refers to the predicted rows
        law = Wrapped(inner.law, own, load("delay").compensate, last_rates=UNKNOWN)
        return BoundLaw(inner.resolver, law, rows, task, acted, qdd)

    def _arrays(self, rows: Rows, task: Task, law: int = 0) -> Any:
        """Return the arrays of pending commands.

        ``law`` is the address of the bound inner law, 0 if there is none.
        """
        who = "a law with a command_delay"
        require_model(who, rows, task, self.model)
        require_known(who, rows, ("period",), self.period)
        assert self.period is not None
        if self._parts is None or law not in (0, self._parts.law):
            delay = split_delay("command_delay of a law", self.command_delay, self.period)
            loop = self.model.loop.packed.workspace.address if law else 0
            step = self.model.step.packed.workspace.address if law else 0
            speeds = commands_velocity(self.law)
            streams = self.model.streams
            if streams is None:
                streams = not len(rows.qdd_max)
            fresh = load("delay").DelayArrays.of(
                task.J.shape[1],
                (law, loop, step),
                self.model.frozen,
                self.period,
                delay,
                speeds=speeds,
                at_once=speeds and streams,
            )
            self._parts = fresh if self._parts is None else fresh._replace(sent=self._parts.sent)
        return self._parts
