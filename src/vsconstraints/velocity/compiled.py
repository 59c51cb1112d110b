"""Compiled form of laws that command joint speeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compiled import load
from ..compiled.memory import zeros
from ..compiled.workspace import Scratch
from ..controllers.compiled import (
    BOOL,
    COUNT,
    EMPTY,
    NO_SLACK,
    SCRATCH,
    CompiledAnswer,
    CompiledLaw,
    Wrapped,
)
from ..controllers.demand import Demand
from ..controllers.resolver import Resolver
from ..rows import Array, Command, Rows, Task, at_end

#: Module of the compiled functions of these laws.
KERNELS = "vsconstraints.velocity.kernels.speed_laws"


def reason_of(answer: Command, unit: str) -> str:
    """Return the reason of a program's answer in terms of speeds, with the unit of violations."""
    if answer.status != "relaxed":
        return answer.reason
    amounts = ", ".join(f"{label} by {slack:.3g}" for label, slack in answer.slacks.items())
    return f"no joint speed meets every row; exceeded, in {unit}: {amounts}"


class CompiledSpeeds(Wrapped):
    """Compiled law of joint speeds: a function of ``kernels/speed_laws.py``.

    It is called with the ``program``, a demand and a resolver, and ``options``, fields of
    ``SpeedArrays``; those that are left out have no effect.
    Every call writes ``speeds`` (n,), the last commanded q̇. ``unit_of_excess`` is that of violated
    rows in reasons.
    """

    def __init__(
        self,
        kernel: str,
        program: tuple[Demand, Resolver],
        labels: tuple[str, ...],
        speeds: Array,
        options: dict[str, Any],
        unit_of_excess: str,
    ) -> None:
        self.resolver = program[1]
        self.unit_of_excess = unit_of_excess
        self.speeds = speeds
        solves = CompiledLaw(*program, labels)
        self.complete = solves.complete
        room = np.empty(SCRATCH // 8 * (1 + len(labels) // 32))
        known = {
            "program": solves.workspace.address,
            "scratch": Scratch(room, np.zeros(1, COUNT)),
            **options,
        }
        speed_laws = load(KERNELS)
        # every call sets the arrays of rows and task
        lengths = {"k": 0, "m": 0, "n": 0, "limits": 0, "rest": 0}
        own = zeros(speed_laws.SpeedArrays, lengths, known)
        super().__init__(solves, own, getattr(speed_laws, kernel), speeds=speeds)
        self._follow = load("laws").follow_whole.bind(self.workspace, typed=True)

    @property
    def answers(self) -> Any:
        """Return codes with which there is an answer."""
        return self.resolver.answers

    def __call__(self, rows: Rows, task: Task) -> CompiledAnswer:
        """Compute the answer for these rows and this task."""
        m = len(rows.labels)
        qdd = EMPTY(task.J.shape[1])
        acted = EMPTY(m, BOOL)
        slack = EMPTY(m) if self.measures else NO_SLACK
        count = np.zeros(1, COUNT)
        _, _, *arguments = self.call(rows, task)
        code = self._follow(*arguments, qdd, acted, slack, count)
        return CompiledAnswer(code, qdd, acted, slack, count.item())

    def command(self, answer: CompiledAnswer, labels: tuple[str, ...]) -> Command | None:
        """Return the command for the output of the compiled form; None if it has no answer."""
        command = self.resolver.command(answer, labels)
        if command is not None:
            command.qd = self.speeds.copy()
            command.reason = reason_of(command, self.unit_of_excess)
            if len(self.own.least):
                command.saturated = at_end(command.qd, self.own.least, self.own.greatest)
        return command
