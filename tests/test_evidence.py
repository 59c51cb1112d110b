"""Campaigns: what a worker finds is what a comparison finds, whoever makes the runs; what is done
is done once.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from campaigns import assert_same, campaign, tables
from vsconstraints.bench.evidence import (  # fmt: skip
    Batch,
    Campaign,
    Evidence,
    Plan,
    Shard,
    collect,
    merge,
    parquet,
    processes,
    scored,
    work,
)
from vsconstraints.bench.evidence import folder as folders
from vsconstraints.bench.evidence.parquet import KEYS
from vsconstraints.bench.evidence.work import plan_batches
from vsconstraints.comparisons.metrics import (
    RUN,
    Score,
    constraint_columns,
    result_columns,
    score,
    timing_columns,
)
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.comparisons.runs.files import SUMS
from vsconstraints.comparisons.runs.pool import Failure
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.errors import ConfigurationError, StorageError
from vsconstraints.simulation import simulate


class Here:
    """Workers that are this process; those of ``mourned`` tasks die, as often as they are asked."""

    def __init__(
        self, function: Callable[..., Any], mourned: Callable[[Batch], bool] = lambda task: False
    ) -> None:
        self.function = function
        self.mourned = mourned

    def run(
        self,
        calls: Mapping[Any, tuple[Any, ...]],
        limits: Mapping[Any, float] | None = None,
        *,
        again: bool = True,
    ) -> Iterator[tuple[Any, Any]]:
        for key, arguments in reversed(calls.items()):
            dead = self.mourned(arguments[0])
            yield (
                key,
                Failure("the process that ran it died") if dead else self.function(*arguments),
            )


@contextmanager
def here(function: Callable[..., Any]) -> Iterator[Here]:
    yield Here(function)


HERE = Plan(workers=here)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Campaign, Path]:
    """A campaign that is done, and its folder."""
    folder = tmp_path_factory.mktemp("whole")
    small = campaign(folder)
    finished = collect(small, folder / "out", HERE)
    assert (finished.progress.done, finished.progress.runs) == (6, 36)
    return small, folder / "out"


def test_scores_are_those_of_runs_that_share_nothing(whole: tuple[Campaign, Path]) -> None:
    """Every law on a setup of its own, by the public call, scored as a comparison does."""
    small, out = whole
    evidence = Evidence.load(out)
    for scene, condition in ((0, "nominal"), (3, "limited")):
        drawn = small.families[0].scene(scene)
        baseline = None
        for entry in small.controllers:
            setup = drawn.setup(condition)
            record = RunRecord.of(setup, simulate(setup, entry.make(), by_public_call=True), "")
            baseline = baseline or record
            expected = score(record, baseline)
            runs, rows = (
                _of_run(table, condition, scene, entry.name)
                for table in (evidence.runs, evidence.rows)
            )
            assert len(runs) == 1
            for column in set(expected.result) - set(timing_columns()):
                found = runs.iloc[0][column]
                value = expected.result[column]
                assert found == value or (pd.isna(found) and not abs(value) < float("inf")), column
            told = [
                line
                for line in expected.constraints
                if line["constraint"] in set(rows["constraint"])
            ]
            assert [line["clearance_min"] for line in told] == rows["clearance_min"].tolist()
            left_out = [line for line in expected.constraints if line not in told]
            assert not any(
                line["challenged"] or line["active_time_s"] or line["violation_depth"]
                for line in left_out
            )
    assert evidence.rows["challenged"].any()


def _of_run(table: pd.DataFrame, condition: str, scene: int, controller: str) -> pd.DataFrame:
    which = (
        (table["condition"] == condition)
        & (table["scene"] == scene)
        & (table["controller"] == controller)
    )
    return table[which]


def test_every_scene_has_every_run_once_in_order(whole: tuple[Campaign, Path]) -> None:
    small, out = whole
    evidence = Evidence.load(out)
    keys = evidence.runs[["condition", "scene", "controller"]].astype(
        {"condition": str, "controller": str}
    )
    laws = ("tracking", "sliding-mode", "hierarchical-qp")
    expected = [(c, s, law) for c in ("nominal", "limited") for s in range(6) for law in laws]
    assert list(keys.itertuples(index=False, name=None)) == expected
    assert list(evidence.runs.columns) == [
        *(key.name for key in KEYS),
        *(n for n in result_columns() if n not in RUN),
    ]
    assert list(evidence.rows.columns) == [
        *(key.name for key in KEYS), *(n for n in constraint_columns() if n not in RUN)
    ]  # fmt: skip
    assert evidence.scenes["found"].all()
    assert (
        json.loads(evidence.scenes.loc[2, "values"])["q0"]
        == small.families[0].scene(2).values["q0"]
    )
    assert evidence.runs["status"].dtype == "category"
    assert evidence.runs["compiled"].dtype == bool


def test_rows_are_stored_for_each_reason_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Challenged, violated, or acted: one is enough, and a row with none is left out."""
    reasons = {"challenged": True, "violation_depth": 1e-9, "active_time_s": 1e-3, "nothing": 0.0}
    quiet = {"challenged": False, "violation_depth": 0.0, "active_time_s": 0.0}

    def made(record: RunRecord, baseline: RunRecord | None) -> Score:
        scored = score(record, baseline)
        row = {**scored.constraints[0], **quiet}
        rows = [{**row, name: value, "constraint": name} for name, value in reasons.items()]
        return replace(scored, constraints=[{key: line[key] for key in row} for line in rows])

    monkeypatch.setattr(work, "score", made)
    task = replace(next(iter(plan_batches(campaign(tmp_path)))), conditions=("nominal",))
    stored = scored(task).rows.to_pandas()
    kept = ["challenged", "violation_depth", "active_time_s"]
    assert [list(own["constraint"]) for _, own in stored.groupby(["scene", "controller"])] == [
        kept
    ] * 3


@pytest.mark.parametrize("condition", ["limited", "noisy"])
def test_setups_that_are_shared_change_nothing(condition: str, tmp_path: Path) -> None:
    """Every law of the default comparison, after all others and on a setup of its own: noise is the
    same for all.
    """
    campaign(tmp_path)
    noisy = "[conditions.noisy.disturbances]\npixel_noise = 0.5\ndelay = 1\n"
    (tmp_path / "quick.toml").write_text((tmp_path / "quick.toml").read_text() + noisy)
    small = Campaign.load(tmp_path / "small.toml")
    shared = replace(
        small, controllers=(*Campaign.load().controllers, ControllerSpec("again", "sliding-mode"))
    )
    task = replace(next(iter(plan_batches(shared))), scenes=(0,), conditions=(condition,))
    together = scored(task).runs.drop_columns(list(timing_columns())).to_pylist()
    baseline, *_ = task.controllers
    for entry, line in zip(task.controllers, together, strict=True):
        alone = replace(
            task, controllers=(baseline, entry) if entry is not baseline else (baseline,)
        )
        assert scored(alone).runs.drop_columns(list(timing_columns())).to_pylist()[-1] == line


@pytest.mark.parametrize("reader", ["pandas", "polars", "duckdb"])
def test_batches_are_read_by_all_three(whole: tuple[Campaign, Path], reader: str) -> None:
    _, out = whole
    expected = (
        Evidence.load(out)
        .runs.groupby("controller", observed=True)["acceleration_variation"]
        .max()
        .to_dict()
    )
    at = str(out / "runs" / "part-*.parquet")
    if reader == "pandas":
        runs = pd.read_parquet(out / "runs")
        found = runs.groupby("controller")["acceleration_variation"].max().to_dict()
    elif reader == "polars":
        import polars as pl

        lines = (
            pl.scan_parquet(at)
            .group_by("controller")
            .agg(pl.col("acceleration_variation").max())
            .collect()
        )
        found = dict(lines.iter_rows())
    else:
        import duckdb

        query = f"select controller, max(acceleration_variation) from '{at}' group by controller"
        found = dict(duckdb.sql(query).fetchall())
    assert found == expected


def test_shards_merged_and_processes_give_the_same(
    whole: tuple[Campaign, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small, out = whole
    for i in (1, 2, 3):
        collect(small, tmp_path / str(i), replace(HERE, shard=Shard(i, 3)))
    merged = merge(tmp_path / "merged", [tmp_path / "3", tmp_path / "1", tmp_path / "2"])
    assert (merged.scenes, merged.runs) == (6, 36)
    assert_same(tables(out), tables(tmp_path / "merged"))
    # scenes that are there twice, but the same, count once, however they are split
    monkeypatch.setattr("vsconstraints.bench.evidence.work.MIN_BATCHES", 2)
    collect(small, tmp_path / "large", HERE)
    assert len(folders.batch_names(tmp_path / "large")) == 2
    merge(tmp_path / "twice", [tmp_path / "2", tmp_path / "large", out])
    assert_same(tables(out), tables(tmp_path / "twice"))
    collect(small, tmp_path / "pool", Plan(workers=processes(1)))
    assert_same(tables(out), tables(tmp_path / "pool"))


def test_what_is_done_is_not_done_again(
    whole: tuple[Campaign, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small, out = whole
    few = replace(small, scenes=2)
    collect(few, tmp_path, HERE)
    # a batch that lost a part, and one that was cut off, are made again; more scenes join
    (tmp_path / "rows").joinpath(folders.batch_names(tmp_path)[0] + ".parquet").unlink()
    cut = tmp_path / "runs" / (folders.batch_names(tmp_path)[1] + ".parquet")
    cut.write_bytes(cut.read_bytes()[:-30])
    (tmp_path / "scenes" / "part-quick-0000005-0000005.parquet.part").write_bytes(b"half")
    drawn: list[int] = []
    made = work.benches
    monkeypatch.setattr(
        work, "benches", lambda task, number: (drawn.append(number), made(task, number))[1]
    )
    finished = collect(replace(small, scenes=3), tmp_path, HERE)
    assert (sorted(drawn), finished.progress.stored_before) == ([0, 1, 2], 0)
    drawn.clear()
    finished = collect(small, tmp_path, HERE)
    assert (sorted(drawn), finished.progress.stored_before) == ([3, 4, 5], 3)
    assert_same(tables(out), tables(tmp_path))
    assert not list(tmp_path.rglob("*.part"))
    drawn.clear()
    assert collect(small, tmp_path, HERE).progress.runs == 0
    assert drawn == []
    manifest = Evidence.load(tmp_path).manifest
    assert (manifest["runs"], manifest["finished"]) == (36, 6)
    assert manifest["runs_per_s"] > 0.0


def test_a_column_that_is_not_there_is_named(whole: tuple[Campaign, Path], tmp_path: Path) -> None:
    small, _ = whole
    collect(replace(small, scenes=1), tmp_path, HERE)
    (name,) = folders.batch_names(tmp_path)
    path = folders.batch_file(tmp_path, "scenes", name)
    lines = folders.parquet.read([path], parquet.tables()["scenes"])
    folders.parquet.write(path, lines.drop_columns(["found"]), folders.parquet.facts_of(path))
    (tmp_path / SUMS).unlink()
    with pytest.raises(
        ConfigurationError, match=r"scenes/part-.* cannot be read: it has no column 'found'"
    ):
        tables(tmp_path)


def test_a_campaign_from_before_a_column_was_added_can_be_read(
    whole: tuple[Campaign, Path], tmp_path: Path
) -> None:
    """The column is empty; all others are as they were."""
    small, _ = whole
    collect(replace(small, scenes=1), tmp_path, HERE)
    now = Evidence.load(tmp_path).runs
    (name,) = folders.batch_names(tmp_path)
    path = folders.batch_file(tmp_path, "runs", name)
    lines = folders.parquet.read([path], parquet.tables()["runs"])
    folders.parquet.write(
        path, lines.drop_columns(["acceleration_max"]), folders.parquet.facts_of(path)
    )
    (tmp_path / SUMS).unlink()
    before = Evidence.load(tmp_path).runs
    assert now["acceleration_max"].gt(0.0).all()
    assert before["acceleration_max"].isna().all()
    pd.testing.assert_frame_equal(
        now.drop(columns="acceleration_max"), before.drop(columns="acceleration_max")
    )


@pytest.mark.parametrize(("before", "after"), [(12, 18), (18, 12), (24, 6)])
def test_batches_of_another_size_are_gone_on_with(
    whole: tuple[Campaign, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    before: int,
    after: int,
) -> None:
    """What was stored by twos goes on by threes, and the other way round: nothing is lost or
    twice.
    """
    small, out = whole
    monkeypatch.setattr("vsconstraints.bench.evidence.work.MIN_BATCHES", 1)
    monkeypatch.setattr("vsconstraints.bench.evidence.work.RUNS_OF_BATCH", before)
    collect(replace(small, scenes=4), tmp_path, HERE)
    assert len(folders.batch_names(tmp_path)) == ceil(4 / (before // 6))
    monkeypatch.setattr("vsconstraints.bench.evidence.work.RUNS_OF_BATCH", after)
    assert collect(small, tmp_path, HERE).progress.stored_before == 4
    assert_same(tables(out), tables(tmp_path))


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        (
            {"settings": ["hierarchical-qp.alpha=10"]},
            "controllers.hierarchical-qp.alpha is only here",
        ),
        ({"settings": ["seed=4"]}, "seed is 0 there and 4 here"),
        ({"settings": ["conditions=nominal"]}, "conditions is"),
        ({"controllers": ["sliding-mode"]}, "controllers.hierarchical-qp is only there"),
        ({"scenes": 4}, "give --scenes 6 or more"),
        ({"families": ["planar-arm"]}, "family quick is only there"),
    ],
)
def test_another_campaign_is_refused(
    whole: tuple[Campaign, Path], changes: dict[str, Any], what: str
) -> None:
    small, out = whole
    before = tables(out)
    with pytest.raises(ConfigurationError, match="another campaign") as refused:
        collect(small.select(**changes), out, HERE)
    assert what in str(refused.value)
    assert "--fresh" in str(refused.value)
    assert_same(before, tables(out))


def test_a_refusal_removes_nothing(whole: tuple[Campaign, Path], tmp_path: Path) -> None:
    small, out = whole
    folder = shutil.copytree(out, tmp_path / "copy")
    (folder / "runs" / "part-unfinished.parquet.part").write_bytes(b"half of it")
    damaged = sorted((folder / "runs").glob("*.parquet"))[-1]
    damaged.write_bytes(damaged.read_bytes()[:-20])
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(ConfigurationError, match="another campaign"):
        collect(small.select(settings=["seed=4"]), folder, HERE)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_other_code_is_refused_and_fresh_replaces(
    whole: tuple[Campaign, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small, out = whole
    one = replace(small, scenes=1)
    collect(one, tmp_path / "a", HERE)
    monkeypatch.setattr(
        "vsconstraints.comparisons.runs.machine.code_hash", lambda: "of another day"
    )
    with pytest.raises(ConfigurationError, match="the package's source differs"):
        collect(one, tmp_path / "a", HERE)
    assert collect(one, tmp_path / "a", replace(HERE, fresh=True)).progress.runs == 6
    with pytest.raises(
        ConfigurationError, match=r"not parts of one campaign: the package's source differs"
    ):
        merge(tmp_path / "m", [out, tmp_path / "a"])
    assert not (tmp_path / "m").exists()


def test_merging_names_what_is_missing_or_differs(
    whole: tuple[Campaign, Path], tmp_path: Path
) -> None:
    small, out = whole
    for i in (1, 2, 3):
        collect(small, tmp_path / str(i), replace(HERE, shard=Shard(i, 3)))
    with pytest.raises(
        ConfigurationError, match=r"shard 2/3 is missing: scenes quick 2–3 are missing"
    ):
        merge(tmp_path / "m", [tmp_path / "1", tmp_path / "3"])
    collect(
        small.select(settings=["hierarchical-qp.alpha=9"]),
        tmp_path / "other",
        replace(HERE, shard=Shard(2, 3)),
    )
    with pytest.raises(ConfigurationError, match=r"controllers\.hierarchical-qp\.alpha"):
        merge(tmp_path / "m", [tmp_path / "1", tmp_path / "other", tmp_path / "3"])
    name = folders.batch_names(tmp_path / "2")[0]
    parts = {
        table: pd.read_parquet(folders.batch_file(tmp_path / "2", table, name))
        for table in parquet.tables()
    }
    parts["runs"].loc[1, "acceleration_variation"] *= 1.0 + 1e-15 * 8
    import pyarrow as pa

    arrow = {
        table: pa.Table.from_pandas(frame, preserve_index=False) for table, frame in parts.items()
    }
    facts = folders.Facts.of(folders.batch_file(tmp_path / "2", "runs", name))
    folders.write_batch(tmp_path / "2", name, arrow, facts)
    with pytest.raises(ConfigurationError, match=r"scene 2 of quick is in .* with different runs"):
        merge(tmp_path / "m", [out, tmp_path / "2"])
    with pytest.raises(ConfigurationError, match="already holds results"):
        merge(out, [tmp_path / "1", tmp_path / "2", tmp_path / "3"])
    with pytest.raises(ConfigurationError, match="holds no evidence"):
        merge(tmp_path / "m", [tmp_path])
    assert not (tmp_path / "m").exists()


def test_a_law_that_raises_fails_alone(tmp_path: Path) -> None:
    odd = campaign(tmp_path, '[controllers.odd]\ntype = "odd:Bad"\nabove = -1e9\n', scenes=1)
    finished = collect(odd, tmp_path / "out", HERE)
    runs = Evidence.load(tmp_path / "out").runs
    failed = runs[runs["status"] == "failed"]
    assert failed["controller"].tolist() == ["odd"] * 2
    assert failed["reason"].str.contains("no idea").all()
    assert not finished.progress.all_failed
    alone = odd.select(controllers=["odd"])
    assert collect(alone, tmp_path / "alone", HERE).progress.all_failed


def test_a_scene_that_kills_is_found_and_others_are_kept(
    whole: tuple[Campaign, Path], tmp_path: Path
) -> None:
    """Whoever is asked for scene 4 with a law dies: of a batch, that run alone fails."""
    small, out = whole

    def mourned(task: Batch) -> bool:
        return 4 in task.scenes and bool(task.conditions) and task.single in (None, "sliding-mode")

    @contextmanager
    def deadly(function: Callable[..., Any]) -> Iterator[Here]:
        yield Here(function, mourned)

    finished = collect(small, tmp_path, Plan(workers=deadly))
    assert finished.progress.done == 6
    expected = tables(out)
    found = tables(tmp_path)
    dead = (found["runs"]["scene"] == 4) & (found["runs"]["controller"] == "sliding-mode")
    assert found["runs"][dead]["reason"].tolist() == ["the process that ran it died"] * 2
    assert (found["runs"][dead]["status"] == "failed").all()
    pd.testing.assert_frame_equal(expected["runs"][~dead], found["runs"][~dead])
    pd.testing.assert_frame_equal(expected["scenes"], found["scenes"])


def test_noise_is_another_one_in_every_scene(tmp_path: Path) -> None:
    campaign(tmp_path)
    noisy = "q0 = [-0.72, -1.744, 1.074]\n[conditions.noisy.disturbances]\npixel_noise = 0.5\n"
    (tmp_path / "quick.toml").write_text(f'extends = "example-2d-fast"\nduration = 0.8\n{noisy}')
    collect(Campaign.load(tmp_path / "small.toml").select(scenes=2), tmp_path / "out", HERE)
    runs = Evidence.load(tmp_path / "out").runs
    variation = runs[runs["controller"] == "sliding-mode"].set_index(["condition", "scene"])[
        "acceleration_variation"
    ]
    assert variation["nominal", 0] == variation["nominal", 1]
    assert variation["noisy", 0] != variation["noisy", 1]


def test_a_campaign_none_of_whose_scenes_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = campaign(tmp_path, scenes=2)
    monkeypatch.setattr(work, "benches", lambda task, number: ("ValueError: no", {}))
    finished = collect(small, tmp_path / "out", HERE)
    assert (finished.progress.done, finished.progress.all_failed) == (2, False)
    evidence = Evidence.load(tmp_path / "out")
    assert (len(evidence.runs), len(evidence.rows), evidence.scenes["found"].sum()) == (0, 0, 0)


def test_a_scene_that_cannot_be_drawn_is_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = campaign(tmp_path, scenes=2)

    made = work.benches

    def drawn(task: Batch, number: int) -> Any:
        return ("ValueError: no", {}) if number else made(task, number)

    monkeypatch.setattr(work, "benches", drawn)
    collect(small, tmp_path / "out", HERE)
    evidence = Evidence.load(tmp_path / "out")
    assert evidence.scenes["found"].tolist() == [True, False]
    assert json.loads(evidence.scenes.loc[1, "rejected"]) == {"ValueError: no": 1}
    assert len(evidence.runs) == 6


@pytest.mark.parametrize("keep", ["none", "failed", "worst", "first", "all"])
def test_trajectories_are_those_of_the_runs(
    whole: tuple[Campaign, Path], tmp_path: Path, keep: str
) -> None:
    few = replace(whole[0], scenes=3)
    for i in (1, 2):
        collect(few, tmp_path / str(i), replace(HERE, shard=Shard(i, 2), keep=keep))
    merge(tmp_path / "merged", [tmp_path / "1", tmp_path / "2"])
    collect(few, tmp_path / "whole", replace(HERE, keep=keep))
    kept, merged = (
        sorted(path.name for path in (tmp_path / name).rglob("*.npz"))
        for name in ("whole", "merged")
    )
    assert kept == merged
    manifest = Evidence.load(tmp_path / "merged").manifest
    of_parts = [part["trajectories"] for part in manifest["merged"]]
    assert (manifest["trajectories"], manifest["scenes"], manifest["stored_before"]) == (
        len(kept),
        3,
        3,
    )
    assert of_parts == [len(list((tmp_path / part).rglob("*.npz"))) for part in "12"]
    evidence = Evidence.load(tmp_path / "whole")
    runs = evidence.runs
    deepest = {
        (condition, law): max(zip(group["violation_depth"], -group["scene"], strict=True))
        for (condition, law), group in runs.groupby(["condition", "controller"], observed=True)
    }
    expected = {
        "none": 0,
        "failed": 0,
        "first": 6,
        "all": 18,
        "worst": sum(depth > 0.0 for depth, _ in deepest.values()),
    }
    assert len(kept) == expected[keep]
    for line in runs.itertuples():
        record = evidence.record("quick", line.condition, line.scene, line.controller)
        if record is not None:
            assert (
                score(record, None).result["acceleration_variation"] == line.acceleration_variation
            )
            if keep == "worst":
                assert -deepest[line.condition, line.controller][1] == line.scene


def test_a_disk_that_is_full_is_named_and_what_is_there_stays(
    whole: tuple[Campaign, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small, out = whole
    write = folders.parquet.write
    left = [7]

    def full(*arguments: Any) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, "No space left on device")
        write(*arguments)

    monkeypatch.setattr(folders.parquet, "write", full)
    with pytest.raises(StorageError, match=r"No space left on device; finished runs are kept"):
        collect(small, tmp_path, HERE)
    left[0] = 10**9
    assert collect(small, tmp_path, HERE).progress.stored_before == 2
    assert_same(tables(out), tables(tmp_path))


def test_a_merge_on_a_full_disk_says_that_the_merged_folders_are_unchanged(
    whole: tuple[Campaign, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An earlier merge is cleared before files are written: nothing of it is kept."""
    _, out = whole
    assert merge(tmp_path, [out]).scenes

    def full(*arguments: Any) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(folders.parquet, "write", full)
        with pytest.raises(StorageError, match="the merged folders are unchanged, and the same"):
            merge(tmp_path, [out])
    assert not folders.batch_names(tmp_path)
    assert merge(tmp_path, [out]).scenes
    assert_same(tables(out), tables(tmp_path))


def test_an_interrupt_keeps_what_is_finished(whole: tuple[Campaign, Path], tmp_path: Path) -> None:
    small, out = whole

    def stop(progress: Any) -> None:
        if progress.done == 4:
            raise KeyboardInterrupt

    finished = collect(small, tmp_path, HERE, on_progress=stop)
    assert (finished.interrupted, finished.progress.done) == (2, 4)
    assert collect(small, tmp_path, HERE).progress.stored_before == 4
    assert_same(tables(out), tables(tmp_path))


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"scenes": 0}, "scenes must be from 1"),
        (
            {"controllers": ["sliding-mod"]},
            "unknown controller 'sliding-mod'.*Did you mean 'sliding-mode'",
        ),
        ({"families": ["planar-rm"]}, "unknown family 'planar-rm'.*Did you mean 'planar-arm'"),
        ({"settings": ["conditions=windy"]}, "unknown condition 'windy'.*limited, nominal"),
        ({"settings": ["half=left"]}, "unknown half 'left'"),
        ({"settings": ["hierarchical-qp.alfa=1"]}, "alfa"),
        ({"settings": ["seed=-1"]}, "seed must be 0 or more"),
        ({"settings": ["scenes=many"]}, "scenes must be an integer"),
    ],
)
def test_nonsense_is_refused_before_anything_runs(
    tmp_path: Path, changes: dict[str, Any], what: str
) -> None:
    with pytest.raises(ConfigurationError, match=what):
        campaign(tmp_path).select(**changes)


def test_a_family_without_scenes_is_refused_before_anything_runs(tmp_path: Path) -> None:
    small = campaign(tmp_path)
    text = (tmp_path / "quick.toml").read_text().replace("0.3", "0.01")
    (tmp_path / "quick.toml").write_text("attempts = 2\n" + text)
    with pytest.raises(
        ConfigurationError, match=r"all of 6 attempts at its first 3 .*challenged 6"
    ):
        collect(Campaign.load(tmp_path / "small.toml"), tmp_path / "out", HERE)
    assert not (tmp_path / "out" / "runs").exists()
    assert small.scenes == 6


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "a/b", "1/", "-1/2"])
def test_a_shard_that_is_none(text: str) -> None:
    with pytest.raises(ConfigurationError, match="--shard must be i/n"):
        Shard.parsed(text)


@pytest.mark.parametrize(("count", "of"), [(1, 1), (7, 3), (2, 5), (1000, 7)])
def test_shards_are_all_scenes_once(count: int, of: int) -> None:
    assert [n for i in range(1, of + 1) for n in Shard(i, of).scenes(count)] == list(range(count))


def test_ten_thousand_scenes_are_opened_at_once(
    whole: tuple[Campaign, Path], tmp_path: Path
) -> None:
    """Footers alone are read: one batch stands for all, with the names and facts of others."""
    small, out = whole
    many = replace(small, scenes=10_000)
    tasks = plan_batches(many)
    assert len(tasks) == 100
    some = folders.batch_names(out)[0]
    parts = {
        table: folders.parquet.read([folders.batch_file(out, table, some)], parquet.tables()[table])
        for table in parquet.tables()
    }
    facts = folders.Facts.of(folders.batch_file(out, "runs", some))
    for task in tasks:
        folders.write_batch(tmp_path, task.name, parts, replace(facts, scenes=task.scenes))
    begun = time.process_time()
    there = folders.finished_batches(tmp_path, many)
    assert time.process_time() - begun < 1.0
    assert sum(len(facts.scenes) for facts in there) == 10_000


def test_a_folder_of_a_comparison_is_left_alone(
    whole: tuple[Campaign, Path], tmp_path: Path
) -> None:
    small, _ = whole
    manifest = {"configuration": {"scenarios": {}}}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(ConfigurationError, match="holds a comparison, not evidence"):
        collect(small, tmp_path, HERE)
    with pytest.raises(ConfigurationError, match="holds a comparison, not evidence"):
        collect(small, tmp_path, replace(HERE, fresh=True))
    assert json.loads((tmp_path / "manifest.json").read_text()) == manifest


def test_tasks_can_be_sent_anywhere(whole: tuple[Campaign, Path]) -> None:
    import pickle

    small, _ = whole
    task = replace(next(iter(plan_batches(small))), scenes=(1,))
    there = pickle.loads(pickle.dumps(scored(pickle.loads(pickle.dumps(task)))))
    assert there.runs.drop_columns(list(timing_columns())).equals(
        scored(task).runs.drop_columns(list(timing_columns()))
    )
    assert os.getcwd()
