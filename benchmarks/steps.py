"""Step time of every controller on every scenario, along its own run."""

from __future__ import annotations

from time import perf_counter_ns

import numpy as np

from vsconstraints.control import ControlStep
from vsconstraints.controllers import Controller
from vsconstraints.controllers.base import restart
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate

from .part import (
    CASE_STUDY,
    LONG_PLANS,
    Effort,
    Part,
    Table,
    controllers,
    digits,
    median_p99_max,
    microseconds,
    ratios,
)
from .timing import UNIT, Subject, Times, in_turn

TEXT = """
State in, command out, along the controller's own run of the scenario, at samples evenly spread \
over it, so that rows
act where they act in the run; of laws that look ahead at consecutive ones, since they carry on \
their last plan. *rows*
is `ControlStep.evaluate` (kinematics, features, rows and task), *command* is `controller.command` \
of these, with the
making of `Rows` and `Task`, *total* is the function of `ControlStep.bind`, which does both \
compiled in one, in a turn
of its own. Times are median / p99 / max in µs; *ratio* is the total's median / p99 / max in \
units, measured in turn
with it; *first* is the first total in µs, with the making of the `ControlStep`, in a process that \
has its code loaded.
Of long runs, the first 60 s. Laws that look ahead take their turns among themselves and with the \
unit: they compute for
so long that the others would find the caches emptied.
"""


class Walk:
    """Times steps of a controller along a run, one per turn: :meth:`in_one` or :meth:`in_two`."""

    def __init__(self, setup: Setup, controller: Controller, run: Trajectory, turns: int) -> None:
        self.controller = controller
        self.states = [
            (float(t), q.copy(), qd.copy()) for t, q, qd in zip(run.t, run.q, run.qd, strict=True)
        ]
        last = len(self.states) - 1
        # a law that reuses its last plan would find the plan of another place
        consecutive = "model" in controller.uses
        self.places = (
            np.minimum(np.arange(turns), last)
            if consecutive
            else np.linspace(0, last, turns).astype(int)
        )
        restart(controller, setup.Ts)
        started = perf_counter_ns()
        self.control = ControlStep(setup.scene, setup.constraints, setup.task)
        self.to_command = self.control.bind(controller)
        self.to_command(*self.states[0])
        self.first = 1e-9 * (perf_counter_ns() - started)

    @property
    def form(self) -> str:
        """Description of the compiled part of rows and task."""
        others = sorted({constraint.kind for constraint in self.control.in_numpy})
        return f"compiled, but {', '.join(others)}" if others else "compiled"

    def in_two(self, turn: int) -> tuple[float, float]:
        """Return the times of rows and of command [ns]."""
        clock = perf_counter_ns
        evaluate = self.control.evaluate
        command = self.controller.command
        t, q, qd = self.states[self.places[turn]]
        started = clock()
        step = evaluate(t, q, qd)
        ready = clock()
        command(step.rows, step.task)
        return ready - started, clock() - ready

    def in_one(self, turn: int) -> float:
        """Return the time from state to command [ns]."""
        clock = perf_counter_ns
        to_command = self.to_command
        t, q, qd = self.states[self.places[turn]]
        started = clock()
        to_command(t, q, qd)
        return clock() - started


def measure(effort: Effort) -> Part:
    """Measure this part; see the module."""
    part = Part("Step time of every controller on every scenario", TEXT, figure="steps.png")
    lines = []
    for name in effort.scenarios:
        scenario = shortened(Scenario.load(name), effort.duration)
        for looking_ahead in (False, True):
            lines += timed_in_turn(scenario, looking_ahead, effort.turns, part)
    header = [
        "scenario",
        "controller",
        "rows are",
        "m",
        "rows",
        "command",
        "total",
        "ratio",
        "p99/median",
        "first",
    ]
    part.tables.append(Table(header, lines, text_columns=3))
    # no shipped law has so long a plan
    other = ("unit", *(f"{CASE_STUDY}, {law}" for law in LONG_PLANS))
    spreads = {
        name.removesuffix(": p99/median"): value
        for name, value in part.numbers.items()
        if "p99/med" in name
    }
    part.numbers["greatest p99/median"] = max(
        value for name, value in spreads.items() if name not in other
    )
    return part


def timed_in_turn(
    scenario: Scenario, looking_ahead: bool, turns: int, part: Part
) -> list[list[str]]:
    """Return table lines for laws that look ahead, or for those that do not.

    Their numbers are stored in the part.
    """
    laws, others = (
        {
            law: own
            for law, own in controllers(scenario.name).items()
            if ("model" in own.uses) == looking_ahead
        }
        for _ in range(2)
    )
    walks = {}
    halves = {}
    # a task stores its last sample: each walk needs a separate one
    setups = {law: scenario.setup() for law in laws}
    runs = {law: simulate(setups[law], controller) for law, controller in laws.items()}
    if looking_ahead:
        turns = min(4 * turns, *(len(run.t) for run in runs.values()))
    for law, controller in laws.items():
        setup = setups[law]
        run = runs[law]
        walks[law] = Walk(setup, controller, run, turns)
        halves[f"{law}, in two"] = Walk(scenario.setup(), others[law], run, turns)
    subjects: dict[str, Subject] = {law: walk.in_one for law, walk in walks.items()}
    times = in_turn({**subjects, **{name: walk.in_two for name, walk in halves.items()}}, turns)
    unit = float(np.median(times[UNIT]))
    if scenario.name == CASE_STUDY and not looking_ahead:
        part.keep("unit", Times(times[UNIT], unit))
    lines = []
    for law, walk in walks.items():
        total = Times(times[law], unit)
        rows, command = (Times(column, unit) for column in times[f"{law}, in two"].T)
        part.keep(f"{scenario.name}, {law}", total)
        lines.append(
            [
                scenario.name,
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
    return lines


def shortened(scenario: Scenario, duration: float) -> Scenario:
    """Return the scenario with its duration limited [s]."""
    return scenario.with_override("duration", min(float(scenario.tables["duration"]), duration))
