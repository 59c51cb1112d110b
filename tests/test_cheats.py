"""No law gains by seeking scores instead of doing the task: the zoo of :mod:`cheats`, in columns
and in reports.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cheats import (
    CHEATS,
    CHEATS_AT_SPEED,
    TUNNEL,
    Bounces,
    Cheat,
    CheatAtSpeed,
    Crawls,
    Exits,
    Overspeeds,
    RushesThroughTheGoal,
    Tunnels,
    TunnelsAtSpeed,
)
from vsconstraints.controllers import Controller, HierarchicalQP
from vsconstraints.reports.results import Results, clean
from vsconstraints.reports.scenario import metric_table
from vsconstraints.reports.summary import law_table
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import score_run, simulate, until_settled
from vsconstraints.view.notebooks import compare

GROUPS = ("outcome", "task", "chattering")


@pytest.fixture(scope="module")
def zoo(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The case study with all of them, and with two honest laws."""
    laws = [*HONEST, *(cheat() for cheat in CHEATS)]
    folder = tmp_path_factory.mktemp("zoo") / "results"
    return Results(compare(laws, "case-study-6r", workers=0, out=folder, progress=False).stored)


HONEST = "sliding-mode", "hierarchical-qp"


def best_of(results: Results, *names: str) -> set[tuple[int, int]]:
    """Tables of a comparison's only scenario, and their columns, in which a value of one of these
    laws is bold.
    """
    (scenario,) = results.scenarios
    tables = [law_table(results), *(metric_table(results, scenario, group) for group in GROUPS)]
    return {
        (number, column)
        for number, table in enumerate(tables)
        for line in table.splitlines()
        for column, cell in enumerate(line.split("|"))
        if line.split("|")[1:2] and line.split("|")[1].strip() in names and "**" in cell
    }


def test_who_overspeeds_by_less_than_a_switching_step_does_not_succeed(tmp_path: Path) -> None:
    scene = Scenario.load("case-study-6r").with_override("constraints.2.switching_gain", 30.0)
    laws = ["hierarchical-qp", Overspeeds()]
    results = Results(
        compare(laws, scene, workers=0, out=tmp_path / "results", progress=False).stored
    )
    assert not any(map(clean, results.all_runs("Overspeeds")))


def test_who_bounces_uses_little_of_the_space(tmp_path: Path) -> None:
    """A third of the image is unused on average, while the only sample that is held is near the
    boundary.
    """
    found = compare(
        Bounces(), "example-2d-fov", workers=0, out=tmp_path / "results", progress=False
    )
    (bouncing,) = Results(found.stored).all_runs("Bounces")
    assert bouncing["utilization"] < 0.8


@pytest.mark.parametrize("cheat", CHEATS)
def test_no_cheat_is_the_best_of_anything(cheat: type[Cheat], zoo: Results) -> None:
    # an honest law that is as good has won nothing by cheating: who claims a loss of rank in vain
    # is a sliding mode
    assert not best_of(zoo, cheat.__name__) - best_of(zoo, *HONEST)
    assert best_of(zoo, "hierarchical-qp")


@pytest.mark.parametrize("cheat", CHEATS)
def test_no_cheat_succeeds(cheat: type[Cheat], zoo: Results) -> None:
    assert not any(map(clean, zoo.all_runs(cheat.__name__)))
    assert all(map(clean, zoo.all_runs("hierarchical-qp")))


def test_what_is_skipped_or_slow_is_named(zoo: Results) -> None:
    (skipped,) = zoo.all_runs("SkipsAGoal")
    assert (skipped["status"], skipped["reason"]) == (
        "unfinished",
        "goal 1 was not reached before goal 2 began",
    )
    assert np.isnan(skipped["settling_time_s"])
    (still,) = zoo.all_runs("StandsStill")
    assert still["status"] == "trapped"
    crawled = simulate(until_settled(Scenario.load("example-2d-fast").setup()), Crawls())
    assert crawled.status == "slow"
    assert crawled.reason.startswith("still approaching, ends ")
    assert crawled.t[-1] == pytest.approx(3.0 * 3.355, abs=0.005)


def test_a_law_that_exits_is_a_failed_run() -> None:
    setup = Scenario.load("example-2d-fov").with_override("duration", 0.1).setup()
    for found in (simulate(setup, Exits()), score_run(setup, Exits())):
        assert found.status == "failed"
        assert found.reason.startswith("t = 0 s: SystemExit: 0")


@pytest.mark.parametrize(
    ("cheat", "arm"), [(Tunnels, "acceleration"), (TunnelsAtSpeed, "velocity")]
)
def test_a_tunnel_is_seen(cheat: type[Controller], arm: str) -> None:
    """The camera is 6 cm from the sphere's centre at both ends of a period, and in it at the
    middle.
    """
    setup = Scenario("tunnel", TUNNEL | {"arm": {"command": arm}}, Path()).setup()
    run = simulate(setup, cheat())
    assert run.status == "converged"
    assert np.abs(np.diff(run.points[:, 0, 0])).max() == pytest.approx(0.12)
    assert run.clearance.min() == pytest.approx(0.01)
    # its whole depth: in the middle it is in the centre
    assert run.between_clearance.min() == pytest.approx(-0.05, abs=1e-3)
    honest = simulate(setup, HierarchicalQP())
    assert np.minimum(honest.clearance, honest.between_clearance).min() > -0.05


# --- laws that command joint speeds ---

FAST_ARM = Scenario.load("example-2d-fov").with_override(
    "arm", {"command": "velocity", "lag": 0.02, "acceleration": 40.0}
)


@pytest.fixture(scope="module")
def zoo_at_speed(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Their scene with all of them, and with an honest law."""
    laws = ["velocity-qp", *(cheat() for cheat in CHEATS_AT_SPEED)]
    folder = tmp_path_factory.mktemp("zoo-at-speed") / "results"
    return Results(compare(laws, FAST_ARM, workers=0, out=folder, progress=False).stored)


@pytest.mark.parametrize("cheat", CHEATS_AT_SPEED)
def test_no_cheat_at_speed_succeeds(cheat: type[CheatAtSpeed], zoo_at_speed: Results) -> None:
    assert not any(map(clean, zoo_at_speed.all_runs(cheat.__name__)))
    assert not best_of(zoo_at_speed, cheat.__name__) - best_of(zoo_at_speed, "velocity-qp")
    assert all(map(clean, zoo_at_speed.all_runs("velocity-qp")))


def test_who_passes_the_goal_at_speed_has_not_reached_it() -> None:
    """It is within the tolerances of the goal in a sample, as the others are at their end."""
    setup = FAST_ARM.setup()
    run = simulate(setup, RushesThroughTheGoal())
    tolerated = setup.tolerances.translation_m, setup.tolerances.rotation_rad
    assert (run.camera_error < tolerated).all(axis=1).any()
    assert run.status != "converged"
