"""Reports of many scenarios and laws: tables that fit a page, a heat map, and figures of the most
telling scenarios.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from documents import ROOT
from test_reports import made, result, row, whole
from vsconstraints.comparisons import StoredComparison
from vsconstraints.reports import report, write_report
from vsconstraints.reports.drawing import MAX_FIGURES, MAX_SCENARIOS, Drawn, shown_scenarios
from vsconstraints.reports.figures import FIGURES
from vsconstraints.reports.markdown import MAX_COLUMNS, Table
from vsconstraints.reports.results import Results

PAGE = 1012
"""Width of a page on GitHub [px]."""

LAWS = list(
    tomllib.loads((ROOT / "comparisons" / "laws.toml").read_text(encoding="utf-8"))["controllers"]
)
SCENARIOS = (
    "example-2d-heart-concave",
    "case-study-6r",
    "panda-fov",
    "ur5-fov",
    "example-2d-fast-high-gain",
    "example",
)
ROWS = (
    "occlusion[heart, marker 1]",
    "range[joint 6].upper",
    "fov[marker 2]",
    "sphere[tip]",
    "speed[joint 3].lower",
)


def large(folder: Path, trials: int = 1) -> Path:
    """All laws of the field, six scenarios and five rows; long numbers, and every ending
    somewhere.
    """
    endings = cycle(
        ["converged", "trapped", "converged", "unfinished", "failed", "aborted", "converged"]
    )
    values = cycle([-0.000123456, 98765.4321, 12.3456789])
    lines = [
        result(law, scenario, trial, status=next(endings), jerk_rms=next(values), acceleration_variation=next(values),
               violated="; ".join(ROWS), within_band="; ".join(ROWS), violation_depth=0.123)
        for law in LAWS for scenario in SCENARIOS for trial in range(trials)
    ]  # fmt: skip
    rows = [
        row(law, label, scenario, trial=trial, clearance_min=next(values), mean_unused_margin=next(values))
        for law in LAWS for scenario in SCENARIOS for label in ROWS for trial in range(trials)
    ]  # fmt: skip
    return made(folder, lines, rows, trials=trials)


def letters_width(word: str) -> float:
    """At 8.6 px a letter, and 4 px an i or l."""
    return 8.6 * len(word) - 4.6 * len(re.findall("[il]", word))


def page_width(block: str) -> float:
    """How wide a browser makes a table at least [px]: what stands together in each column."""
    lines = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in block.splitlines()
    ]
    del lines[1]
    shown = [[re.sub(r"\]\(.*?\)|[*`]", "", cell) for cell in line] for line in lines]
    return sum(
        27.0
        + max(
            letters_width(word)
            for cell in cells
            for word in re.split(r" |(?<=[a-z]-)(?=[a-z])", cell)
        )
        for cells in zip(*shown, strict=True)
    )


@pytest.mark.parametrize("trials", [1, 3])
def test_no_table_of_many_laws_scrolls_sideways(tmp_path: Path, trials: int) -> None:
    text = whole(write_report(large(tmp_path, trials), figures=False))
    blocks = re.findall(r"(?:^\|.*\n?)+", text, flags=re.MULTILINE)
    assert len(blocks) > 5 * len(SCENARIOS)
    assert max(map(page_width, blocks)) <= PAGE
    # and every law is in each of them that is about laws
    for block in blocks:
        of_some = "failure" in block or "violates a row" in block
        if block.startswith(("| controller", "| challenged")) and not of_some:
            assert block.count("\n") >= 2 + len(LAWS) - 1


def test_the_committed_suites_name_no_paper_where_there_is_none(tmp_path: Path) -> None:
    text = write_report(large(tmp_path), figures=False).read_text(encoding="utf-8")
    assert text.startswith("# Made up\n")
    opening = text.partition("## Outcomes")[0]
    assert f"{len(LAWS) - 1} controllers" in opening
    assert all(law in opening for law in LAWS)
    assert "paper" not in opening


@given(st.integers(1, 40))
def test_a_wide_table_is_cut_between_columns(count: int) -> None:
    header = ["first", *(f"h{k}" for k in range(count))]
    line = ["name", *(f"x{k}" for k in range(count))]
    blocks = Table(header, [line]).split("\n\n")
    cells = [
        [[c.strip() for c in row.split("|")[1:-1]] for row in block.splitlines()]
        for block in blocks
    ]
    assert [c for head, _, _ in cells for c in head[1:]] == header[1:]
    assert [c for _, _, body in cells for c in body[1:]] == line[1:]
    assert all(head[0] == "first" and body[0] == "name" for head, _, body in cells)
    widths = [len(head) for head, _, _ in cells]
    assert max(widths) <= MAX_COLUMNS
    assert max(widths) - min(widths) <= 1
    assert len(blocks) == math.ceil(count / (MAX_COLUMNS - 1))


def results_of(folder: Path, lines: list[dict[str, Any]]) -> Results:
    return Results(StoredComparison.load(made(folder, lines)))


def test_the_most_telling_scenarios_are_those_that_divide_laws(tmp_path: Path) -> None:
    """Of thirteen scenarios: one halves four laws, two part one from three, all others are kept by
    all or by none.
    """
    few = {"half": 2, "one of four": 1, "three of four": 3}
    lines = []
    for name in [*few, *(f"s{k}" for k in range(10))]:
        good = few.get(name, 4 * (name < "s5"))
        lines += [result(f"law {k}", name, **({} if k < good else {"violated": "x", "violation_depth": 0.1}))
                  for k in range(4)]  # fmt: skip
    results = results_of(tmp_path, lines)
    assert len(results.scenarios) * len(FIGURES) > MAX_FIGURES
    assert set(shown_scenarios(results)) == set(few)
    assert len(few) == MAX_SCENARIOS
    small = results_of(tmp_path, [line for line in lines if line["scenario"] != "s9"])
    assert shown_scenarios(small) == small.scenarios


def test_only_the_most_telling_scenarios_are_drawn_unless_all_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[str] = []

    def draw_all(
        results: Results, scenarios: Sequence[str], *given: Any
    ) -> tuple[str, dict[str, Drawn]]:
        drawn[:] = scenarios
        return "![Trade-off](figures/trade-off.png)", {name: Drawn() for name in drawn}

    monkeypatch.setattr(report, "draw_all", draw_all)
    text = whole(write_report(large(tmp_path)))
    assert len(drawn) == MAX_SCENARIOS
    assert (
        text.count("Its figures: `vsconstraints report FOLDER --all-figures`.")
        == len(SCENARIOS) - MAX_SCENARIOS
    )
    assert re.findall(r"\(figures/([^)]+)\)", text) == ["trade-off.png"]
    assert (
        text.index("| controller") < text.index("## Outcomes") < text.index("figures/trade-off.png")
    )
    text = whole(write_report(tmp_path, all_figures=True))
    assert drawn == list(SCENARIOS)
    assert "Its figures:" not in text
