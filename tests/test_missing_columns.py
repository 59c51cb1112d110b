"""Tables that lack columns, as those of earlier versions do: what is there is read as before."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from test_own_files import here
from vsconstraints.bench.advice import advise
from vsconstraints.bench.evidence import Evidence, parquet
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.bench.repetition import Repetition, drawn_lines, repeat
from vsconstraints.bench.reports import write_evidence_report
from vsconstraints.bench.reports.leaderboard import leaderboard
from vsconstraints.bench.study import COLUMNS, SHIPPED, Situation, Study
from vsconstraints.cli import app
from vsconstraints.comparisons.metrics import REQUIRED_COLUMNS
from vsconstraints.comparisons.runs.files import SUMS
from vsconstraints.comparisons.stored import TABLES as CSV_TABLES
from vsconstraints.comparisons.stored import StoredComparison
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports.report import write_report

REPORTS = Path(__file__).parents[1] / "reports"


def without_optional_columns(path: Path, columns: tuple[parquet.Column, ...], to: Path) -> None:
    table = parquet.read([path], columns)
    optional = [column.name for column in columns if not column.required]
    parquet.write(to, table.drop_columns(optional), parquet.facts_of(path))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two shards of a kept campaign, whole and without optional columns."""
    whole = tmp_path_factory.mktemp("whole")
    for table in parquet.tables():
        (whole / table).mkdir()
        for path in sorted((REPORTS / "real-world" / table).glob("part-*-0000000-*.parquet")):
            shutil.copy(path, whole / table)
    shutil.copy(REPORTS / "real-world" / "manifest.json", whole)
    reduced = tmp_path_factory.mktemp("reduced")
    shutil.copytree(whole, reduced, dirs_exist_ok=True)
    for name, columns in parquet.tables().items():
        for path in (reduced / name).iterdir():
            without_optional_columns(path, columns, path)
    return whole, reduced


def test_a_campaign_is_read_and_reported(campaign: tuple[Path, Path]) -> None:
    whole, reduced = map(Evidence.load, campaign)
    for name, columns in parquet.tables().items():
        before, after = getattr(whole, name), getattr(reduced, name)
        assert list(after.columns) == list(before.columns)
        for column in columns:
            if column.required:
                assert after[column.name].equals(before[column.name])
            else:
                assert (after[column.name].isna() | (after[column.name] == "")).all()
    report = write_evidence_report(reduced.folder, figures=False)
    assert "hierarchical-qp" in report.read_text(encoding="utf-8")


def test_a_damaged_name_of_a_column_is_no_missing_column(
    campaign: tuple[Path, Path], tmp_path: Path
) -> None:
    """Of Parquet as of CSV: beside an unknown column, none may be missing."""
    whole, _ = campaign
    path = next((whole / "runs").iterdir())
    columns = parquet.tables()["runs"]
    table = parquet.read([path], columns)
    names = [name.replace("utilization", "utilizatiom") for name in table.column_names]
    parquet.write(tmp_path / "damaged.parquet", table.rename_columns(names), {})
    told = "it has no column 'utilization', but 'utilizatiom', which is a damaged name"
    with pytest.raises(ConfigurationError, match=told):
        parquet.read([tmp_path / "damaged.parquet"], columns)
    twice = table.append_column("status", table["status"])
    parquet.write(tmp_path / "twice.parquet", twice, {})
    with pytest.raises(ConfigurationError, match="it has no column 'status', or more than one"):
        parquet.read([tmp_path / "twice.parquet"], columns)


def test_a_comparison_is_read_and_reported(tmp_path: Path) -> None:
    shutil.copytree(REPORTS / "default", tmp_path, dirs_exist_ok=True)
    (tmp_path / SUMS).unlink()
    for name in CSV_TABLES:
        with (tmp_path / name).open(newline="", encoding="utf-8") as file:
            lines = list(csv.DictReader(file))
        required = [column for column in lines[0] if column in REQUIRED_COLUMNS]
        with (tmp_path / name).open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, required, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(lines)
    before, after = map(StoredComparison.load, (REPORTS / "default", tmp_path))
    kept = ("scenario", "controller", "status", "violated")
    assert [[line[name] for name in kept] for line in after.results] == [
        [line[name] for name in kept] for line in before.results
    ]
    assert all(line["reason"] == "" != line["status"] for line in after.results)
    assert all(line["utilization"] != line["utilization"] for line in after.constraints)
    assert "hierarchical-qp" in write_report(tmp_path, figures=False).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """The package's study without optional columns."""
    path = tmp_path_factory.mktemp("study") / "study.parquet"
    without_optional_columns(SHIPPED, COLUMNS, path)
    return Study.load(path)


def test_a_leaderboard_lacks_only_the_times_of_calls(study: Study) -> None:
    """The table without them is marked, and what it lacks is named below the leaderboard."""
    whole = leaderboard({"a": Study.load()}, TestSet.load()).splitlines()
    *reduced, empty, note = leaderboard({"a": study}, TestSet.load()).splitlines()
    assert len(reduced) == len(whole)
    for before, after in zip(whole[2:], reduced[2:], strict=True):
        expected = [cell.strip() for cell in before.split("|")]
        expected[2] += " †"
        expected[-2] = "–"
        assert [cell.strip() for cell in after.split("|")] == expected
    names = "call_us, settling_time_s, utilization, acceleration_variation"
    assert (empty, note) == (
        "",
        f"† The table of a has no values of {names}: they are neither shown nor compared with repeated runs.",
    )


def test_a_missing_column_is_not_repeated_which_the_result_says(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    (line,) = drawn_lines(study, 1e-9, 0)
    assert "settling_time_s" not in line
    assert {"status", "violated", "violation_fraction"} <= line.keys()
    monkeypatch.setattr("vsconstraints.bench.repetition.repeat_run", lambda *run: ([], False))
    families = {family.name: family for family in TestSet.load().families}
    found = repeat(study, families, 1e-9, 0, workers=here)
    assert found.not_compared == ("settling_time_s", "utilization", "acceleration_variation")
    assert repeat(Study.load(), families, 1e-9, 0, workers=here).not_compared == ()


def test_a_column_that_only_runs_of_moved_laws_have_is_not_compared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = Study.load()
    moved = "sliding-mode"
    monkeypatch.setattr(
        "vsconstraints.bench.repetition.moved_laws", lambda study: {moved: "moved.py:Moved"}
    )
    monkeypatch.setattr("vsconstraints.bench.repetition.repeat_run", lambda *run: ([], False))
    runs = whole.runs.copy()
    runs.loc[runs["controller"] != moved, "utilization"] = float("nan")
    assert runs["utilization"].notna().any()
    families = {family.name: family for family in TestSet.load().families}
    found = repeat(replace(whole, runs=runs), families, 1e-9, 0, workers=here)
    assert found.not_compared == ("utilization",)


def test_the_command_names_columns_that_are_not_compared(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study.keep(tmp_path / "mine.parquet")
    assert Study.load(tmp_path / "mine.parquet").runs["unknown_motion"].isna().all()
    nothing = Repetition(1, (), (), not_compared=("utilization",))
    monkeypatch.setattr("vsconstraints.bench.repetition.repeat", lambda *a, **b: nothing)
    command = ["testset", "leaderboard", str(tmp_path / "mine.parquet"), "--rerun", "0.1"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    words = " ".join(done.stderr.split())
    assert (
        "warning: mine: not compared, since no run that can be repeated has a value of them: "
        "utilization" in words
    )


def test_advice_names_the_missing_column(study: Study) -> None:
    advice = advise(study, Situation(joints=6))
    assert "the study has no joints" in advice.unlike
    assert len(advice.laws) == len(study.laws)
