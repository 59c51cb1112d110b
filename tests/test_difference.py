"""Two comparisons held together: what changed, and whether it is for the worse."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from vsconstraints.bench.difference import changes, difference
from vsconstraints.bench.reports.difference import page, verdict
from vsconstraints.cli import app, main
from vsconstraints.comparisons import StoredComparison, Suite, compare
from vsconstraints.comparisons.metrics import (
    constraint_columns,
    result_columns,
    run_metrics,
    timing_columns,
)
from vsconstraints.comparisons.tables import write_table
from vsconstraints.errors import ConfigurationError

LAWS = ("tracking", "one", "two")
FLAGS = {metric.column for metric in run_metrics() if metric.kind == "flag"}


@dataclass
class Made:
    """A folder of a comparison that a test writes down: every number is 1 + the trial, but for what
    it says.
    """

    trials: int = 12
    cells: dict[tuple[str, int], dict[str, Any]] = field(default_factory=dict)
    left_out: tuple[tuple[str, int], ...] = ()
    manifest: dict[str, Any] = field(default_factory=dict)
    controllers: dict[str, Any] = field(
        default_factory=lambda: {law: {"type": "sliding-mode"} for law in LAWS}
    )
    seed: int = 0

    def set(self, law: str, trials: Any, **cells: Any) -> Made:
        for trial in trials:
            self.cells.setdefault((law, trial), {}).update(cells)
        return self

    def stored(self, folder: Path) -> Path:
        folder.mkdir()
        scenarios = {
            "scene": {
                "folder": "",
                "tables": {"constraints": [{"type": "field-of-view", "K": 0.1}]},
            }
        }
        configuration = {
            "scenarios": scenarios,
            "controllers": self.controllers,
            "trials": self.trials,
        }
        manifest = {"configuration": {**configuration, "seed": self.seed}, **self.manifest}
        (folder / "manifest.json").write_text(json.dumps(manifest))
        lines = []
        for law in self.controllers:
            for trial in range(self.trials):
                line: dict[str, Any] = {
                    name: name in FLAGS or 1.0 + trial for name in result_columns()
                }
                line.update(suite="s", scenario="scene", controller=law, trial=trial)
                line.update(
                    status="converged", reason="", violated="", within_band="", sliding_lost_s=0.0
                )
                if (law, trial) not in self.left_out:
                    lines.append(line | self.cells.get((law, trial), {}))
        write_table(folder / "results.csv", result_columns(), lines)
        write_table(folder / "constraints.csv", constraint_columns(), [])
        return folder


def answer(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["diff", *map(str, arguments)])
    return done.exit_code, done.output


def test_the_same_is_not_different(tmp_path: Path) -> None:
    # a value that exists in neither is the same
    a = Made().set("two", [4], settling_time_s=math.nan).stored(tmp_path / "a")
    # times differ always
    slower = dict.fromkeys(timing_columns(), 100.0)
    b = (
        Made()
        .set("one", range(12), **slower)
        .set("two", [4], settling_time_s=math.nan)
        .stored(tmp_path / "b")
    )
    found = difference(a, b)
    assert not found.worse
    assert not found.found
    assert not found.changes
    code, said = answer(a, b)
    assert code == 0
    assert "All 36 runs in common are identical except for their times." in said
    # 100 against 1 … 12: 100 / 6.5 of both medians, but the median of the ratios is that of 100/6
    # and 100/7
    assert f"{(100 / 6 + 100 / 7) / 2:.1f}" in said


@pytest.mark.parametrize(
    ("cells", "named"),
    [
        ({"violated": "fov[marker 2]"}, r"violated fov\[marker 2\]"),
        ({"status": "trapped"}, "trapped"),
        ({"status": "failed", "reason": "no idea"}, "failed; no idea"),
    ],
)
def test_one_run_that_is_lost_counts_in_a_suite(
    cells: dict[str, Any], named: str, tmp_path: Path
) -> None:
    a = Made().stored(tmp_path / "a")
    b = Made().set("one", [7], **cells).stored(tmp_path / "b")
    code, said = answer(a, b)
    assert code == 1
    assert "scene, 7, one" in said
    assert named in said.replace("\\", "") or named in said
    assert "35 of them are identical" in said
    # the other way round it is a gain, and too few to be significant
    assert answer(b, a)[0] == 0
    # and where only rates count, one of twelve is nothing
    assert answer(a, b, "--rates")[0] == 0


def test_a_violation_counts_where_a_run_converges_in_neither(tmp_path: Path) -> None:
    a = Made().set("one", [3], status="trapped").stored(tmp_path / "a")
    b = (
        Made()
        .set("one", [3], status="trapped", violated="range[joint 1].upper")
        .stored(tmp_path / "b")
    )
    (only,) = difference(a, b).worse
    assert (only.what, only.before, only.after) == ("stays inside", 12, 11)  # type: ignore[union-attr]


def test_rates_are_judged_by_all_runs(tmp_path: Path) -> None:
    a = Made().stored(tmp_path / "a")
    lost = Made().set("one", range(8), status="unfinished").stored(tmp_path / "b")
    found = difference(a, lost, strict=False)
    ((one, p),) = found.found
    # eight of eight to one side, and no other test beside it
    assert p == one.p == pytest.approx(2 / 2**8)
    assert found.worse == [one]


def test_tracking_alone_is_not_judged(tmp_path: Path) -> None:
    a = Made().stored(tmp_path / "a")
    b = Made().set("tracking", range(12), violated="fov[marker 1]").stored(tmp_path / "b")
    found = difference(a, b)
    assert not found.worse
    assert found.pairs.differ.sum() == 12


def test_metrics_are_judged_where_both_converge_inside(tmp_path: Path) -> None:
    before = Made()
    after = Made()
    after.set("one", range(12), jerk_rms=100.0, utilization=0.0)
    # nine pairs are left: one run left the allowed space, one did not converge, one has no value
    before.set("one", [0], violated="fov[marker 1]").set("one", [1], status="trapped")
    after.set("one", [0], violated="fov[marker 1]").set("one", [1], status="trapped")
    after.set("one", [2], jerk_rms=math.nan, utilization=math.nan)
    found = difference(before.stored(tmp_path / "a"), after.stored(tmp_path / "b"), strict=False)
    shifts = {one.metric.column: (one, p) for one, p in found.found}  # type: ignore[union-attr]
    assert shifts.keys() == {"jerk_rms", "utilization"}
    jerk, p = shifts["jerk_rms"]
    assert (jerk.of, jerk.better, jerk.worse) == (9, 0, 9)  # type: ignore[union-attr]
    # from 4 … 12 to 100
    assert sorted(jerk.differences) == [100.0 - before for before in range(12, 3, -1)]  # type: ignore[union-attr]
    # all of nine to one side, and of two tests
    assert jerk.p == pytest.approx(2 / 2**9)
    assert p == pytest.approx(2 * 2 / 2**9)
    # less utilization is worse, too, by 400 to 1200 per cent
    assert {one.metric.column for one in found.worse} == {"jerk_rms", "utilization"}  # type: ignore[union-attr]
    assert shifts["utilization"][0].worse == 9  # type: ignore[union-attr]
    text = verdict(found)
    assert "utilization [%] by −800 (" in text.replace("-", "−")
    assert "worse in 9, better in 0" in text


def test_better_is_not_worse_and_few_are_not_tested(tmp_path: Path) -> None:
    a = Made().stored(tmp_path / "a")
    better = Made().set("two", range(12), settling_time_s=0.1).stored(tmp_path / "b")
    found = difference(a, better)
    assert not found.worse
    assert "Better: **two**: settling time [s]" in verdict(found)
    few = Made().set("two", range(5), settling_time_s=100.0).stored(tmp_path / "few")
    found = difference(a, few)
    ((_, p),) = found.found
    assert p is None
    assert not found.worse
    six = Made().set("two", range(6), settling_time_s=100.0).stored(tmp_path / "six")
    ((_, p),) = difference(a, six).found
    assert p == pytest.approx(2 / 2**6)
    assert difference(a, six).worse


def test_rounding_is_tolerated_and_seen(tmp_path: Path) -> None:
    a = Made().set("one", range(12), jerk_rms=1.0).stored(tmp_path / "a")
    b = Made().set("one", range(12), jerk_rms=1.0 + 5e-7).stored(tmp_path / "b")
    found = difference(a, b)
    assert found.pairs.differ.sum() == 12
    assert not found.found
    assert len(difference(a, b, tolerance=0.0).worse) == 1
    with pytest.raises(ConfigurationError, match="tolerance"):
        difference(a, b, tolerance=math.nan)


def test_only_the_metrics_that_are_asked_for(tmp_path: Path) -> None:
    a = Made().stored(tmp_path / "a")
    b = (
        Made()
        .set("one", range(12), jerk_rms=100.0, final_feature_error_px=99.0)
        .stored(tmp_path / "b")
    )
    assert len(difference(a, b).worse) == 2
    (error,) = difference(a, b, metrics=["final_feature_error_px"]).worse
    assert error.metric.column == "final_feature_error_px"  # type: ignore[union-attr]
    with pytest.raises(ConfigurationError, match=r"unknown metric 'jerk'.*jerk_rms"):
        difference(a, b, metrics=["jerk"])


def test_runs_of_one_side_are_named(tmp_path: Path) -> None:
    a = Made(left_out=(("one", 3),), manifest={"runs": 36, "finished": 35}).stored(tmp_path / "a")
    b = Made(trials=13).stored(tmp_path / "b")
    text = page(difference(a, b))
    assert "35 runs are in both" in text
    assert (
        "4 only in B: scene, 12, tracking; scene, 3, one; scene, 12, one; scene, 12, two." in text
    )
    assert "only in A" not in text
    assert "A is not finished: 35 of 36 runs." in text


def test_a_law_with_another_name(tmp_path: Path) -> None:
    a = Made().stored(tmp_path / "a")
    names = ("tracking", "one", "new")
    b = Made(controllers={law: {"type": "sliding-mode"} for law in names}).set(
        "new", [2], status="trapped"
    )
    folder = b.stored(tmp_path / "b")
    assert answer(a, folder)[0] == 0
    code, said = answer(a, folder, "--rename", "two=new")
    assert code == 1
    assert "only in" not in said
    assert "controllers" not in said
    for wrong, match in (
        ("two", "OLD=NEW"),
        ("three=new", "unknown controller.*'three'"),
        ("two=one", "has a controller of that name"),
    ):
        done = CliRunner().invoke(app, ["diff", str(a), str(folder), "--rename", wrong])
        assert isinstance(done.exception, ConfigurationError)
        assert done.exception.args
        with pytest.raises(ConfigurationError, match=match):
            raise done.exception


def test_what_cannot_be_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    a = Made().stored(tmp_path / "a")
    other = Made(controllers={"three": {"type": "sliding-mode"}}).stored(tmp_path / "b")
    with pytest.raises(ConfigurationError, match="no law and scene in common"):
        difference(a, other)
    with pytest.raises(ConfigurationError, match="their seeds are 0 and 7"):
        difference(a, Made(seed=7).stored(tmp_path / "c"))
    monkeypatch.setattr("sys.argv", ["vsconstraints", "diff", str(a), str(tmp_path / "nowhere")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "holds no comparison" in capsys.readouterr().err
    code, _ = answer(a, a, "--out", tmp_path / "page.md")
    assert code == 0
    assert (tmp_path / "page.md").read_text().startswith("# ")
    with pytest.raises(ConfigurationError, match="cannot be written"):
        raise (
            CliRunner().invoke(app, ["diff", str(a), str(a), "--out", str(a)]).exception
            or AssertionError
        )


def test_changes_are_found_and_those_alike_are_one() -> None:
    scenarios = {
        name: {"folder": "", "tables": {"dt": 0.1, "constraints": [{"K": 1}, {"K": 2}]}}
        for name in "abcd"
    }
    before = {
        "version": "1",
        "git_commit": "aaa",
        "started": "now",
        "command": ["x"],
        "machine": {"cores": 2},
        "packages": {"numpy": "1", "scipy": "1"},
        "configuration": {
            "scenarios": scenarios,
            "controllers": {"one": {"type": "law", "p": 1}, "two": {}},
            "seed": 0,
        },
    }
    after = json.loads(json.dumps(before))
    after.update(version="2", started="then", command=[], wall_time_s=3)
    after["machine"]["cores"] = 4
    after["packages"]["scipy"] = "2"
    for name in "abc":
        after["configuration"]["scenarios"][name]["tables"]["dt"] = 0.2
    after["configuration"]["scenarios"]["d"]["tables"]["constraints"][1]["K"] = 3
    after["configuration"]["controllers"]["one"]["q"] = 5
    del after["configuration"]["controllers"]["two"]
    found = [
        (one.part, one.what, one.names, one.before, one.after) for one in changes(before, after)
    ]
    assert found == [
        ("code", "version", (), "1", "2"),
        ("settings", "scenarios.dt", ("a", "b", "c"), 0.1, 0.2),
        ("settings", "scenarios.constraints.1.K", ("d",), 2, 3),
        ("settings", "controllers.q", ("one",), None, 5),
        ("settings", "controllers", ("two",), {}, None),
        ("packages", "scipy", (), "1", "2"),
        ("machine", "cores", (), 2, 4),
    ]
    assert changes(before, before) == []


def test_real_comparisons(tmp_path: Path) -> None:
    """The same twice; and an arm that is stopped before it arrives, with rows of other gains."""

    def made(name: str, *settings: str) -> Path:
        suite = Suite.load().select(["example-2d-fast"], ["sliding-mode"], settings=settings)
        compare(suite, tmp_path / name, workers=1)
        return tmp_path / name

    before = made("before")
    again = made("again")
    assert answer(before, again)[0] == 0
    assert "are identical" in answer(before, again)[1]
    gains = "scenario.constraints.0.switching_gain=20", "scenario.constraints.0.K=0.3"
    worse = made("worse", "scenario.duration=0.5", *gains)
    changed = [
        (change.what, change.before, change.after) for change in difference(before, worse).changes
    ]
    assert sorted(changed) == [
        ("scenarios.constraints.0.K", 0.2, 0.3),
        ("scenarios.constraints.0.switching_gain", 10.0, 20),
        ("scenarios.duration", 6.0, 0.5),
    ]
    code, said = answer(before, worse)
    assert code == 1
    assert "example-2d-fast, 0, sliding-mode no longer converges: unfinished; still moving" in said
    assert "scenarios.duration" in said
    (line,) = [
        line
        for line in StoredComparison.load(worse).results
        if line["controller"] == "sliding-mode"
    ]
    assert line["status"] == "unfinished"
