"""Step time of every controller on every scenario, along its own run."""

from __future__ import annotations

from time import perf_counter_ns

import numpy as np

from vsconstraints.control_step import ControlStep
from vsconstraints.controllers import Controller
from vsconstraints.controllers.base import restart
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate

from .part import CASE_STUDY, Effort, Part, Table, controllers, digits, median_p99_max, microseconds, ratios
from .timing import UNIT, Subject, Times, in_turn

TEXT = """
State in, command out, along the controller's own run of the scenario, at samples evenly spread over it, so that rows
act where they act in the run. *rows* is `ControlStep.evaluate` (kinematics, features, rows and task), *command* is
`controller.command` of these, with the making of `Rows` and `Task`, *total* is the function of `ControlStep.bind`,
which does both compiled in one, in a turn of its own. Times are median / p99 / max in µs; *ratio* is the total's median
/ p99 / max in units, measured in turn with it; *first* is the first total in µs, with the making of the `ControlStep`,
in a process that has its code loaded. Of long runs, the first 60 s.
"""


class Walk:
    """Times steps of a controller along a run of it, one at each turn; :meth:`in_one` or :meth:`in_two`."""

    def __init__(self, setup: Setup, controller: Controller, run: Trajectory, turns: int) -> None:
        self.controller = controller
        self.states = [(float(t), q.copy(), qd.copy()) for t, q, qd in zip(run.t, run.q, run.qd, strict=True)]
        self.places = np.linspace(0, len(self.states) - 1, turns).astype(int)
        restart(controller, setup.Ts)
        setup.task.reset()
        started = perf_counter_ns()
        self.control = ControlStep(setup.scene, setup.constraints, setup.task)
        self.to_command = self.control.bind(controller)
        self.to_command(*self.states[0])
        self.first = 1e-9 * (perf_counter_ns() - started)

    @property
    def form(self) -> str:
        """Whether rows and task are computed by the compiled step."""
        if self.control.not_compiled:
            return f"NumPy: {self.control.not_compiled}"
        others = sorted({constraint.kind for constraint in self.control.in_numpy})
        return f"compiled, but {', '.join(others)}" if others else "compiled"

    def in_two(self, turn: int) -> tuple[float, float]:
        """Times of rows and command [ns]."""
        clock, evaluate, command = perf_counter_ns, self.control.evaluate, self.controller.command
        t, q, qd = self.states[self.places[turn]]
        started = clock()
        step = evaluate(t, q, qd)
        ready = clock()
        command(step.rows, step.task)
        return ready - started, clock() - ready

    def in_one(self, turn: int) -> float:
        """Time of both [ns]."""
        clock, to_command = perf_counter_ns, self.to_command
        t, q, qd = self.states[self.places[turn]]
        started = clock()
        to_command(t, q, qd)
        return clock() - started


def measure(effort: Effort) -> Part:
    """See the module."""
    part = Part("Step time of every controller on every scenario", TEXT, figure="steps.png")
    lines = []
    for name in effort.scenarios:
        scenario = shortened(Scenario.load(name), effort.duration)
        walks, halves, others = {}, {}, controllers()
        for law, controller in controllers().items():
            # a task remembers its last sample: each walk has its own
            setup = scenario.setup()
            run = simulate(setup, controller)
            walks[law] = Walk(setup, controller, run, effort.turns)
            halves[f"{law}, in two"] = Walk(scenario.setup(), others[law], run, effort.turns)
        subjects: dict[str, Subject] = {name: walk.in_one for name, walk in walks.items()}
        times = in_turn({**subjects, **{name: walk.in_two for name, walk in halves.items()}}, effort.turns)
        unit = float(np.median(times[UNIT]))
        for law, walk in walks.items():
            total = Times(times[law], unit)
            rows, command = (Times(column, unit) for column in times[f"{law}, in two"].T)
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
