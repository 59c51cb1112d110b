"""Which trajectories stay, against a definition by sorting; and what a comparison prints at its
end.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from vsconstraints.cli import results
from vsconstraints.cli import terminal as commands
from vsconstraints.comparisons import keep_trajectories
from vsconstraints.comparisons.metrics import result_columns
from vsconstraints.comparisons.record import run_file
from vsconstraints.comparisons.runs.folder import kept_lines, parse_keep
from vsconstraints.comparisons.tables import read_table, write_table
from vsconstraints.errors import ConfigurationError, StorageError
from vsconstraints.reports.summary import law_table

KINDS = ("scenario", "controller"), ("scenario", "trial")

runs = st.fixed_dictionaries(
    {
        "scenario": st.sampled_from("st"),
        "controller": st.sampled_from("ab"),
        "trial": st.integers(0, 3),
        "status": st.sampled_from(("converged", "failed", "aborted", "trapped")),
        "violation_depth": st.sampled_from((0.0, 0.1, 0.2, math.nan)),
    }
)
tables = st.lists(runs, unique_by=lambda run: (run["scenario"], run["controller"], run["trial"]))


@given(tables)
def test_the_worst_is_the_first_of_the_deepest(lines: list[dict[str, Any]]) -> None:
    kept = kept_lines(lines, "worst", *KINDS)
    for scenario in "st":
        for controller in "ab":
            own = [
                line
                for line in lines
                if (line["scenario"], line["controller"]) == (scenario, controller)
            ]
            outside = [line for line in own if line["violation_depth"] > 0.0]
            # sorting is stable
            expected = sorted(outside, key=lambda line: -line["violation_depth"])[:1]
            assert [line for line in kept if line in own] == expected


@given(tables)
def test_the_other_ways_to_keep(lines: list[dict[str, Any]]) -> None:
    assert kept_lines(lines, "all", *KINDS) == lines
    assert kept_lines(lines, "none", *KINDS) == []
    assert kept_lines(lines, "failed", *KINDS) == [
        line for line in lines if line["status"] in {"failed", "aborted"}
    ]
    for line in lines:
        earlier = any(
            one["scenario"] == line["scenario"] and one["trial"] < line["trial"] for one in lines
        )
        assert (line in kept_lines(lines, "first", *KINDS)) != earlier


def test_a_way_to_keep_that_there_is_not() -> None:
    with pytest.raises(
        ConfigurationError, match=r"--keep 'worse'.*worst.*all, failed, first, none, worst"
    ):
        parse_keep("worse")


def made(folder: Path) -> Path:
    """A comparison's table and files, one of which belongs to no run of it."""
    (folder / "trajectories").mkdir()
    lines = []
    for scenario, controller, trial, status, depth in (
        ("s", "a", 0, "converged", 0.2),
        ("s", "a", 1, "failed", 0.1),
        ("s", "b", 0, "converged", 0.0),
        ("s", "b", 1, "converged", 0.0),
    ):
        line: dict[str, Any] = dict.fromkeys(result_columns(), math.nan)
        line |= {"scenario": scenario, "controller": controller, "trial": trial, "status": status}
        line |= dict.fromkeys(
            ("compiled", *(name for name in result_columns() if name.startswith("is_"))), False
        )
        lines.append(line | {"violation_depth": depth})
        run_file(folder, scenario, controller, trial).touch()
    write_table(folder / "results.csv", result_columns(), lines)
    (folder / "trajectories" / "of-another--c--0.npz").touch()
    return folder


@pytest.mark.parametrize(
    ("keep", "left"),
    [
        ("none", []),
        ("failed", ["s--a--1"]),
        ("worst", ["s--a--0"]),
        ("first", ["s--a--0", "s--b--0"]),
        ("all", ["s--a--0", "s--a--1", "s--b--0", "s--b--1"]),
    ],
)
def test_trajectories_of_other_runs_go(keep: Any, left: list[str], tmp_path: Path) -> None:
    assert keep_trajectories(made(tmp_path), keep) == len(left)
    assert sorted(path.stem for path in (tmp_path / "trajectories").iterdir()) == left


def test_what_an_arm_has_done_stays(tmp_path: Path) -> None:
    lines = read_table(made(tmp_path) / "results.csv", result_columns())
    driven = [
        line | {"reason": "on loopback://; at rest"} if line["trial"] else line for line in lines
    ]
    write_table(tmp_path / "results.csv", result_columns(), driven)
    assert keep_trajectories(tmp_path, "none") == 2
    assert sorted(path.stem for path in (tmp_path / "trajectories").iterdir()) == [
        "s--a--1",
        "s--b--1",
    ]


def test_what_cannot_be_removed_is_an_error(tmp_path: Path) -> None:
    folder = made(tmp_path)
    (folder / "trajectories" / "in-the-way.npz").mkdir()
    with pytest.raises(StorageError, match="in-the-way"):
        keep_trajectories(folder, "none")


@pytest.mark.parametrize("terminal", [True, False])
def test_the_table_of_the_report_is_printed(
    terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The default comparison's, which is kept: bold on a terminal, with stars where nothing can be
    bold.
    """
    from vsconstraints.comparisons import StoredComparison
    from vsconstraints.reports.results import Results

    folder = Path(__file__).parent.parent / "reports" / "default"
    screen = Console(force_terminal=terminal, width=80, markup=False, no_color=True, soft_wrap=True)
    monkeypatch.setattr(commands, "console", screen)
    results.print_laws(folder)
    told = capsys.readouterr().out
    assert "Timings are not ranked; all are of compiled code. In" in told.replace("\n", " ")
    plain = re.sub(r"\x1b\[\d*m", "", told)
    *lines, remark = plain.splitlines()
    assert max(map(len, [*lines, *([remark] if terminal else [])])) <= 80
    for line in law_table(Results(StoredComparison.load(folder))).splitlines()[2:]:
        *cells, implementation = [cell.strip() for cell in line.strip("|").split("|")]
        assert implementation == "compiled"
        (shown,) = (line for line in told.splitlines() if cells[0] in line.split())
        if terminal:
            cells = [cell.replace("**", "\x1b[1m", 1).replace("**", "\x1b[0m") for cell in cells]
        assert shown.split() == " ".join(cells).split()
