"""No law gains by seeking scores instead of doing the task: the zoo of :mod:`cheats`, in columns and in reports."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cheats import CHEATS, TUNNEL, WAITING, Cheat, Tunnels
from vsconstraints.controllers import HierarchicalQP
from vsconstraints.notebooks import compare
from vsconstraints.reports.results import Results, clean
from vsconstraints.reports.scenario_section import metric_table
from vsconstraints.reports.summary import law_table
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import score_run, simulate

GROUPS = ("outcome", "task", "chattering")


@pytest.fixture(scope="module")
def zoo(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The case study with all of them, and with two honest laws."""
    laws = ["sliding-mode", "hierarchical-qp", *(cheat() for cheat in CHEATS)]
    folder = tmp_path_factory.mktemp("zoo") / "results"
    return Results(compare(laws, "case-study-6r", workers=0, out=folder, progress=False).stored)


@pytest.mark.parametrize("cheat", CHEATS)
def test_no_cheat_is_the_best_of_anything(cheat: type[Cheat], zoo: Results) -> None:
    if cheat in WAITING:
        pytest.xfail(WAITING[cheat])
    name = cheat.__name__
    tables = [law_table(zoo), *(metric_table(zoo, "case-study-6r", group) for group in GROUPS)]
    assert "**" in "".join(tables)
    for line in "\n".join(tables).splitlines():
        if line.startswith(f"| {name} "):
            assert "**" not in line, line


@pytest.mark.parametrize("cheat", CHEATS)
def test_no_cheat_succeeds(cheat: type[Cheat], zoo: Results) -> None:
    if cheat in WAITING:
        pytest.xfail(WAITING[cheat])
    assert not any(map(clean, zoo.all_runs(cheat.__name__)))
    assert all(map(clean, zoo.all_runs("hierarchical-qp")))


def test_what_is_skipped_or_slow_is_named(zoo: Results) -> None:
    (skipped,) = zoo.all_runs("SkipsAGoal")
    assert (skipped["status"], skipped["reason"]) == ("unfinished", "goal 1 was not reached before goal 2 began")
    assert np.isnan(skipped["settling_time_s"])
    (crawled,) = zoo.all_runs("Crawls")
    assert crawled["status"] == "slow"
    assert crawled["reason"].startswith("still approaching, ends ")
    (still,) = zoo.all_runs("StandsStill")
    assert still["status"] == "trapped"


def test_a_law_that_exits_is_a_failed_run() -> None:
    from cheats import Exits

    setup = Scenario.load("example-2d-fov").with_override("duration", 0.1).setup()
    for found in (simulate(setup, Exits()), score_run(setup, Exits())):
        assert found.status == "failed"
        assert found.reason.startswith("t = 0 s: SystemExit: 0")


def test_a_tunnel_is_seen() -> None:
    """The camera is 6 cm from the sphere's centre at both ends of a period, and in it at the middle."""
    setup = Scenario("tunnel", TUNNEL, Path()).setup()
    run = simulate(setup, Tunnels())
    assert run.status == "converged"
    assert np.abs(np.diff(run.points[:, 0, 0])).max() == pytest.approx(0.12)
    assert run.clearance.min() == pytest.approx(0.01)
    # its whole depth: in the middle it is in the centre
    assert run.between_clearance.min() == pytest.approx(-0.05, abs=1e-3)
    honest = simulate(setup, HierarchicalQP())
    assert np.minimum(honest.clearance, honest.between_clearance).min() > -0.05
