"""Extra time of a step that uses measurements of a detector."""

from __future__ import annotations

from time import perf_counter_ns
from typing import Any

import numpy as np

from vsconstraints.controllers import SlidingMode
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate

from .part import CASE_STUDY, Effort, Part, Table, digits, median_p99_max, ratios
from .steps import Walk, shortened
from .timing import UNIT, Times, in_turn

TEXT = """
State in, command out, by the sliding mode along its own run, with what a detector would have \
measured at each sample
and without, in turn. *extra* is the median beyond that without, in units.
"""

SCENARIOS = (CASE_STUDY, "ur5-image")
GIVEN: dict[str, tuple[str, ...]] = {
    "nothing measured": (),
    "pixels": ("pixels",),
    "pixels, depth": ("pixels", "depth"),
    "pixels, depth, taken": ("pixels", "depth", "taken"),
}


class MeasuredWalk(Walk):
    """Steps of a run with measured features."""

    def __init__(self, setup: Setup, run: Trajectory, turns: int, given: tuple[str, ...]) -> None:
        super().__init__(setup, SlidingMode(), run, turns)
        self.measured: dict[int, dict[str, Any]] = {}
        for k in self.places:
            t, q, qd = self.states[k]
            state = setup.scene.evaluate(t, q, qd)
            every = {
                "pixels": state.pixels.position + 0.5,
                "depth": state.depth.copy(),
                "taken": t - 0.002,
            }
            self.measured[k] = {name: every[name] for name in given}

    def in_one(self, turn: int) -> float:
        """Return the time from state to command [ns]."""
        clock = perf_counter_ns
        to_command = self.to_command
        place = self.places[turn]
        t, q, qd = self.states[place]
        measured = self.measured[place]
        started = clock()
        to_command(t, q, qd, **measured)
        return clock() - started


def measure(effort: Effort) -> Part:
    """Measure this part; see the module."""
    part = Part("Measured features", TEXT)
    lines = []
    for name in SCENARIOS:
        scenario = shortened(Scenario.load(name), effort.duration)
        run = simulate(scenario.setup(), SlidingMode())
        walks = {
            what: MeasuredWalk(scenario.setup(), run, effort.turns, given)
            for what, given in GIVEN.items()
        }
        times = in_turn({what: walk.in_one for what, walk in walks.items()}, effort.turns)
        unit = float(np.median(times[UNIT]))
        without = Times(times["nothing measured"], unit).ratio
        for what, given in GIVEN.items():
            total = Times(times[what], unit)
            part.keep(f"{name}, {what}", total)
            if given:
                part.numbers[f"{name}, {what}: extra"] = total.ratio - without
            extra = digits(total.ratio - without) if given else ""
            lines.append([name, what, median_p99_max(total), ratios(total), extra])
    header = ["scenario", "measured", "µs: median / p99 / max", "ratio", "extra"]
    part.tables.append(Table(header, lines, text_columns=2))
    return part
