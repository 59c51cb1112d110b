"""``vsconstraints evidence`` and ``merge``: what they say, and how they end."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from campaigns import assert_same, campaign, tables
from documents import ROOT
from test_evidence import here
from vsconstraints.bench.evidence import Campaign, parquet
from vsconstraints.bench.evidence.parquet import Column
from vsconstraints.bench.families import Family, families
from vsconstraints.cli import app
from vsconstraints.comparisons import Suite
from vsconstraints.errors import ConfigurationError


@pytest.fixture(autouse=True)
def _here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("vsconstraints.bench.evidence.processes", lambda asked: here)
    # reports have tests of their own
    written = "vsconstraints.bench.commands.campaigns.write_report"
    monkeypatch.setattr(written, lambda folder, wanted: f"Report: {folder / 'report.md'}")
    monkeypatch.chdir(tmp_path)


def say(*words: str) -> Result:
    return CliRunner().invoke(
        app, [*words, *(["--no-figures"] if words[0] in ("evidence", "merge") else [])]
    )


def test_a_campaign_in_parts_and_whole(tmp_path: Path) -> None:
    campaign(tmp_path)
    for i in (1, 2):
        done = say(
            "evidence", "small.toml", "--scenes", "2", "--shard", f"{i}/2", "--out", f"part-{i}"
        )
        assert done.exit_code == 0, done.output
        assert "1 scenes, 6 runs in" in done.output
        assert "runs a second" in done.output
        assert "Report" not in done.output
    assert say("merge", "whole", "part-1", "part-2").exit_code == 0
    again = say("evidence", "small.toml", "--scenes", "2", "--out", "whole")
    assert again.exit_code == 0
    assert "2 of 2 scenes were stored" in again.output
    alone = say("evidence", "small.toml", "--scenes", "2", "--out", "alone")
    assert "Report: alone/report.md" in alone.output
    assert_same(tables(tmp_path / "alone"), tables(tmp_path / "whole"))


def test_a_report_whose_runs_are_gone_is_left_as_it_is(tmp_path: Path) -> None:
    kept = ROOT / "reports" / "evidence"
    shutil.copytree(kept, tmp_path / "kept")
    refused = say("report", "kept")
    assert isinstance(refused.exception, ConfigurationError)
    runs = json.loads((kept / "manifest.json").read_text())["runs"]
    assert f"kept has none of the {runs} runs that its report was made from" in str(
        refused.exception
    )
    for name in ("report.md", "claims.json"):
        assert (tmp_path / "kept" / name).read_bytes() == (kept / name).read_bytes()


def test_a_law_that_fails_everywhere(tmp_path: Path) -> None:
    campaign(tmp_path, '[controllers.odd]\ntype = "odd:Bad"\nabove = -1e9\n')
    done = say("evidence", "small.toml", "--scenes", "1", "--controller", "odd")
    assert done.exit_code == 1
    assert "quick · nominal · odd: 1 of 1 runs failed, " in done.output
    assert "no idea" in done.output
    assert (tables(tmp_path / "vsconstraints-evidence")["runs"]["status"] == "failed").sum() == 2


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--shard", "3/2"], "--shard must be i/n"),
        (["--keep", "some"], "unknown --keep 'some'"),
        (["--scenes", "0"], "scenes must be from 1"),
        (["--family", "planar"], "unknown family 'planar'"),
    ],
)
def test_nonsense(words: list[str], what: str, tmp_path: Path) -> None:
    campaign(tmp_path)
    refused = say("evidence", "small.toml", *words)
    assert isinstance(refused.exception, ConfigurationError)
    assert what in str(refused.exception)
    assert not list(tmp_path.rglob("*.parquet"))


def test_a_comparison_leaves_evidence_alone(tmp_path: Path) -> None:
    campaign(tmp_path)
    say("evidence", "small.toml", "--scenes", "1", "--out", "out")
    refused = say(
        "compare", "--scenario", "example-2d-fov", "--controller", "tracking", "--out", "out"
    )
    assert "holds evidence, not a comparison" in str(refused.exception)


def test_without_a_file_all_families_meet_the_laws_of_the_default_comparison() -> None:
    default = Campaign.load()
    shipped = Campaign.load(ROOT / "comparisons" / "evidence.toml")
    laws = [
        [(entry.name, entry.law, entry.options) for entry in each.controllers]
        for each in (default, Suite.load())
    ]
    assert laws[0] == laws[1]
    # ladders are for test sets: one answer over all families has not their twenty conditions in it
    assert {family.name for family in default.families} == {
        name for name in families() if "ladder" not in name
    }
    assert default.question.endswith("best?")
    # read by its path, it is the same
    assert default.resolved() == shipped.resolved()


def test_the_real_world_is_a_study_of_the_same_laws(monkeypatch: pytest.MonkeyPatch) -> None:
    real = Campaign.load("real-world")
    default = Campaign.load()
    laws = [
        [(entry.name, entry.options) for entry in campaign.controllers]
        for campaign in (real, default)
    ]
    assert laws[0] == [*laws[1], ("robust-predictive", {})]
    assert [family.name for family in real.families] == ["ur5", "panda"]
    assert real.conditions[0] == "nominal"
    # folders within the package are told as seen from the shipped families
    assert {entry["folder"] for entry in real.resolved()["families"].values()} == {"real-world"}
    asked: list[tuple[Path, Path]] = []
    monkeypatch.setattr(
        "vsconstraints.paper.commands.evidence", lambda file, out, **_: asked.append((file, out))
    )
    assert say("study", "real-world", "--out", "all").exit_code == 0
    assert asked == [(Path("real-world"), Path("all/real-world"))]
    refused = say("study", "real-wold")
    assert "Did you mean 'real-world'" in str(refused.exception)


def test_scenes_of_the_real_world_are_those_of_the_families_they_are_of() -> None:
    for family in Campaign.load("real-world").families:
        scene = family.scene(3)
        same = Family.load(family.name).scene(3)
        assert scene.values["q0"] == same.values["q0"]
        assert scene.challenged == same.challenged
        assert scene.scenario("calibrated").tables["disturbances"]["mount_rotation_error"] != [
            0.0,
            0.0,
            0.0,
        ]
        assert scene.scenario("dynamics").tables["plant"]["type"] == "dynamics"


def test_a_condition_can_be_run_in_the_first_scenes_alone(tmp_path: Path) -> None:
    campaign(tmp_path)
    assert (
        say(
            "evidence",
            "small.toml",
            "--scenes",
            "3",
            "--set",
            "scenes_in.limited=1",
            "--out",
            "out",
        ).exit_code
        == 0
    )
    runs = tables(tmp_path / "out")["runs"]
    assert {name: set(own["scene"]) for name, own in runs.groupby("condition", observed=True)} == {
        "nominal": {0, 1, 2},
        "limited": {0},
    }
    assert len(runs) == 12
    more = say(
        "evidence", "small.toml", "--scenes", "4", "--set", "scenes_in.limited=1", "--out", "out"
    )
    assert "3 of 4 scenes were stored" in more.output
    other = say(
        "evidence", "small.toml", "--scenes", "4", "--set", "scenes_in.limited=2", "--out", "out"
    )
    assert "scenes_in.limited is 1 there and 2 here" in str(other.exception)
    for setting, what in (
        ("scenes_in.limted=1", "unknown condition 'limted'"),
        ("scenes_in.limited=-1", "0 or more"),
    ):
        assert what in str(say("evidence", "small.toml", "--set", setting).exception)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.fixed_dictionaries(
            {
                "t": st.text(),
                "f": st.booleans(),
                "w": st.integers(-(2**53), 2**53),
                "n": st.floats(),
            }
        ),
        max_size=5,
    )
)
def test_tables_are_read_as_they_were_written(lines: list[dict[str, object]]) -> None:
    columns = (
        Column("t", "text"),
        Column("f", "flag"),
        Column("w", "whole"),
        Column("n", "number"),
    )
    found = parquet.table(columns, lines).to_pylist()
    for line, told in zip(lines, found, strict=True):
        assert told["t"] == str(line["t"]).encode("utf-8", "backslashreplace").decode()
        assert (told["f"], told["w"]) == (line["f"], line["w"])
        number = float(str(line["n"]))
        assert told["n"] == (number if abs(number) < float("inf") else None)
