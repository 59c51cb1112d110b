"""Step time of every controller on every scenario, along its own run."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter_ns

import numpy as np

from vsconstraints.control_step import ControlStep
from vsconstraints.controllers import Controller
from vsconstraints.rows import Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate

from .part import CASE_STUDY, Effort, Part, Table, controllers, digits, median_p99_max, microseconds, ratios
from .timing import BLOCK, UNIT, Array, Times, in_turn

TEXT = f"""
State in, command out: `ControlStep.evaluate` (rows: kinematics, features, rows and task) and `controller.command`,
called along the controller's own run of the scenario, {BLOCK} samples in a row at places evenly spread over it, so that
rows act where they act in the run. Times are median / p99 / max in µs; *ratio* is the total's median / p99 / max in
units, measured in the same turn; *first* is the first step in µs, with the making of the `ControlStep`, in a process
that has its code loaded.
"""


class Walk:
    """Times steps of a controller along a run of it: rows, command and total of each sample."""

    def __init__(self, setup: Setup, controller: Controller, run: Trajectory, turns: int) -> None:
        self.command: Callable[[Rows, Task], Command] = controller.command
        self.states = [(float(t), q.copy(), qd.copy()) for t, q, qd in zip(run.t, run.q, run.qd, strict=True)]
        last = max(len(self.states) - BLOCK, 1)
        self.starts = np.linspace(min(1, last), last, turns).astype(int)
        controller.reset()
        setup.task.reset()
        started = perf_counter_ns()
        self.control = ControlStep(setup.scene, setup.constraints, setup.task)
        self._step(self.states[0])
        self.first = 1e-9 * (perf_counter_ns() - started)

    @property
    def form(self) -> str:
        """Whether rows and task are computed by the compiled step."""
        if self.control.not_compiled:
            return f"NumPy: {self.control.not_compiled}"
        packed = self.control._packed
        others = sorted({constraint.kind for constraint, _, _ in packed.others}) if packed else []
        return f"compiled, but {', '.join(others)}" if others else "compiled"

    def __call__(self, turn: int) -> Array:
        """(calls, 3) times of rows, command and total [ns]."""
        start = int(self.starts[turn])
        self.control.reset()
        # what the task remembers from the sample before
        self.control.evaluate(*self.states[start - 1])
        times = np.empty((BLOCK, 3))
        for i in range(BLOCK):
            times[i] = self._step(self.states[min(start + i, len(self.states) - 1)])
        return times

    def _step(self, state: tuple[float, Array, Array]) -> tuple[int, int, int]:
        t, q, qd = state
        clock, evaluate, command = perf_counter_ns, self.control.evaluate, self.command
        started = clock()
        step = evaluate(t, q, qd)
        ready = clock()
        command(step.rows, step.task)
        done = clock()
        return ready - started, done - ready, done - started


def measure(effort: Effort) -> Part:
    """See the module."""
    part = Part("Step time of every controller on every scenario", TEXT, figure="steps.png")
    lines = []
    for name in effort.scenarios:
        scenario = shortened(Scenario.load(name), effort)
        walks = {}
        for law, controller in controllers().items():
            # a task remembers its last sample: each walk has its own
            setup = scenario.setup()
            walks[law] = Walk(setup, controller, simulate(setup, controller), effort.turns)
        times = in_turn(walks, effort.turns)
        unit = float(np.median(times[UNIT]))
        for law, walk in walks.items():
            rows, command, total = (Times(column, unit) for column in times[law].T)
            part.keep(f"{name}, {law}", total)
            lines.append(
                [
                    name,
                    law,
                    walk.form,
                    str(len(setup.constraints.labels)),
                    median_p99_max(rows),
                    median_p99_max(command),
                    median_p99_max(total),
                    ratios(total),
                    digits(total.spread),
                    microseconds(walk.first),
                ]
            )
        if name == CASE_STUDY:
            of_unit = Times(times[UNIT], unit)
            part.keep("unit", of_unit)
    header = ["scenario", "controller", "rows are", "m", "rows", "command", "total", "ratio", "p99/median", "first"]
    part.tables.append(Table(header, lines, text_columns=3))
    return part


def shortened(scenario: Scenario, effort: Effort) -> Scenario:
    """The scenario with no longer a duration than wanted."""
    duration = min(float(scenario.tables["duration"]), effort.duration)
    return scenario.with_override("duration", duration)
