"""Reports: every number comes from results.csv, the best is marked, and whatever is missing is
said.
"""

from __future__ import annotations

import csv
import json
import math
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from scenes import of_depth
from vsconstraints.comparisons import RunRecord, StoredComparison, Suite, compare
from vsconstraints.comparisons.metrics import constraint_columns, result_columns
from vsconstraints.comparisons.record import run_file
from vsconstraints.comparisons.runs.files import SUMS
from vsconstraints.comparisons.runs.pool import Failure
from vsconstraints.comparisons.tables import write_table
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports import drawing, report, write_report
from vsconstraints.reports.drawing import acting_in
from vsconstraints.reports.figures import FIGURES
from vsconstraints.reports.groups import MAX_LAWS, grouped
from vsconstraints.reports.markdown import Table, code, plain
from vsconstraints.reports.numbers import error, number, over_trials, percent
from vsconstraints.reports.plots import Figure, looks
from vsconstraints.reports.results import (
    MAX_LANES,
    MAX_PHI,
    Cell,
    Results,
    RowsShown,
    comparable,
    marked,
)
from vsconstraints.reports.scenario import metric_table
from vsconstraints.reports.summary import law_table, score_table

COMPETITORS = ("sliding-mode", "potential-field")


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small comparison with its report, to the end, as utilization needs a goal that is
    reached.
    """
    folder = tmp_path_factory.mktemp("real")
    suite = Suite.load().select(["example-2d-fov"], COMPETITORS)
    compare(suite, folder, workers=1, command=["vsconstraints", "compare"])
    write_report(folder)
    return folder


@pytest.fixture
def copy(real: Path, tmp_path: Path) -> Path:
    """The same comparison, to be damaged, without the checksums that would tell."""
    return shutil.copytree(real, tmp_path / "copy", ignore=shutil.ignore_patterns(SUMS))


def result(
    controller: str, scenario: str = "one", trial: int = 0, **changes: Any
) -> dict[str, Any]:
    """A line of results.csv of a run without fault."""
    line = dict.fromkeys(result_columns(), 1.0)
    line.update(
        suite="made",
        scenario=scenario,
        controller=controller,
        trial=trial,
        status="converged",
        reason="",
    )
    line.update(
        compiled=True, violated="", within_band="", violation_depth=0.0, violation_time_s=0.0
    )
    line.update(utilization=0.9, sliding_lost_s=0.0)
    line.update(changes)
    return line | of_depth(line["violation_depth"], line["violated"]) | changes


@pytest.mark.parametrize(("largest", "remarked"), [(680.0, True), (99.0, False), (400.0, False)])
def test_an_acceleration_out_of_proportion_is_remarked(
    tmp_path: Path, largest: float, remarked: bool
) -> None:
    """From 100 rad/s² on, if it is more than ten times that of any other controller."""
    others = 50.0 if largest == 400.0 else 5.0
    lines = [
        result("tracking", acceleration_max=others, violated="fov[marker 1]", violation_depth=0.1),
        result("sliding-mode", acceleration_max=largest),
        result("hierarchical-qp", acceleration_max=0.5 * others),
    ]
    text = write_report(made(tmp_path, lines), figures=False).read_text(encoding="utf-8")
    sentence = (
        "**Disproportionate command**: sliding-mode commands up to 680 rad/s² of a joint, 136 "
        "times as much"
    )
    assert (sentence in text) == remarked
    assert text.count("Disproportionate command") == remarked


def row(
    controller: str, label: str = "fov[marker 1]", scenario: str = "one", **changes: Any
) -> dict[str, Any]:
    """A line of constraints.csv of a challenged row that is kept."""
    line = dict.fromkeys(constraint_columns(), 1.0)
    line.update(
        suite="made",
        scenario=scenario,
        controller=controller,
        trial=0,
        constraint=label,
        kind="fov",
        unit="px",
    )
    line.update(challenged=True, violation_depth=0.0, violation_time_s=0.0, band_depth=0.0)
    return {**line, **changes}


def made(
    folder: Path,
    results: list[dict[str, Any]],
    rows: list[dict[str, Any]] | None = None,
    tables: dict[str, Any] | None = None,
    trials: int = 1,
) -> Path:
    """A comparison that was never run: tables without trajectories."""
    folder.mkdir(exist_ok=True)
    names = dict.fromkeys(["tracking", *(line["controller"] for line in results)])
    scenarios = dict.fromkeys(line["scenario"] for line in results)
    configuration = {
        "suite": "made",
        "title": "Made up",
        "trials": trials,
        "seed": 0,
        "controllers": {name: {"type": name} for name in names},
        "scenarios": {name: {"folder": ".", "tables": tables or {}} for name in scenarios},
    }
    (folder / "manifest.json").write_text(
        json.dumps({"configuration": configuration}), encoding="utf-8"
    )
    write_table(folder / "results.csv", result_columns(), results)
    write_table(folder / "constraints.csv", constraint_columns(), rows or [])
    return folder


def whole(report: Path) -> str:
    """A report and its details."""
    return "".join(
        path.read_text(encoding="utf-8") for path in (report, report.with_name("details.md"))
    )


def tables_of(text: str) -> list[list[dict[str, str]]]:
    """All tables of a report, each line by column."""
    found = []
    for block in re.findall(r"(?:^\|.*\n?)+", text, flags=re.MULTILINE):
        lines = [
            [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            for line in block.splitlines()
        ]
        found.append([dict(zip(lines[0], line, strict=True)) for line in lines[2:]])
    return found


def column(text: str, header: str, which: int = 0) -> dict[str, str]:
    """A column of the which-th table that has it, by controller."""
    tables = [t for t in tables_of(text) if header in t[0] and "controller" in t[0]]
    return {line["controller"]: line[header] for line in tables[which]}


def value(text: str) -> float:
    """What a printed number stands for."""
    bare = text.strip("*()").replace("−", "-")
    return math.nan if bare == "–" else float(bare)


# the columns of a scenario's tables, and where in results.csv their numbers come from
SOURCES: dict[str, Callable[[dict[str, str]], str | float]] = {
    "settling time [s]": lambda line: line["settling_time_s"],
    "position error [mm]": lambda line: 1e3 * float(line["final_translation_error_m"]),
    "orientation error [mrad]": lambda line: 1e3 * float(line["final_rotation_error_rad"]),
    "image error [px]": lambda line: line["final_feature_error_px"],
    "utilization [%]": lambda line: 100.0 * float(line["utilization"] or "nan"),
    "worst depth [% of L]": lambda line: 100.0 * float(line["violation_depth"]),
    "time outside [s]": lambda line: line["violation_time_s"],
    "φ band": lambda line: line["phi_band"],
    "bound T_s u⁺": lambda line: line["phi_band_bound"],
    "band / bound": lambda line: (
        float(line["phi_band"] or "nan") / float(line["phi_band_bound"] or "nan")
    ),
    "sliding lost [s]": lambda line: line["sliding_lost_s"],
    "switching rate [Hz]": lambda line: line["switching_rate_hz"],
    "acceleration variation [rad/s³]": lambda line: line["acceleration_variation"],
    "RMS jerk [rad/s³]": lambda line: line["jerk_rms"],
    "call, median [µs]": lambda line: line["step_time_median_us"],
    "p99 [µs]": lambda line: line["step_time_p99_us"],
    "max [µs]": lambda line: line["step_time_max_us"],
    "rows and task, median [µs]": lambda line: line["rows_time_median_us"],
    "missed periods": lambda line: line["missed_periods"],
}


def test_every_number_of_a_scenario_is_one_of_results_csv(real: Path) -> None:
    with (real / "results.csv").open(encoding="utf-8", newline="") as file:
        stored = {line["controller"]: line for line in csv.DictReader(file)}
    checked = 0
    _, _, section = whole(real / "report.md").partition("## Scenarios")
    tables = [t for t in tables_of(section) if set(SOURCES) & set(t[0])]
    for line in (line for t in tables for line in t):
        source = stored[line["controller"]]
        for header, text in line.items():
            if header in ("controller", "status", "violated rows"):
                continue
            if header == "implementation":
                assert text == ("compiled" if source["compiled"] == "true" else "uncompiled")
                continue
            raw = SOURCES[header](source)
            expected = float(raw) if raw != "" else math.nan
            if text.strip("*()") == "<0.001":
                assert 0.0 < expected < 1e-3
            elif header == "utilization [%]":
                assert value(text) == pytest.approx(expected, abs=0.00501, nan_ok=True)
            else:
                assert value(text) == pytest.approx(
                    expected, rel=0.00501, abs=1e-12, nan_ok=True
                ), header
            checked += 1
        if "status" in line:
            assert line["status"] == source["status"]
            assert line["violated rows"].replace("`", "") == (
                source["violated"].replace("; ", ", ") or "none"
            )
    assert checked >= 2 * 14 + 5


def test_what_tracking_alone_does_is_a_sentence(real: Path) -> None:
    """It is not compared, and stands in no column with those that are, but for times and challenged
    rows.
    """
    (stored,) = (
        line for line in StoredComparison.load(real).results if line["controller"] == "tracking"
    )
    text = whole(real / "report.md")
    (said,) = re.findall(r"^Unconstrained tracking: (.*)\.$", text, re.M)
    assert said.startswith("converged; violated rows: `fov[marker 2]`; ")
    assert f"; settling time {number(stored['settling_time_s'])} s; " in said
    assert f"; worst depth {number(100.0 * stored['violation_depth'])} % of L; " in said
    assert f"; RMS jerk {number(stored['jerk_rms'])} rad/s³" in said
    judged = [
        t
        for t in tables_of(text)
        if "controller" in t[0] and {"status", "utilization [%]"} & set(t[0])
    ]
    assert judged
    assert not [line for t in judged for line in t if line["controller"] == "tracking"]


def test_challenged_rows_show_clearance_and_margin_of_constraints_csv(real: Path) -> None:
    stored = StoredComparison.load(real)
    lines = next(t for t in tables_of(whole(real / "report.md")) if "challenged rows" in t[0])
    cells = {line["challenged rows"]: line["`fov[marker 2]` [px]"] for line in lines}
    assert list(cells) == ["tracking", *COMPETITORS]
    for name in COMPETITORS:
        (expected,) = (
            r
            for r in stored.constraints
            if r["controller"] == name and r["constraint"] == "fov[marker 2]"
        )
        clearance, margin = (value(part) for part in cells[name].split(" / "))
        assert clearance == pytest.approx(expected["clearance_min"], rel=0.00501)
        assert margin == pytest.approx(expected["mean_unused_margin"], rel=0.00501)
    # the one that leaves least unused, whatever its least clearance; tracking alone has no margin
    # while it is outside
    assert [cells[name].count("**") for name in COMPETITORS] == [2, 0]
    assert value(cells["tracking"]) < 0.0


def summary_of(folder: Path, lines: list[dict[str, Any]]) -> dict[str, dict[str, str]]:
    """What the tables over all scenarios say of each controller; the report is written."""
    text = whole(write_report(made(folder, lines), figures=False))
    endings = text.partition("## All scenarios\n\n")[2].partition("\n\n")[0]
    results = Results(StoredComparison.load(folder))
    found: dict[str, dict[str, str]] = {}
    for lines_of in tables_of("\n\n".join((law_table(results), endings, score_table(results)))):
        for cells in lines_of:
            found.setdefault(cells["controller"], {}).update(cells)
    return {name: line for name, line in found.items() if name != "tracking"}


def test_the_summary_counts_and_averages(tmp_path: Path) -> None:
    lines = [
        result("a", "one", utilization=0.9, acceleration_variation=2.0, step_time_median_us=10.0),
        result(
            "a", "two", utilization=math.nan, acceleration_variation=4.0, step_time_median_us=30.0
        ),
        result(
            "b",
            "one",
            status="trapped",
            violated="fov[marker 1]",
            violation_depth=0.25,
            phi_band=math.nan,
        ),
        result(
            "b",
            "two",
            status="failed",
            reason="it broke",
            utilization=math.nan,
            phi_band=6.0,
            phi_band_bound=2.0,
        ),
    ]
    found = summary_of(tmp_path, lines)
    a = found["a"]
    b = found["b"]
    assert (a["converged"], b["trapped"], b["failed"], b["aborted"]) == ("2", "1", "1", "0")
    assert (a["converged inside"], b["converged inside"]) == ("**2 of 2**", "0 of 2")
    # what a mean rests on, where that is not all runs
    assert a["median utilization [%]"] == "90.00, 1 of 2"
    assert a["acceleration variation [rad/s³]"] == "3.00"
    assert a["median call [µs]"] == "20.0"
    # b converged nowhere: it has no medians, and is not compared
    assert b["worst depth [% of L]"] == "(25.0)"
    assert b["worst φ band / bound"] == "(3.00, 1 of 2)"
    assert b["acceleration variation [rad/s³]"] == b["median utilization [%]"] == "–"
    assert b["runs with a violated row"] == "(1)"


def test_medians_are_compared_over_the_same_runs(tmp_path: Path) -> None:
    """A law that converges in the calm scenario only has the smaller median, and one that violates
    rows, too.

    Since they are smaller, nothing is bold: a reader would see a bold number that is not the best
    of its column.
    """
    lines = [
        *(
            result("whole", name, acceleration_variation=v, utilization=0.9)
            for name, v in (("one", 2.0), ("two", 8.0))
        ),
        result("half", "one", acceleration_variation=1.0, utilization=0.99),
        result(
            "half", "two", status="unfinished", acceleration_variation=0.0, utilization=math.nan
        ),
        result("outside", "one", acceleration_variation=1.0, utilization=1.0),
        result(
            "outside",
            "two",
            acceleration_variation=1.0,
            utilization=1.0,
            violated="x",
            violation_depth=0.1,
        ),
        *(
            result(
                "slight",
                name,
                acceleration_variation=6.0,
                utilization=0.8,
                violated="y",
                violation_depth=5e-3,
                within_band="y",
            )
            for name in ("one", "two")
        ),
    ]
    found = summary_of(tmp_path, lines)
    variation = {name: line["acceleration variation [rad/s³]"] for name, line in found.items()}
    assert variation == {
        "whole": "5.00", "half": "(1.00)", "outside": "(1.00)", "slight": "(6.00)"
    }  # fmt: skip
    used = {name: line["median utilization [%]"] for name, line in found.items()}
    assert used == {"whole": "90.00", "half": "(99.00)", "outside": "(100.00)", "slight": "(80.00)"}
    assert {name: line["within the sampling band"] for name, line in found.items()} == {
        "whole": "0", "half": "0", "outside": "0", "slight": "2"
    }  # fmt: skip
    assert {name: line["runs with a violated row"] for name, line in found.items()} == {
        "whole": "**0**", "half": "(0)", "outside": "1", "slight": "2"
    }  # fmt: skip
    assert {name: line["beyond 1 % of L"] for name, line in found.items()} == {
        "whole": "**0**", "half": "(0)", "outside": "1", "slight": "**0**"
    }  # fmt: skip
    kept = [line for line in lines if line["controller"] in ("whole", "slight")]
    found = summary_of(tmp_path, kept)
    assert [line["acceleration variation [rad/s³]"] for line in found.values()] == [
        "**5.00**",
        "(6.00)",
    ]
    assert [line["median utilization [%]"] for line in found.values()] == ["**90.00**", "(80.00)"]
    assert [line["runs with a violated row"] for line in found.values()] == ["**0**", "2"]
    # what all have alike is nobody's merit
    assert [line["beyond 1 % of L"] for line in found.values()] == ["0", "0"]


def test_diverged_runs_and_lost_sliding_modes_are_never_the_best(tmp_path: Path) -> None:
    lines = [
        result("calm", "one", jerk_rms=887.0, phi_band=1.5, acceleration_variation=417.0),
        result("calm", "two", jerk_rms=887.0, phi_band=1.5, acceleration_variation=417.0),
        result("wild", "one", jerk_rms=1.6e7, phi_band=math.nan, acceleration_variation=1e6),
        result(
            "wild",
            "two",
            jerk_rms=1.0,
            status="unfinished",
            violated="x",
            violation_depth=590.0,
            phi_band=0.1,
        ),
        result(
            "lost",
            "one",
            jerk_rms=900.0,
            phi_band=0.9,
            sliding_lost_s=0.385,
            acceleration_variation=500.0,
        ),
        result(
            "lost",
            "two",
            jerk_rms=900.0,
            phi_band=0.9,
            sliding_lost_s=0.385,
            acceleration_variation=500.0,
        ),
    ]
    found = summary_of(tmp_path, lines)
    assert {name: line["worst φ band / bound"] for name, line in found.items()} == {
        "calm": "1.50", "wild": "(0.100, 1 of 2)", "lost": "(0.900)"
    }  # fmt: skip
    assert found["wild"]["worst depth [% of L]"] == "(59000)"
    assert {name: line["diverged"] for name, line in found.items()} == {
        "calm": "0",
        "wild": "1",
        "lost": "0",
    }
    # of two runs that converged, one of which went wild, no mean and no median of both
    assert found["wild"]["acceleration variation [rad/s³]"] == "(1.00e6)"
    text = whole(tmp_path / "report.md")
    assert column(text, "band / bound") == {"calm": "1.50", "wild": "–", "lost": "(0.900)"}
    assert column(text, "RMS jerk [rad/s³]") == {"calm": "**887**", "wild": "1.60e7", "lost": "900"}
    assert column(text, "RMS jerk [rad/s³]", 1) == {"calm": "887", "wild": "(1.00)", "lost": "900"}


def test_a_frozen_law_is_best_in_nothing(tmp_path: Path) -> None:
    """Also where nobody reaches the goal."""
    frozen = dict.fromkeys(
        (
            "switching_rate_hz",
            "acceleration_variation",
            "jerk_rms",
            "violation_depth",
            "violation_time_s",
        ),
        0.0,
    )
    times = dict.fromkeys(
        ("step_time_median_us", "step_time_p99_us", "missed_periods", "rows_time_median_us"), 0.1
    )
    nothing = {
        "utilization": math.nan,
        "settling_time_s": math.nan,
        "phi_band": math.nan,
        "phi_band_bound": math.nan,
    }
    lines = []
    for scenario, status in (("one", "converged"), ("two", "trapped")):
        lines += [result(name, scenario, status=status) for name in ("tracking", "law", "other")]
        lines.append(result("frozen", scenario, status="trapped", **frozen, **times, **nothing))
    text = whole(write_report(made(tmp_path, lines)))
    own = [line for t in tables_of(text) for line in t if line.get("controller") == "frozen"]
    assert len(own) > 4 + 2 * 4
    assert not any("**" in cell for line in own for cell in line.values())
    assert column(text, "converged inside")["frozen"] == "0 of 2"


def shown_values(line: dict[str, str]) -> dict[str, float]:
    """The number by which each cell is judged, by column, compared or not."""
    cells = {name: re.split(r" / ", text)[-1] for name, text in line.items()}
    cells = {name: re.split(r",| \[| of ", text.strip("*()"))[0] for name, text in cells.items()}
    return {name: value(text) for name, text in cells.items() if re.fullmatch(r"[−\d.e-]+", text)}


MORE = ("converged inside", "at 1 % of L", "utilization [%]", "median utilization [%]")


@settings(max_examples=30, deadline=None)
@given(st.data())
def test_no_bold_value_is_worse_than_another_of_its_column(
    tmp_path_factory: Any, data: Any
) -> None:
    numbers = st.sampled_from([0.0, 0.5, 1.0, 2.0, 1e5, math.nan])
    names = ("utilization", "phi_band", "jerk_rms", "acceleration_variation", "settling_time_s")
    # mostly runs that are compared: where hardly any are, hardly any is bold
    mostly_none = st.sampled_from([0.0, 0.0, 0.0, 0.0, 0.5])
    lines = [
        result(
            controller,
            scenario,
            status=data.draw(
                st.sampled_from(["converged", "converged", "trapped", "failed", "unfinished"])
            ),
            **{name: data.draw(numbers) for name in names},
            **{name: data.draw(mostly_none) for name in ("violation_depth", "sliding_lost_s")},
        )
        for scenario in ("one", "two")
        for controller in ("tracking", "a", "b", "c")
    ]
    rows = [
        row(
            line["controller"],
            label,
            line["scenario"],
            violation_depth=data.draw(st.sampled_from([0.0, 0.0, 1.0])),
            mean_unused_margin=data.draw(numbers),
        )
        for line in lines
        for label in ("x", "y")
    ]
    text = whole(write_report(made(tmp_path_factory.mktemp("any"), lines, rows), figures=False))
    for one in tables_of(text):
        # of tracking alone there is a clearance, and no margin that could be judged
        values = [
            shown_values(line) if line.get("challenged rows") != "tracking" else {} for line in one
        ]
        for line, own in zip(one, values, strict=True):
            for name in (name for name, cell in line.items() if "**" in cell):
                others = [
                    other[name] for other in values if math.isfinite(other.get(name, math.nan))
                ]
                assert own[name] == (max if name in MORE else min)(others), (name, line)
                assert len(set(others)) > 1, (name, line)
            if (
                line.get("controller") == "tracking"
                or line.get("status", "converged") != "converged"
            ):
                assert not any("**" in cell for cell in line.values())


@given(
    st.lists(
        st.tuples(st.sampled_from([0.0, 1.0, 1.0001, 2.0, 1e5, math.nan]), st.booleans()),
        min_size=1,
        max_size=6,
    ),
    st.sampled_from(["less", "more"]),
)
def test_bold_is_beaten_by_nothing_and_beats_something(
    given: list[tuple[float, bool]], better: Any
) -> None:
    texts = marked([Cell.of([v]) for v, _ in given], [may for _, may in given], better)
    values = [value(text) for text in texts if text != "–"]
    for text, (v, may) in zip(texts, given, strict=True):
        assert text.startswith("(") == (not may and math.isfinite(v) and len(given) > 1)
        best = (
            value(text) == (min if better == "less" else max)(values, default=math.nan)
            and len(set(values)) > 1
        )
        assert text.startswith("**") == (may and best)


@pytest.mark.parametrize(
    ("values", "eligible", "better", "expected"),
    [
        ([1.0, 2.0], [True, True], "less", [True, False]),
        ([1.0, 2.0], [True, True], "more", [False, True]),
        ([1.0, 1.0, 2.0], [True, True, True], "less", [True, True, False]),
        ([1.0001, 1.0002, 2.0], [True, True, True], "less", [True, True, False]),
        ([math.nan, 2.0, 3.0], [True, True, True], "less", [False, True, False]),
        # nobody else there, all alike, another one better that is not compared: none is the best
        ([math.nan, 2.0], [True, True], "more", [False, False]),
        ([math.nan, math.nan], [True, True], "less", [False, False]),
        ([2.0, 2.0], [True, True], "less", [False, False]),
        ([2.0, 2.0], [False, True], "less", [False, False]),
        ([1.0, 2.0, 3.0], [False, True, True], "less", [False, False, False]),
        ([2.0, 2.0, 3.0], [False, True, True], "less", [False, True, False]),
        ([3.0, 2.0], [False, True], "less", [False, True]),
        ([1.0, 2.0], [True, True], None, [False, False]),
    ],
)
def test_the_best_is_marked(
    values: list[float], eligible: list[bool], better: Any, expected: list[bool]
) -> None:
    texts = marked([Cell.of([v]) for v in values], eligible, better)
    assert [text.startswith("**") for text in texts] == expected
    aside = [
        better is not None and not may and math.isfinite(v)
        for v, may in zip(values, eligible, strict=True)
    ]
    assert [text.startswith("(") for text in texts] == aside


@pytest.mark.parametrize(
    ("statuses", "expected"),
    [
        ([[], ["converged"], ["trapped"]], [False, True, False]),
        ([["trapped"], ["failed"], ["unfinished"], ["aborted"]], [False, False, False, False]),
        ([["converged", "converged"], ["converged", "failed"]], [True, False]),
        ([["failed"], ["aborted"]], [False, False]),
        ([[], ["converged"]], [False, False]),
    ],
)
def test_only_runs_that_did_the_task_are_compared(
    statuses: list[list[str]], expected: list[bool]
) -> None:
    assert comparable([[{"status": status} for status in own] for own in statuses]) == expected


def test_marks_in_a_report(tmp_path: Path) -> None:
    lines = [
        result(
            "tracking", jerk_rms=0.1, utilization=1.0, violated="fov[marker 1]", violation_depth=0.5
        ),
        result("a", jerk_rms=5.0, utilization=0.95),
        result("b", jerk_rms=5.001, utilization=0.9),
        result("c", jerk_rms=7.0, utilization=1.0, violated="fov[marker 1]", violation_depth=0.1),
        result("d", jerk_rms=math.nan, utilization=math.nan, settling_time_s=math.nan),
        result("e", jerk_rms=8.0, utilization=0.99, status="aborted", reason="rank"),
    ]
    text = whole(write_report(made(tmp_path, lines)))
    assert column(text, "RMS jerk [rad/s³]") == {
        "a": "**5.00**", "b": "**5.00**", "c": "(7.00)", "d": "–", "e": "(8.00)"
    }  # fmt: skip
    # more is better, but not by leaving the allowed space; where that gave more, nothing is bold
    assert column(text, "utilization [%]") == {
        "a": "95.00", "b": "90.00", "c": "(100.00)", "d": "–", "e": "(99.00)"
    }  # fmt: skip
    assert column(text, "Most of the allowed space used [%]") == {"a": "one (95.00)"}
    assert "aborted at 1.00 s" in column(text, "status")["e"]


def test_several_trials_show_median_and_range(tmp_path: Path) -> None:
    lines = [result("a", trial=k, jerk_rms=v) for k, v in enumerate([3.0, 1.0, 2.0])]
    lines += [
        result("b", trial=0, jerk_rms=5.0),
        result("b", trial=1, jerk_rms=5.0, status="trapped"),
    ]
    text = whole(write_report(made(tmp_path, lines, trials=3)))
    assert column(text, "RMS jerk [rad/s³]") == {"a": "**2.00 [1.00–3.00]**", "b": "(5.00)"}
    assert column(text, "status") == {"a": "3 converged", "b": "1 converged, 1 trapped"}
    assert "**Incomplete: 5 of 9 runs finished.**" in text
    assert ["b", "trapped", "–", "–", "–", "1 of 2 (1)"] in [
        list(line.values()) for t in tables_of(text) for line in t
    ]


def test_the_form_that_ran_is_told(tmp_path: Path) -> None:
    def told(*compiled: bool) -> str:
        lines = [
            result(name, compiled=flag)
            for name, flag in zip(("tracking", "own"), compiled, strict=True)
        ]
        text = whole(write_report(made(tmp_path, lines), figures=False))
        found = re.search(r"\| control step +\| (.*?) +\|", text)
        assert found is not None
        return found[1]

    assert told(True, True) == "compiled"
    assert told(False, False) == "uncompiled"
    assert told(True, False) == "compiled in 1 of 2 runs; uncompiled in some of own"


def test_what_is_fair_is_said_of_what_the_comparison_has(tmp_path: Path) -> None:
    """A stack gets no rows, and neither its arm nor a disturbed one integrates exactly."""

    def told(reason: str = "", **tables: Any) -> str:
        lines = [result("tracking"), result("own", reason=reason)]
        return whole(write_report(made(tmp_path, lines, tables=tables), figures=False))

    of_laws = (
        "No controller knows the robot",
        "exact double integration",
        "Every controller, shipped",
    )
    of_stacks = "Stacks (own) get neither rows nor task", "step(now) is timed"
    text = told()
    assert all(words in text for words in of_laws)
    assert not any(words in text for words in of_stacks)
    assert column(text, "required information")["own"] == "see its code"
    text = told("mine uses q, limits and commands velocities", arm={"command": "velocity"})
    assert not any(words in text for words in of_laws)
    assert all(words in text for words in of_stacks)
    assert "except by arms that take velocities or positions" in text
    assert column(text, "required information")["own"] == "q, limits"
    text = told(disturbances={"command_delay": 0.01})
    assert "exact double integration" not in text
    assert "take velocities" not in text


def test_without_challenged_rows_there_is_no_utilization(tmp_path: Path) -> None:
    lines = [result(name, utilization=math.nan) for name in ("tracking", "a", "b")]
    rows = [row(name, challenged=False) for name in ("tracking", "a", "b")]
    text = whole(write_report(made(tmp_path, lines, rows)))
    assert "none is challenged" in text
    assert all("utilization [%]" not in t[0] for t in tables_of(text))
    assert "trade-off" not in text
    text = whole(write_report(made(tmp_path, lines)))
    assert "no constraint rows" in text


def test_what_nobody_challenges_crowns_no_winner(tmp_path: Path) -> None:
    """Two laws with different numbers, in a scenario that tracking alone does as well."""
    lines = [
        result("tracking"),
        result("a", jerk_rms=1.0, switching_rate_hz=1.0),
        result("b", status="trapped"),
    ]
    lines += [result("c", jerk_rms=2.0, switching_rate_hz=2.0, acceleration_variation=9.0)]
    rows = [row(name, challenged=False) for name in ("tracking", "a", "b", "c")]
    calm = whole(write_report(made(tmp_path / "calm", lines, rows), figures=False))
    bold = [cell for t in tables_of(calm) for line in t for cell in line.values() if "**" in cell]
    assert bold == []
    hard = whole(write_report(made(tmp_path / "hard", lines, [row("a")]), figures=False))
    assert any("**" in cell for t in tables_of(hard) for line in t for cell in line.values())


def test_what_only_the_strict_standard_calls_violated_is_marked(tmp_path: Path) -> None:
    band = {"within_band": "speed[joint 2].upper"}
    both = {"violated": "fov[marker 1]; speed[joint 2].upper", "violated_tolerant": "fov[marker 1]"}
    lines = [
        result("tracking"),
        result("a", violated="speed[joint 2].upper", violation_depth=0.01, **band),
        result("b", violation_depth=0.1, **both, **band),
        result("c"),
    ]
    text = whole(write_report(made(tmp_path, lines)))
    assert column(text, "converged inside") == {"c": "1 of 1", "a": "0 of 1", "b": "0 of 1"}
    assert column(text, "at 1 % of L") == {"c": "1", "a": "1", "b": "0"}
    # one line per controller: there are more of them than scenarios
    (endings,) = (t for t in tables_of(text) if "[one](#scenario-one)" in t[0])
    assert {line["controller"]: line["[one](#scenario-one)"] for line in endings} == {
        "tracking": "converged", "a": "converged‡ 1.00", "b": "converged† 10.0", "c": "converged 90.0"
    }  # fmt: skip
    assert column(text, "violated rows") == {
        "a": "`speed[joint 2].upper` ‡",
        "b": "`fov[marker 1]`, `speed[joint 2].upper` ‡",
        "c": "none",
    }


def test_rows_that_held_the_arm_back_are_listed(tmp_path: Path) -> None:
    lines = [result(name) for name in ("tracking", "a", "b")]
    rows = [row(name, usage_held=0.97, held_time_s=1.5) for name in ("a", "b")]
    rows += [
        row("a", "range[joint 1].upper", active_time_s=0.0, usage_held=math.nan, held_time_s=0.0)
    ]
    text = whole(write_report(made(tmp_path, lines, rows)))
    (held,) = (t for t in tables_of(text) if "rows that limited the arm" in t[0])
    cells = {"`fov[marker 1]`": "97.00 / 1.50 s"}
    assert held == [{"rows that limited the arm": name} | cells for name in ("a", "b")]


def test_what_it_takes_to_hold_rows_is_told_where_limits_are_stated(tmp_path: Path) -> None:
    """Rows that fall by themselves, or that no law came to, have no column."""
    lines = [result(name) for name in ("tracking", "a", "b")]
    shares = {
        "tracking": (0.25, math.nan, -0.5),
        "a": (1.5, math.nan, 0.0),
        "b": (math.nan, 0.8, math.nan),
    }
    rows = [
        row(name, f"fov[marker {i + 1}]", share_to_hold=share)
        for name, own in shares.items()
        for i, share in enumerate(own)
    ]
    text = whole(write_report(made(tmp_path, lines, rows, {"limits": {"acceleration": 2.0}})))
    (held,) = (t for t in tables_of(text) if "required acceleration" in t[0])
    expected = {"tracking": ("25.00", "–"), "a": ("150.00", "–"), "b": ("–", "80.00")}
    columns = "required acceleration", "`fov[marker 1]`", "`fov[marker 2]`"
    assert held == [
        dict(zip(columns, (name, *cells), strict=True)) for name, cells in expected.items()
    ]
    assert "limits: acceleration 2.0" in text
    none = [row(name, share_to_hold=math.nan) for name in shares]
    text = whole(write_report(made(tmp_path, lines, none, {"limits": "robot"})))
    assert "| required acceleration" not in text
    assert "limits: those of the robot's actuators" in text


def test_failures_name_row_depth_time_and_reason(tmp_path: Path) -> None:
    lines = [
        result("tracking"),
        result("a", violated="range[joint 6].upper", violation_depth=0.02),
        result("b", status="trapped", reason="at rest, ends 9 mm | away", duration_s=6.0),
    ]
    rows = [
        row("a", "range[joint 6].upper", unit="rad", violation_depth=0.012, violation_time_s=0.5),
        row("b", last_active_s=5.9),
        row("b", "fov[marker 2]", last_active_s=1.0),
    ]
    text = whole(write_report(made(tmp_path, lines, rows)))
    (found,) = (table for table in tables_of(text) if "failure" in table[0])
    assert [list(line.values()) for line in found] == [
        ["a", "violates", "`range[joint 6].upper`", "12.0 mrad", "0.500"],
        [
            "b",
            "trapped",
            r"at rest, ends 9 mm \| away; acting in the last 0.5 s: `fov[marker 1]`",
            "–",
            "–",
        ],
    ]


def test_failed_trials_are_counted_by_kind(tmp_path: Path) -> None:
    """A thousand trials that fail alike are one line, however many rows they leave."""
    times = [0.01 * i for i in range(200)]
    lines = [
        result(
            "a",
            trial=i,
            status="failed",
            reason=f"t = {t:.4g} s: marker {1 + i % 4} is behind the camera",
        )
        for i, t in enumerate(times)
    ]
    lines[7].update(status="trapped", reason="at rest, ends 9 mm from the goal")
    lines[8:] = [
        {**line, "status": "converged", "reason": ""} if i % 2 else line
        for i, line in enumerate(lines[8:])
    ]
    rows = [
        row("a", trial=i, violation_depth=0.01 * i, violation_time_s=0.5 if i < 30 else 0.0)
        for i in range(0, 40, 3)
    ]
    text = whole(write_report(made(tmp_path, lines, rows, trials=200), figures=False))
    (found,) = (table for table in tables_of(text) if "failure" in table[0])
    assert [list(line.values()) for line in found] == [
        ["a", "failed", "t = 0 s: marker 1 is behind the camera", "–", "–", "103 of 200 (0)"],
        ["a", "trapped", "at rest, ends 9 mm from the goal", "–", "–", "1 of 200 (7)"],
        ["a", "violates", "`fov[marker 1]`", "0.390 px", "between samples", "13 of 200 (39)"],
    ]


def test_a_report_without_figures_leaves_figures_alone(copy: Path) -> None:
    drawn = sorted(path.stat().st_mtime_ns for path in (copy / "figures").iterdir())
    told: list[tuple[int, int]] = []
    text = whole(write_report(copy, figures=False, on_drawn=lambda *count: told.append(count)))
    assert not links(text)
    assert "utilization" in text
    assert not told
    assert sorted(path.stat().st_mtime_ns for path in (copy / "figures").iterdir()) == drawn
    write_report(copy, on_drawn=lambda *count: told.append(count))
    assert told == [(0, 2), (1, 2), (2, 2)]  # the scenario's, and the comparison's


def test_names_with_spaces_and_umlauts_have_links(tmp_path: Path) -> None:
    name = "mein Ärmchen"
    lines = [result(controller, scenario=name) for controller in ("tracking", "a")]
    lines.append(result("b", scenario=name, status="trapped"))
    text = whole(write_report(made(tmp_path, lines), figures=False))
    anchors = set(re.findall(r'<a id="([^"]+)">', text))
    assert anchors == {"scenario-mein%20%C3%84rmchen"}
    assert {
        link for link in re.findall(r"\]\(#([^)]+)\)", text) if link.startswith("scenario-")
    } == anchors


def links(text: str) -> set[str]:
    return set(re.findall(r"!\[[^\]]*\]\((figures/[^)]+)\)", text))


def test_figures_are_all_there_and_all_shown(real: Path) -> None:
    text = whole(real / "report.md")
    files = {path.relative_to(real).as_posix() for path in (real / "figures").iterdir()}
    assert links(text) == files
    assert len(files) == 5
    for name in files:
        assert (real / name).stat().st_size < 250_000
        picture = Image.open(real / name)
        assert picture.width == 1200
        assert picture.getcolors(20) is None  # more than an empty frame


def test_a_report_has_no_traces_of_missing_values(real: Path) -> None:
    text = whole(real / "report.md")
    assert not re.search(r"\b(nan|NaN|None|inf)\b", text)
    for anchor in re.findall(r"\]\(#([^)]+)\)", text):
        headings = {
            re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-")
            for h in re.findall(r"^## (.+)$", text, re.M)
        }
        assert anchor in headings or f'<a id="{anchor}">' in text


def test_the_same_comparison_gives_the_same_bytes(copy: Path) -> None:
    first = (copy / "report.md").read_bytes()
    pictures = {path.name: path.read_bytes() for path in (copy / "figures").iterdir()}
    write_report(copy)
    assert (copy / "report.md").read_bytes() == first
    assert {path.name: path.read_bytes() for path in (copy / "figures").iterdir()} == pictures


def test_missing_and_failed_runs_are_said_and_left_out(copy: Path) -> None:
    run_file(copy, "example-2d-fov", "sliding-mode", 0).unlink()
    RunRecord.failed("it broke", "x").save(run_file(copy, "example-2d-fov", "potential-field", 0))
    (copy / "figures" / "gone--phi.png").write_bytes(b"of an earlier report")
    (copy / "figures" / "mine.png").write_bytes(b"not ours")
    text = whole(write_report(copy))
    assert "The trajectory of sliding-mode is missing; the figures leave it out." in text
    assert "The run of potential-field left no trajectory" in text
    assert "figures/example-2d-fov--errors.png" in links(text)
    assert not (copy / "figures" / "gone--phi.png").exists()
    assert (copy / "figures" / "mine.png").exists()


def test_without_any_trajectory_there_are_tables_only(copy: Path) -> None:
    shutil.rmtree(copy / "trajectories")
    text = whole(write_report(copy))
    assert text.count("is missing; the figures leave it out") == 3
    assert links(text) == {"figures/trade-off.png"}
    assert value(column(text, "utilization [%]")["sliding-mode"]) > 98.0


def test_bad_numbers_in_one_run_spoil_nothing(copy: Path) -> None:
    path = run_file(copy, "example-2d-fov", "sliding-mode", 0)
    record = RunRecord.load(path)
    assert record is not None
    record.trajectory.qdd_command[10:] = np.nan
    record.trajectory.phi[20:30] = np.inf
    record.trajectory.camera_error[:] = np.nan
    record.save(path)
    text = whole(write_report(copy))
    assert "could not be drawn" not in text
    assert len(links(text)) == 5


def test_a_scenario_that_cannot_be_built_costs_its_boundaries_only(copy: Path) -> None:
    manifest = json.loads((copy / "manifest.json").read_text(encoding="utf-8"))
    manifest["configuration"]["scenarios"]["example-2d-fov"]["tables"].update(
        robot={"urdf": "lost.urdf"}, title="ü | <b>"
    )
    (copy / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    text = whole(write_report(copy))
    assert "The scenario cannot be built here" in text
    assert r"</a>example-2d-fov: ü \| &lt;b&gt;" in text
    assert len(links(text)) == 5


def test_a_figure_that_fails_costs_itself_only(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise ValueError("on purpose")

    table = tuple(
        replace(figure, draw=fails) if figure.name == "errors" else figure for figure in FIGURES
    )
    monkeypatch.setattr(drawing, "FIGURES", table)
    text = whole(write_report(copy))
    assert "The figure of the errors could not be drawn: ValueError: on purpose" in text
    assert len(links(text)) == 4
    assert not (copy / "figures" / "example-2d-fov--errors.png").exists()


def test_figures_whose_process_dies_cost_themselves_only(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def died(function: object, calls: dict[Any, object], **_: object) -> dict[Any, Failure]:
        return dict.fromkeys(calls, Failure("the process that ran it died"))

    monkeypatch.setattr(drawing, "run_all", died)
    text = whole(write_report(copy))
    assert "The figure of all scenarios could not be drawn: the process that ran it died." in text
    assert "Its figures could not be drawn: the process that ran it died." in text
    assert not links(text)


def test_a_line_in_the_table_is_enough_for_a_figure(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    extra = Figure(
        "mine", "my own", "What is mine.", FIGURES[2].draw, reading="**Mine** is read like this."
    )
    for module in (drawing, report):
        monkeypatch.setattr(module, "FIGURES", (*FIGURES, extra))
    text = whole(write_report(copy))
    assert "![example-2d-fov: mine](figures/example-2d-fov--mine.png)\n\n*What is mine.*" in text
    assert "- **Mine** is read like this." in text
    assert (copy / "figures" / "example-2d-fov--mine.png").exists()


MANY = {
    "tracking": {},
    **{f"field-{k}": {"type": "potential-field"} for k in range(9)},
    "barrier": {"type": "hierarchical-qp"},
    "mine": {"type": "elsewhere:Mine"},
    "active": {"type": "hierarchical-qp", "rows": "active"},
}


def test_many_laws_stand_in_groups_in_their_order() -> None:
    fields = [f"field-{k}" for k in range(9)]
    assert {group.suffix: group.controllers for group in grouped(MANY)} == {
        "--1": ("tracking", *fields[:6]),
        "--2": ("tracking", *fields[6:], "barrier", "mine", "active"),
    }
    (only,) = grouped(dict(list(MANY.items())[: MAX_LAWS + 1]))
    assert only == (("tracking", *fields[:MAX_LAWS]), "")


@settings(max_examples=50, deadline=None)
@given(st.lists(st.sampled_from(["sliding-mode", "hierarchical-qp", "own:Law"]), max_size=40))
def test_groups_are_small_and_their_colours_differ(kinds: list[str]) -> None:
    entries = {"tracking": {}} | {f"{kind}-{k}": {"type": kind} for k, kind in enumerate(kinds)}
    found = grouped(entries)
    assert sorted(name for group in found for name in group.controllers[1:]) == sorted(
        list(entries)[1:]
    )
    for group in found:
        assert group.controllers[0] == "tracking"
        assert len(group.controllers) <= MAX_LAWS + 1
        assert len({look.colour for look in looks(group.controllers).values()}) == len(
            group.controllers
        )


def test_a_report_of_many_laws_has_figures_and_tables_of_few(copy: Path) -> None:
    manifest = json.loads((copy / "manifest.json").read_text(encoding="utf-8"))
    few = dict(manifest["configuration"]["controllers"])
    stored = StoredComparison.load(copy)

    def write(controllers: dict[str, Any], lines: Any, rows: Any) -> str:
        manifest["configuration"]["controllers"] = controllers
        (copy / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
        write_table(copy / "results.csv", result_columns(), lines)
        write_table(copy / "constraints.csv", constraint_columns(), rows)
        return whole(write_report(copy))

    def like(lines: list[dict[str, Any]], name: str) -> list[dict[str, Any]]:
        source = "tracking" if name == "tracking" else "sliding-mode"
        return [{**line, "controller": name} for line in lines if line["controller"] == source]

    for name in list(MANY)[1:]:
        source = run_file(copy, "example-2d-fov", "sliding-mode", 0)
        shutil.copy(source, run_file(copy, "example-2d-fov", name, 0))
    lines = [line for name in MANY for line in like(stored.results, name)]
    rows = [line for name in MANY for line in like(stored.constraints, name)]
    text = write(MANY, lines, rows)
    suffixes = [group.suffix for group in grouped(MANY)]
    drawn = [f"example-2d-fov--{figure.name}" for figure in FIGURES]
    assert links(text) == {
        f"figures/{name}{suffix}.png" for name in ("trade-off", *drawn) for suffix in suffixes
    }
    assert {f"figures/{path.name}" for path in (copy / "figures").iterdir()} == links(text)
    for suffix in suffixes:
        assert text.count(f"(figures/trade-off{suffix}.png)") == 1
    for first in ("controller", "challenged rows", "rows that limited the arm"):
        found = [t for t in tables_of(text) if first in t[0] and len(t) > 5]
        assert found
        for t in (t for t in found if "type" not in t[0]):
            # the same run has the same cells; all are alike, and none is the best
            own = {tuple(list(line.values())[1:]) for line in t if line[first] != "tracking"}
            assert len(own) == 1
            assert "**" not in str(own)
    # a report of few laws leaves none of these figures
    text = write(few, stored.results, stored.constraints)
    assert {f"figures/{path.name}" for path in (copy / "figures").iterdir()} == links(text)
    assert links(text) == {f"figures/{name}.png" for name in ("trade-off", *drawn)}


def test_a_folder_without_a_comparison_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"manifest\.json is missing"):
        write_report(tmp_path)


def test_lanes_are_of_rows_that_act_with_a_law_of_the_figure() -> None:
    """In their order, whatever that of a run is."""

    def run(*acts: bool) -> Any:
        active = np.array([[False] * 3, acts])
        return SimpleNamespace(trajectory=SimpleNamespace(labels=("c", "a", "b"), active=active))

    assert acting_in(("a", "b", "c"), [run(True, False, False), run(False, False, True)]) == (
        "b",
        "c",
    )
    assert acting_in(("a", "b"), [run(True, False, False)]) == ()
    assert acting_in(("a", "b", "c"), []) == ()


def test_figures_keep_the_rows_that_matter_most(tmp_path: Path) -> None:
    labels = [f"range[joint {k}]" for k in range(20)]
    rows = [
        row(name, label, challenged=k in (3, 17), active_time_s=float(k))
        for name in ("tracking", "a")
        for k, label in enumerate(labels)
    ]
    results = Results(
        StoredComparison.load(made(tmp_path, [result("tracking"), result("a")], rows))
    )
    shown = RowsShown.of(results.every_row("one"))
    assert shown == ((labels[3], labels[17]), (labels[3], *labels[9:]), 19 - MAX_LANES)
    unchallenged = [{**line, "challenged": False} for line in rows]
    results = Results(
        StoredComparison.load(made(tmp_path, [result("tracking"), result("a")], unchallenged))
    )
    assert RowsShown.of(results.every_row("one")).phi == tuple(labels[-MAX_PHI:])


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_numbers_keep_three_digits(x: float) -> None:
    assert float(number(x).replace("−", "-")) == pytest.approx(x, rel=0.00501, abs=1e-40)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (number(0.9996), "1.00"),
        (number(-1234.0), "−1230"),
        (number(4.9e-5), "4.90e-5"),
        (number(999999.0), "1.00e6"),
        (number(math.nan), "–"),
        (number(-0.0), "0"),
        (error(4e-7), "<0.001"),
        (error(-4e-7), "−4.00e-7"),
        (error(0.0), "0"),
        (percent(0.99876), "99.88"),
        (over_trials([math.nan, 2.0, 4.0]), "3.00 [2.00–4.00]"),
        (over_trials([2.0, 2.0001]), "2.00"),
        (over_trials([]), "–"),
    ],
)
def test_numbers_as_printed(text: str, expected: str) -> None:
    assert text == expected


def test_tables_are_aligned_and_their_cells_safe() -> None:
    with pytest.raises(ValueError, match="shorter"):
        Table(["name", "q̈ [rad/s²]"], [["a", "1"], ["b"]])
    text = Table(["name", "q̈ [rad/s²]"], [["a|b", "1"], [code("x`y"), "10"]])
    lines = text.splitlines()
    # the accent of q̈ is a character of its own that takes no space
    assert len({len(line.replace("̈", "")) for line in lines}) == 1
    assert lines[2].startswith(r"| a\|b ")
    assert "``x`y``" in lines[3]
    assert plain("a*b_c_ <i>\n[x](y)") == r"a\*b_c\_ &lt;i&gt; \[x\](y)"


def test_times_of_runs_that_left_none_are_no_table() -> None:
    """As where a full disk keeps every run from being stored."""
    line = dict.fromkeys(result_columns(), math.nan) | {
        "status": "failed",
        "reason": "no space",
        "violated": "",
    }
    results: Any = SimpleNamespace(
        controllers=("tracking",),
        competitors=("tracking",),
        runs=lambda scenario, name: [line],
        implementation=lambda name, scenario: "",
        is_ranked=lambda scenario: False,
    )
    assert not metric_table(results, "short", "time")
    assert metric_table(results, "short", "outcome")
