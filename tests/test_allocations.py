"""Compiled laws make no arrays: everything a command needs stands in workspaces that were made
before.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from test_scratch import problem
from vsconstraints.comparisons import Suite
from vsconstraints.compiled import load
from vsconstraints.control import ControlStep
from vsconstraints.controllers import (
    CONTROLLERS,
    DEMANDS,
    RESOLVERS,
    Barrier,
    Hierarchy,
    Law,
    Priority,
    SlidingMode,
)
from vsconstraints.controllers.base import Controller, restart
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

pytestmark = pytest.mark.skipif(load("laws") is None, reason="there is no compiler")

SCENARIOS = [scenario.name for scenario in Suite.load().scenarios]


def laws() -> Iterator[Controller]:
    """Every registered law, every demand with both kinds of resolvers, and every resolver."""
    yield from (law() for law in CONTROLLERS.values())
    yield from (
        Law(demand(), resolver) for demand in DEMANDS for resolver in (Priority(), Hierarchy())
    )
    yield from (Law(Barrier(), resolver()) for resolver in RESOLVERS)


@pytest.fixture
def allocations() -> Iterator[Any]:
    """The function that counts what compiled code has allocated so far."""
    counter = pytest.importorskip("numba.core.runtime._nrt_python")
    counter.memsys_enable_stats()
    yield counter.memsys_get_stats_alloc
    counter.memsys_disable_stats()


def test_what_is_allocated_is_counted(allocations: Any) -> None:
    make = load("compiler").numba.njit(lambda: np.empty(3))
    make()
    before = allocations()
    make()
    assert allocations() > before


@pytest.mark.parametrize("name", SCENARIOS)
def test_no_law_allocates_from_state_to_command(name: str, allocations: Any) -> None:
    """Along a run, and there with several times its speed, with which rows are violated."""
    setup = Scenario.load(name).with_override("duration", 1.0).setup()
    run = simulate(setup, SlidingMode())
    along = zip(run.t[::50], run.q[::50], run.qd[::50], strict=True)
    states = [(float(t), q, faster * qd) for t, q, qd in along for faster in (1.0, 8.0)]
    found = {}
    acted = 0
    for law in laws():
        restart(law, setup.Ts)
        to_command = ControlStep(setup.scene, setup.constraints, setup.task).bind(law)
        to_command(*states[0])
        for state in states:
            before = allocations()
            _, command = to_command(*state)
            if allocations() > before:
                found[law.name] = allocations() - before
            acted += int(command.acted.sum())
    assert found == {}
    assert acted > 0


@pytest.mark.parametrize(("m", "n", "k"), [(30, 7, 8), (30, 30, 6), (100, 7, 8)])
def test_no_law_allocates_where_rows_contradict_each_other(
    m: int, n: int, k: int, allocations: Any
) -> None:
    random = np.random.default_rng(0)
    met = Counter[str]()
    bound = np.full(n, 3.0)
    for _ in range(10):
        rows, task = problem(random, m, n, k)
        boxed = replace(rows, switching_gain=np.full(m, 1e4), qdd_min=-bound, qdd_max=bound)
        task = replace(task, error=random.normal(size=k))
        for resolver in RESOLVERS:
            bound_law = Law(Barrier(), resolver()).bind(
                boxed, task, np.empty(m, dtype=np.bool_), np.empty(n)
            )
            bound_law.solve()
            before = allocations()
            bound_law.solve()
            assert allocations() == before, resolver.name
            command = bound_law.command()
            met[command.status if command else "none"] += 1
    assert met["relaxed"] > 10
    assert met["none"] == 0
