"""Step times of all demands with two resolvers, and of all resolvers with the barrier.

The two resolvers are those of the paper's law and of the hierarchical QP.
"""

from __future__ import annotations

import numpy as np

from vsconstraints.controllers import (
    DEMANDS,
    RESOLVERS,
    Barrier,
    Hierarchy,
    Law,
    Priority,
    Resolver,
    SlidingMode,
)
from vsconstraints.controllers.base import restart
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

from .part import CASE_STUDY, Effort, Part, Table, digits, microseconds
from .steps import Walk, shortened
from .timing import UNIT, in_turn

TEXT = """
State in, command out, in the case study, at samples evenly spread over the run of the paper's \
law, the same for all. In
parentheses the median in units beyond that of the paper's law, which is `switch` with `priority`, \
and of the
hierarchical QP, which is `barrier` with `hierarchy`. The second table has every resolver with \
`barrier`.
"""

REFERENCES: dict[Resolver, str] = {Priority(): "switch", Hierarchy(): "barrier"}
"""Demand of the reference law of each resolver."""


def measure(effort: Effort) -> Part:
    """Measure this part; see the module."""
    part = Part("Every demand with two resolvers, every resolver with one demand", TEXT)
    scenario = shortened(Scenario.load(CASE_STUDY), effort.duration)
    # the first subject after the unit finds empty caches: it must not be a reference
    laws = {
        f"{demand.name}, {resolver.name}": Law(demand(), resolver)
        for demand in reversed(DEMANDS)
        for resolver in REFERENCES
    }
    shared = {
        f"{Barrier.name}, {resolver.name}": Law(Barrier(), resolver()) for resolver in RESOLVERS
    }
    laws = {**{name: law for name, law in shared.items() if name not in laws}, **laws}
    setup = scenario.setup()
    run = simulate(setup, SlidingMode())
    walks = {}
    for name, law in laws.items():
        restart(law, setup.Ts)
        walks[name] = Walk(scenario.setup(), law, run, effort.turns).in_one
    times = in_turn(walks, effort.turns)
    unit = float(np.median(times[UNIT]))
    median = {name: float(np.median(times[name])) for name in laws}
    for demand in DEMANDS:
        for resolver, reference in REFERENCES.items():
            name = f"{demand.name}, {resolver.name}"
            part.numbers[f"{name}: median"] = median[name]
            part.numbers[f"{name}: ratio"] = median[name] / unit
            part.numbers[f"{name}: extra"] = (
                median[name] - median[f"{reference}, {resolver.name}"]
            ) / unit
    names = [resolver.name for resolver in REFERENCES]
    for resolver in names:
        beyond = {
            demand.name: part.numbers[f"{demand.name}, {resolver}: extra"] for demand in DEMANDS
        }
        most = max(beyond, key=lambda name: beyond[name])
        part.numbers[f"{resolver}: extra"] = beyond[most]
        part.text += (
            f"With `{resolver}` `{most}` takes most, {digits(beyond[most])} units beyond.\n"
        )

    def cell(name: str) -> str:
        return f"{microseconds(median[name])} ({part.numbers[f'{name}: extra']:+.3f})"

    lines = [
        [demand.name, *(cell(f"{demand.name}, {resolver}") for resolver in names)]
        for demand in DEMANDS
    ]
    part.tables.append(Table(["demand", *(f"{resolver}, µs" for resolver in names)], lines))
    lines = []
    for name, law in shared.items():
        part.numbers[f"{name}: median"], part.numbers[f"{name}: ratio"] = (
            median[name],
            median[name] / unit,
        )
        lines.append([law.resolver.name, microseconds(median[name]), digits(median[name] / unit)])
    part.tables.append(Table(["resolver", "µs", "ratio"], lines))
    return part
