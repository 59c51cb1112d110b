"""Step time of every controller on every scenario, along its own run."""

from __future__ import annotations

from time import perf_counter_ns

import numpy as np

from vsconstraints.control_step import ControlStep
from vsconstraints.controllers import Controller
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate

from .part import CASE_STUDY, Effort, Part, Table, controllers, digits, median_p99_max, microseconds, ratios
from .timing import BLOCK, UNIT, Array, Times, in_turn

TEXT = f"""
State in, command out, along the controller's own run of the scenario, {BLOCK} samples in a row at places evenly spread
over it, so that rows act where they act in the run. *rows* is `ControlStep.evaluate` (kinematics, features, rows and
task), *command* is `controller.command` of these, *total* is the function of `ControlStep.bind`, which does both in
one, for the same samples right afterwards. Times are median / p99 / max in µs; *ratio* is the total's median / p99 /
max in units, measured in the same turn; *first* is the first total in µs, with the making of the `ControlStep`, in a
process that has its code loaded. Of long runs, the first 60 s.
"""


class Walk:
    """Times steps of a controller along a run of it: rows, command and total of each sample."""

    def __init__(self, setup: Setup, controller: Controller, run: Trajectory, turns: int) -> None:
        self.controller = controller
        self.states = [(float(t), q.copy(), qd.copy()) for t, q, qd in zip(run.t, run.q, run.qd, strict=True)]
        last = max(len(self.states) - BLOCK, 1)
        self.starts = np.linspace(min(1, last), last, turns).astype(int)
        controller.reset()
        setup.task.reset()
        started = perf_counter_ns()
        self.control = ControlStep(setup.scene, setup.constraints, setup.task)
        self.to_command = self.control.bind(controller)
        self.in_one(*self.states[0])
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
        times = np.empty((BLOCK, 3))
        for i, state in enumerate(self._states_of(turn)):
            times[i, :2] = self.in_two(*state)
        for i, state in enumerate(self._states_of(turn)):
            times[i, 2] = self.in_one(*state)
        return times

    def _states_of(self, turn: int) -> list[tuple[float, Array, Array]]:
        """Those of a turn; the task remembers the one before."""
        start = int(self.starts[turn])
        self.control.reset()
        self.control.evaluate(*self.states[start - 1])
        last = len(self.states) - 1
        return [self.states[min(i, last)] for i in range(start, start + BLOCK)]

    def in_two(self, t: float, q: Array, qd: Array) -> tuple[int, int]:
        """Times of rows and command [ns]."""
        clock, evaluate, command = perf_counter_ns, self.control.evaluate, self.controller.command
        started = clock()
        step = evaluate(t, q, qd)
        ready = clock()
        command(step.rows, step.task)
        return ready - started, clock() - ready

    def in_one(self, t: float, q: Array, qd: Array) -> int:
        """Time of both [ns]."""
        clock, to_command = perf_counter_ns, self.to_command
        started = clock()
        to_command(t, q, qd)
        return clock() - started


def measure(effort: Effort) -> Part:
    """See the module."""
    part = Part("Step time of every controller on every scenario", TEXT, figure="steps.png")
    lines = []
    for name in effort.scenarios:
        scenario = shortened(Scenario.load(name), effort.duration)
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


def shortened(scenario: Scenario, duration: float) -> Scenario:
    """The scenario with no longer a duration [s] than wanted."""
    return scenario.with_override("duration", min(float(scenario.tables["duration"]), duration))
