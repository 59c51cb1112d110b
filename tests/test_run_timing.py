"""Laws that are called more often than the scene says, or whose commands arrive late: the table
``run`` of an entry.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from campaigns import campaign
from test_disturbances import case
from test_evidence import HERE
from vsconstraints.bench.evidence import Campaign, Evidence, collect
from vsconstraints.bench.evidence.work import Bench, plan_batches
from vsconstraints.comparisons.metrics import MetricInputs, score, timing_columns
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.comparisons.run import perform
from vsconstraints.comparisons.runs.spec import AS_THE_SCENE, ControllerSpec, RunSpec, RunTiming
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios.reading import from_table
from vsconstraints.simulation import until_settled

QUARTER = RunTiming(sampling_time_factor=0.25)
LATE = RunTiming(call_time=1e-3)
TIMED = """
[controllers.quarter]
type = "sliding-mode"
run = { sampling_time_factor = 0.25 }
[controllers.late]
type = "sliding-mode"
run = { call_time = 0.004 }
"""


# --- what becomes of a setup ---


def test_only_time_is_another() -> None:
    setup = until_settled(case(time_constant=0.01, command_delay=0.001, acceleration_noise=0.2))
    own = RunTiming(0.25, 2e-3).of(setup)
    assert (own.Ts, own.disturbances.command_delay) == (0.25 * setup.Ts, 0.003)
    # speeds after a period of the scene have the same variance: four periods, each of a quarter
    assert own.Ts**2 * 4 * own.disturbances.acceleration_noise**2 == pytest.approx(
        (setup.Ts * 0.2) ** 2
    )
    others = {field.name for field in fields(setup)} - {"disturbances", "sampling_time"}
    assert "time_limit" in others
    assert all(getattr(own, name) is getattr(setup, name) for name in others)
    assert AS_THE_SCENE.of(setup) is setup


@pytest.mark.parametrize(
    ("factor", "own", "period", "delay"),
    [
        (0.25, {"delay": 2}, 0.002, 2),  # as before, of the scene's period
        (0.25, {"delay": 2, "image_period": 0.006}, 0.006, 2),
        (3.0, {"delay": 2}, 0.006, 1),  # 4 ms old before: 6 ms, not fresher
        (3.0, {"delay": 2, "image_period": 0.01}, 0.012, 2),  # 20 ms: 24 ms
        (2.5, {"pixel_noise": 1.0}, 0.005, 0),
        (0.25, {}, 0.0, 0),
        (1.0, {"delay": 2}, 0.0, 2),
    ],
)
def test_images_are_those_of_the_scene_or_older(
    factor: float, own: dict[str, Any], period: float, delay: int
) -> None:
    made = RunTiming(factor, 1e-3).of(case(**own)).disturbances
    assert (made.image_period, made.delay) == (pytest.approx(period), delay)


# --- scores ---


def test_rows_that_a_scene_challenges_are_the_same_at_any_sampling_time() -> None:
    """And usage is averaged over the same time: that in which tracking alone is outside."""
    spec = RunSpec("example-2d-fast", ControllerSpec("hierarchical-qp"))
    baseline = perform(replace(spec, controller=ControllerSpec("tracking"))).record
    runs = [
        perform(replace(spec, controller=replace(spec.controller, run=RunTiming(f)))).record
        for f in (1, 0.25, 3)
    ]
    assert [run.Ts / baseline.Ts for run in runs] == [1.0, 0.25, 3.0]
    of_scene, *others = (score(run, baseline) for run in runs)
    challenged = [row["challenged"] for row in of_scene.constraints]
    assert any(challenged)
    assert not all(challenged)
    for run, other in zip(runs[1:], others, strict=True):
        assert [row["challenged"] for row in other.constraints] == challenged
        assert other.result["utilization"] == pytest.approx(
            of_scene.result["utilization"], abs=0.03
        )
        there, expected = (
            MetricInputs(each, baseline).outside_alone.any(axis=1).sum() * each.Ts
            for each in (run, runs[0])
        )
        assert there == pytest.approx(expected, abs=run.Ts)


@pytest.mark.parametrize(
    ("factor", "outside"),
    [
        (1.0, [0, 0, 1, 0, 0, 1]),
        (0.5, [0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1]),
        (2.0, [0, 1, 1]),
        (1.5, [0, 1, 0, 1]),
    ],
)
def test_when_the_baseline_is_outside_by_hand(factor: float, outside: list[int]) -> None:
    """Outside in its third and sixth period: in all of the run's periods that begin there, or that
    these begin in.
    """
    record = perform(
        RunSpec("example-2d-fast", ControllerSpec("tracking"), {"duration": 0.05})
    ).record
    clearance = np.full_like(record.trajectory.clearance[:6], 100.0)
    clearance[[2, 5], 0] = -100.0
    cut = replace(
        record.trajectory,
        t=record.trajectory.t[:6],
        clearance=clearance,
        between_clearance=clearance,
    )
    alone = replace(record, trajectory=cut)
    run = replace(record, Ts=factor * record.Ts)
    assert MetricInputs(run, alone).outside_alone[:, 0].astype(int).tolist() == outside


# --- campaigns ---


@pytest.fixture(scope="module")
def timed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Campaign, Path]:
    folder = tmp_path_factory.mktemp("timed")
    small = campaign(folder, TIMED)
    collect(small, folder / "out", HERE)
    return small, folder / "out"


def test_each_law_has_its_own_time_and_leaves_the_others_theirs(
    timed: tuple[Campaign, Path], tmp_path: Path
) -> None:
    _, out = timed
    runs = Evidence.load(out).runs.set_index("controller")
    plain = campaign(tmp_path)
    collect(plain, tmp_path / "out", HERE)
    alone = Evidence.load(tmp_path / "out").runs.set_index("controller")
    others = ["tracking", "sliding-mode", "hierarchical-qp"]
    same = [table.loc[others].drop(columns=[*timing_columns()]) for table in (runs, alone)]
    pd.testing.assert_frame_equal(
        *same, check_exact=True, check_categorical=False, check_index_type=False
    )
    first, *laws = (
        runs.loc[law].acceleration_variation.to_numpy()
        for law in ("sliding-mode", "quarter", "late")
    )
    assert all((law != first).all() for law in laws)


def test_a_bench_gives_every_law_the_scenes_time_limit(timed: tuple[Campaign, Path]) -> None:
    task = plan_batches(timed[0])[0]
    scene, setups = task.family.set_up(0, task.half, task.seed)
    setup = replace(setups["nominal"], duration=4.0)
    bench = Bench(scene, "nominal", setup)
    limit = until_settled(setup).time_limit
    assert limit is not None
    entries = {entry.name: entry for entry in task.controllers}
    runs = [
        bench.run(entries[name]) for name in ("sliding-mode", "quarter", "sliding-mode", "late")
    ]
    assert [run.Ts / runs[0].Ts for run in runs] == [1.0, 0.25, 1.0, 1.0]
    assert [(run.common - 1) * run.Ts for run in runs] == pytest.approx([4.0] * 4)
    np.testing.assert_array_equal(runs[0].trajectory.q, runs[2].trajectory.q)
    for name, run in zip(("quarter", "late"), runs[1::2], strict=True):
        fresh: RunRecord = Bench(scene, "nominal", setup).run(entries[name])
        np.testing.assert_array_equal(run.trajectory.q, fresh.trajectory.q)


def test_time_is_part_of_what_results_depend_on(timed: tuple[Campaign, Path]) -> None:
    small, out = timed
    identity = small.identity(small.families[0])["controllers"]
    assert identity["quarter"] == {"type": "sliding-mode", "run": {"sampling_time_factor": 0.25}}
    assert identity["sliding-mode"] == {"type": "sliding-mode"}
    faster = small.select(settings=["quarter.run.sampling_time_factor=0.5"])
    with pytest.raises(
        ConfigurationError, match=r"quarter\.run\.sampling_time_factor is 0\.25 there and 0\.5 here"
    ):
        collect(faster, out, HERE)
    # what is stored is read, reported and run again as it was
    stored = Evidence.load(out).manifest["configuration"]["controllers"]
    assert ControllerSpec.from_table("late", stored["late"]).run == RunTiming(call_time=0.004)
    specs = [
        RunSpec("example-2d-fov", ControllerSpec("sliding-mode", run=run))
        for run in (AS_THE_SCENE, QUARTER, LATE)
    ]
    assert len({spec.fingerprint for spec in specs}) == len(set(specs)) == 3


def test_equal_runs_have_equal_fingerprints_whatever_their_controller_is_called() -> None:
    spec = RunSpec("example-2d-fov", ControllerSpec("tracking"))
    renamed = RunSpec("example-2d-fov", ControllerSpec("baseline", "tracking"))
    assert spec == renamed
    assert spec.fingerprint == renamed.fingerprint


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('run = { sampling_time_factor = 0.2 '
         '}', "run: sampling_time_factor must be from 0.25 to 4, not 0.2"),
        ('run = { sampling_time_factor = nan }', "sampling_time_factor must be finite"),
        ('run = { call_time = -1e-6 }', "run: call_time must be from 0 to 10, not -1e-06"),
        ('run = { call_time = "1 ms" }', r"odd.run: call_time must be an integer or a number, not '1 ms'"),
        ('run = { calltime = 1e-3 }', r"key in small.toml.controllers.odd.run 'calltime'. Did you mean 'call_time'"),
        ('run = 4', r"controllers.odd.run must be a table, not 4"),
    ],
)  # fmt: skip
def test_a_run_of_nonsense_is_refused_before_anything_runs(
    table: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigurationError, match=words):
        campaign(tmp_path, f'[controllers.odd]\ntype = "sliding-mode"\n{table}\n')


def test_the_baseline_is_as_the_scene_says(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="'tracking' is reserved for the baseline"):
        campaign(tmp_path, "[controllers.tracking]\nrun = { call_time = 1e-3 }\n")


def test_arms_with_mass_are_refused_where_commands_are_late() -> None:
    real = Campaign.load("real-world")
    late = ["sliding-mode.run.call_time=1e-3"]
    with pytest.raises(
        ConfigurationError, match=r"sliding-mode\.run: .* ur5 has masses in dynamics, images"
    ):
        real.select(settings=late)
    assert real.select(settings=[*late, "conditions=['nominal', 'images']"]).conditions == (
        "nominal",
        "images",
    )


def test_settings_of_a_command_line(tmp_path: Path) -> None:
    small = campaign(tmp_path).select(settings=["sliding-mode.run.call_time=1e-3"])
    (law,) = (entry for entry in small.controllers if entry.name == "sliding-mode")
    assert law.run == LATE
    assert law.changed("run", {"sampling_time_factor": 0.25}).run == QUARTER
    with pytest.raises(ConfigurationError, match=r"key in sliding-mode\.run 'late'"):
        small.select(settings=["sliding-mode.run.late=1e-3"])
    assert from_table(RunTiming, {}, "run") == AS_THE_SCENE
