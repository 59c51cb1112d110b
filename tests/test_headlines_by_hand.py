"""The answer, the tables over all scenarios and what is marked best, of made-up results worked out
by hand.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

from test_reports import result, row
from vsconstraints.comparisons import StoredComparison
from vsconstraints.comparisons.metrics import Metric, run_metrics
from vsconstraints.reports.drawing import Drawn
from vsconstraints.reports.markdown import first_names
from vsconstraints.reports.report import report_text
from vsconstraints.reports.results import Cell, Results, comparable, judged_by, marked
from vsconstraints.reports.scenario import metric_table
from vsconstraints.reports.summary import (
    law_table,
    score_table,
    unsolved,
)
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation.start import UNSOLVABLE

USED = "Most of the allowed space used [%]"
CALM = "Least chattering (acceleration variation) [rad/s³]"


def results_of(
    lines: list[dict[str, Any]],
    rows: list[dict[str, Any]] | None = None,
    trials: int = 1,
    controllers: tuple[str, ...] = (),
    **configuration: str,
) -> Results:
    """Of runs that were never made, and of controllers that were never run."""
    names = dict.fromkeys(["tracking", *(line["controller"] for line in lines), *controllers])
    chosen = {
        "trials": trials,
        "controllers": {name: {"type": name} for name in names},
        "scenarios": {line["scenario"]: {"folder": ".", "tables": {}} for line in lines},
        **configuration,
    }
    stored = StoredComparison(Path(), {"configuration": chosen})
    vars(stored).update(results=lines, constraints=rows or [])
    return Results(stored)


def text_of(results: Results) -> str:
    """The report."""
    return report_text(results, {name: Drawn() for name in results.scenarios})


def table_below(results: Results, words: str) -> str:
    """The table of the report that stands below some words, empty if they are not there."""
    return text_of(results).partition(f"{words}\n\n")[2].partition("\n\n")[0]


def endings_table(results: Results) -> str:
    return table_below(results, "## All scenarios")


def violation_table(results: Results) -> str:
    return table_below(results, "\nViolations:")


def winner_table(results: Results) -> str:
    return table_below(results, "Best of the controllers that converged and violated no row:")


# --- the answer ---


def test_the_title_is_that_of_the_configuration_or_else_the_suites_name() -> None:
    lines = [result("tracking"), result("a")]
    assert text_of(results_of(lines, title="Title", suite="suite")).startswith("# Title\n")
    assert text_of(results_of(lines, suite="suite")).startswith("# suite\n")
    assert text_of(results_of(lines)).startswith("# Comparison\n")


def test_what_was_run_is_counted_and_what_is_missing_is_said() -> None:
    whole = text_of(results_of([result("tracking"), result("a")]))
    assert " Compared: 1 controller, in 1 scenario.\n" in whole
    assert "Incomplete" not in whole
    part = text_of(results_of([result("tracking"), result("a"), result("b", "two", 1)], trials=2))
    assert " Compared: 2 controllers, in 2 scenarios, 2 trials each.\n" in part
    assert "\n\n**Incomplete: 3 of 12 runs finished.**" in part


OUT = {"violated": "x", "violation_depth": 0.5}


def test_the_answer_ranks_by_runs_that_converged_inside() -> None:
    """Of three runs each: one law has 3, two have 2, one has none; of one there are two runs
    only.
    """
    lines = [
        *(result("tracking", name, **OUT) for name in ("one", "two")),
        result("tracking", "three"),
        *(
            result("some", name, **changes)
            for name, changes in (("one", {}), ("two", {}), ("three", OUT))
        ),
        *(result("all", name) for name in ("one", "two", "three")),
        *(result("none", name, status="trapped") for name in ("one", "two", "three")),
        *(
            result("like", name, **changes)
            for name, changes in (("one", OUT), ("two", {}), ("three", {}))
        ),
        *(
            result("few", name, compiled=False, step_time_median_us=us)
            for name, us in (("one", 500.0), ("two", 400.0))
        ),
    ]
    results = results_of(lines)
    assert "violates a constraint in 2 of 3 runs." in text_of(results)
    assert "\nMost often converged without violating a constraint: **all**.\n" in text_of(results)
    inside = {name: line["converged inside"] for name, line in cells_of(law_table(results)).items()}
    assert list(inside.items()) == [
        ("all", "**3 of 3**"), ("some", "2 of 3"), ("like", "2 of 3"), ("few", "2 of 2"), ("none", "0 of 3")
    ]  # fmt: skip


SLIGHT = {"violated": "x", "violation_depth": 0.005}


def test_the_two_standards_stand_side_by_side() -> None:
    """One law is outside by 0.5 % of L twice, one by 1.5 % once, and one converges once: 1, 2, 1
    and 3, 2, 1.
    """
    lines = [result("tracking", name, **OUT) for name in ("one", "two", "three")]
    lines += [
        result("over", name, **changes)
        for name, changes in (("one", {}), ("two", SLIGHT), ("three", SLIGHT))
    ]
    deeper = {"violated": "x; y", "violation_depth": 0.015, "violated_tolerant": "y"}
    lines += [
        result("kept", name, **changes)
        for name, changes in (("one", {}), ("two", {}), ("three", deeper))
    ]
    lines += [result("slow", name, status="unfinished") for name in ("one", "two")] + [
        result("slow", "three")
    ]
    results = results_of(lines)
    assert (results.clean, results.clean_tolerant) == (
        {"over": 1, "kept": 2, "slow": 1},
        {"over": 3, "kept": 2, "slow": 1},
    )
    found = cells_of(law_table(results))
    assert {name: (line["converged inside"], line["at 1 % of L"]) for name, line in found.items()} == {
        "kept": ("**2 of 3**", "2"), "over": ("1 of 3", "**3**"), "slow": ("1 of 3", "1")
    }  # fmt: skip
    curve = table_below(results, "by more than [% of L]:").splitlines()[2:]
    assert [re.findall(r"\d+", line) for line in curve] == [
        list("113333"),
        list("222333"),
        list("111111"),
    ]


def test_trials_are_counted_with_exact_intervals() -> None:
    """Clopper and Pearson (1934): 10 of 10 leave 0.025^(1/10) = 69.15 %; 0 of 10 allow 1 − that."""
    lines = [result("tracking", "one", k, **OUT) for k in range(10)]
    lines += [result("a", "one", k) for k in range(10)] + [
        result("b", "one", k, status="failed") for k in range(10)
    ]
    results = results_of(lines, trials=10)
    inside = {name: line["converged inside"] for name, line in cells_of(law_table(results)).items()}
    assert inside == {
        "a": "**10 of 10: at least 69 % (95 %)**",
        "b": "0 of 10: at most 31 % (95 %)",
    }
    assert "Intervals are over trials of these scenarios" in text_of(results)


def test_nobody_wins_where_nothing_is_challenged() -> None:
    """A law that uses more and varies less than another one, in a scenario in which tracking alone
    keeps every row.
    """
    lines = [
        result("tracking"),
        result("a", utilization=0.99, acceleration_variation=0.5),
        result("b", status="failed"),
    ]
    results = results_of(lines, [row(name, challenged=False) for name in ("tracking", "a", "b")])
    assert "violates a constraint in 0 of 1 run.\nControllers are not ranked.\n" in text_of(results)
    assert "Most often" not in text_of(results)
    for group in ("outcome", "task", "chattering"):
        assert "**" not in metric_table(results, "one", group)
    assert "**" not in law_table(results)
    assert winner_table(results) == ""
    challenged = results_of(lines, [row(name) for name in ("tracking", "a", "b")])
    assert "Most often converged without violating a constraint: **a**." in text_of(challenged)


def test_nobody_wins_where_all_are_alike_or_alone() -> None:
    alike = [result("tracking", **OUT), result("a"), result("b")]
    assert "Most often" not in text_of(results_of(alike))
    alone = [result("tracking", **OUT), result("a"), result("b", status="trapped")]
    for lines in (alike, alone):
        assert winner_table(results_of(lines)) == ""


def test_the_opening_is_of_this_comparison() -> None:
    """Its robots, by name, by table or by the file they are loaded from; its laws; and nobody
    else's.
    """
    lines = [result("tracking", **OUT), result("mine")]
    results = results_of(lines)
    said = {"ur5": "ur5", "a|b": r"a\|b"}
    tables: list[tuple[Any, str]] = [
        *said.items(),
        ({"name": "arm 3"}, "arm 3"),
        ({"urdf": "robots/tall.urdf"}, "tall"),
        ({"dh": []}, "own robot"),
    ]
    for robot, name in tables:
        results.stored.scenarios["one"] = Scenario("one", {"robot": robot}, Path())
        text = text_of(results).partition("## Definitions")[0]
        assert f" Compared: 1 controller on {name}, in 1 scenario.\n" in text
        assert not re.search(r"paper|sliding-mode|UR5|Panda|6R", text)


def test_the_first_table_is_one_and_begins_with_the_best() -> None:
    lines = [
        result("tracking", **OUT),
        result("a", status="trapped"),
        result("b"),
        result("c", compiled=False),
    ]
    found = cells_of(law_table(results_of(lines)))
    assert list(found) == ["b", "c", "a"]
    assert "\n\n" not in law_table(results_of(lines))
    assert [cells["implementation"] for cells in found.values()] == [
        "compiled",
        "uncompiled",
        "compiled",
    ]


def test_one_law_alone_is_compared_with_nothing() -> None:
    assert "Only tracking was run, so there is nothing to compare." in text_of(
        results_of([result("tracking")])
    )
    assert "Most often" not in text_of(results_of([result("tracking"), result("a")]))


# --- violations, and the best ---


def test_the_worst_violation_is_of_the_deepest_run_and_its_row() -> None:
    """Of three runs that violate rows; in the worst, a row that is kept has the greatest usage."""
    lines = [
        result("a", "one", violated="x", violation_depth=0.25),
        result("a", "two", 0, violated="x", violation_depth=0.125),
        result("a", "two", 1, violated="x; y", violation_depth=0.375),
        result("a", "one", 1),
    ]
    rows = [
        row("a", "first", "one", violation_depth=5.0, usage_max=9.0),
        row("a", "other trial", "two", violation_depth=5.0, usage_max=9.0),
        row("a", "x", "two", trial=1, violation_depth=0.5, usage_max=1.25),
        row("a", "y", "two", trial=1, violation_depth=0.25, usage_max=1.375),
        row("a", "kept", "two", trial=1, violation_depth=0.0, usage_max=2.0),
        row("b", "other law", "two", trial=1, violation_depth=5.0, usage_max=9.0),
    ]
    cells = ["3", "37.5", "`y`", "two", "one and two"]
    assert list(cells_of(violation_table(results_of(lines, rows, trials=2)))["a"].values()) == cells
    assert list(cells_of(violation_table(results_of(lines, trials=2)))["a"].values()) == [
        *cells[:2],
        "–",
        *cells[3:],
    ]
    assert violation_table(results_of([result("a")])) == ""


def test_winners_are_the_best_of_the_clean() -> None:
    """By the median of the trials, as shown; of chattering there is no number in the second
    scenario.
    """

    def runs(
        name: str, scenario: str, used: tuple[float, ...], varies: float, **changes: Any
    ) -> list[dict[str, Any]]:
        values = {"acceleration_variation": varies, **changes}
        return [
            result(name, scenario, i, utilization=value, **values) for i, value in enumerate(used)
        ]

    lines = [
        *runs("used", "one", (0.95, 0.5, 0.9), 3.0),
        *runs("b", "one", (0.7, 0.8, 0.0), 2.0),
        *runs("used", "two", (0.6, 0.6, 0.6), math.nan),
        *runs("b", "two", (0.1, 0.99, 0.7), math.nan),
        *runs("out", "two", (0.99, 0.99, 0.99), 0.1, violation_depth=0.1, violated="x"),
        *runs("used", "three", (0.80001,), 5.0),
        *runs("b", "three", (0.80002,), 4.0),
        *runs("out", "three", (0.99,), 0.1, status="unfinished"),
        result("used", "four", 0, violated="x", violation_depth=0.02),
        result("used", "four", 1),
        result("b", "four", 0, status="trapped"),
        result("b", "four", 1),
    ]
    results = results_of(lines, trials=3)
    # in the third one both show the same utilization
    assert cells_of(winner_table(results)) == {
        "used": {USED: "one (90.00)", CALM: "–"},
        "b": {USED: "two (70.00)", CALM: "one (2.00) and three (4.00)"},
    }
    assert unsolved(results) == {"four": ""}


def test_scenarios_that_nobody_solves_are_named_and_those_nobody_ran_are_not() -> None:
    lines = [
        result("a", "solved"),
        result("b", "solved", status="trapped"),
        result("a", "of one law", violated="x", violation_depth=0.5),
        result("tracking", "of none"),
        result("a", "of both", status="failed"),
        result("b", "of both", violated="x", violation_depth=0.5),
    ]
    assert unsolved(results_of(lines)) == {"of one law": "", "of both": ""}
    closed = f"at rest; marker 1 is closed off: {UNSOLVABLE}"
    walled = [result(name, "walled", status="trapped", reason=closed) for name in ("a", "b")]
    assert unsolved(results_of(walled)) == {
        "walled": "constraints close off a marker from its goal"
    }
    # the only one to solve it is better than nobody
    assert winner_table(results_of(lines[:2])) == ""


def test_a_cell_names_nine_scenarios() -> None:
    assert first_names("abcdefghi", 9) == list("abcdefghi")
    assert first_names("abcdefghij", 9) == [*"abcdefgh", "2 more"]
    assert first_names("abcaba", 9) == list("abc")


# --- the table over all scenarios ---


def summary_of(results: Results) -> dict[str, dict[str, str]]:
    """Its cells and those of the first table, by controller and column."""
    return cells_of("\n\n".join(one(results) for one in (law_table, endings_table, score_table)))


def cells_of(text: str) -> dict[str, dict[str, str]]:
    """The cells of tables, by controller and column."""
    found: dict[str, dict[str, str]] = {}
    for block in re.findall(r"(?:^\|.*\n?)+", text, flags=re.MULTILINE):
        header, _, *body = [
            [cell.strip() for cell in line.split("|")[1:-1]] for line in block.splitlines()
        ]
        for cells in body:
            found.setdefault(cells[0], {}).update(zip(header[1:], cells[1:], strict=True))
    return found


ENDINGS = ("converged", "slow", "trapped", "unfinished", "aborted", "failed", "diverged")


def test_every_cell_of_the_summary() -> None:
    """Law *good* and *wide* converge in two runs, *part* in one of them; *wide* violates a row in
    one.
    """
    numbers: dict[str, Any] = {"step_time_median_us": 10.0, "switching_rate_hz": 3.0}
    lines = [
        result(
            "tracking", "one", **numbers, violated="x", violation_depth=0.5, utilization=math.nan
        ),
        result("tracking", "two", status="aborted", utilization=math.nan, phi_band=math.nan),
        result(
            "good", "one", **numbers, phi_band=3.0, phi_band_bound=2.0, acceleration_variation=4.0
        ),
        result("good", "two", utilization=0.7, phi_band=8.0, phi_band_bound=16.0),
        result(
            "good",
            "three",
            status="trapped",
            step_time_median_us=7.0,
            utilization=0.1,
            switching_rate_hz=50.0,
        ),
        result(
            "wide", "one", **numbers, phi_band=0.5, phi_band_bound=2.0, acceleration_variation=0.5
        ),
        result(
            "wide",
            "two",
            utilization=0.95,
            violated="x; y",
            violation_depth=0.005,
            within_band="x; y",
        ),
        result(
            "wide",
            "three",
            status="failed",
            violated="x",
            violation_depth=1.25,
            utilization=math.nan,
        ),
        result(
            "part",
            "one",
            **numbers,
            utilization=0.99,
            sliding_lost_s=0.5,
            acceleration_variation=math.nan,
        ),
        result("part", "two", status="unfinished", step_time_median_us=math.nan),
        result("part", "three", status="unfinished", phi_band_bound=0.0),
    ]
    found = summary_of(results_of(lines))
    assert {
        name: [line[header] for header in ("runs", *ENDINGS)] for name, line in found.items()
    } == {
        "tracking": ["2", "1", "0", "0", "0", "1", "0", "0"],
        "good": ["3", "2", "0", "1", "0", "0", "0", "0"],
        "wide": ["3", "2", "0", "0", "0", "0", "1", "1"],
        "part": ["3", "1", "0", "0", "2", "0", "0", "0"],
    }
    headers = [
        "converged inside", "at 1 % of L", "median utilization [%]", "worst depth [% of L]",
        "acceleration variation "
        "[rad/s³]", "median call [µs]", "implementation", "runs with a violated row",
        "beyond 1 % of L", "within the sampling band", "worst φ band / bound", "switching rate [Hz]",
    ]  # fmt: skip
    assert [header for header in found["good"] if header not in ("runs", *ENDINGS)] == headers
    del found["tracking"]
    assert {name: [line[header] for header in headers] for name, line in found.items()} == {
        # (0.9 + 0.7)/2; (4 + 1)/2; the median of 10, 1 and 7; 3/2 is more than 8/16 and 1/1; (3 +
        # 1)/2. No number is bold that is beaten by another one, compared or not: by 92.5, by 0.75,
        # by 1.00; the switching rates tie
        "good": ["**2 of 3**", "**2**", "80.00", "**0**", "2.50", "7.00", "compiled", "**0**", "**0**", "0", "1.50",
                 "**2.00**"],
        # violations are compared, nothing else
        "wide": ["1 of 3", "**2**", "(92.50)", "125", "(0.750)", "1.00", "compiled", "2", "1", "1", "(1.00)", "(2.00)"],
        "part": ["1 of 3", "1", "(99.00)", "(0)", "–", "5.50, 2 of 3", "compiled", "(0)", "(0)", "0",
                 "(1.00, 2 of 3)", "(3.00)"],
    }  # fmt: skip


def test_one_run_that_goes_wild_does_not_spoil_a_law() -> None:
    """Of 0.5, 0.75 and 0.7; of 1, 2 and 1e9; of 2, 3 and 1e9 + 1; a run that does not converge has
    no part in them.
    """
    lines = [
        result(
            "a", name, utilization=used, switching_rate_hz=rate, acceleration_variation=rate + 1.0
        )
        for name, used, rate in (("one", 0.5, 1.0), ("two", 0.75, 2.0), ("three", 0.7, 1e9))
    ]
    lines.append(result("a", "four", status="failed", utilization=0.1, acceleration_variation=1e12))
    found = summary_of(results_of(lines))["a"]
    headers = ("median utilization [%]", "switching rate [Hz]", "acceleration variation [rad/s³]")
    assert [found[header] for header in headers] == ["70.00", "2.00", "3.00"]


def test_a_scenarios_tables_show_numbers_in_the_units_of_their_headers() -> None:
    """Of a law that ends 2 mm and 3 mrad away and was outside by an eighth of L, for 0.5 s."""
    own = {
        "final_translation_error_m": 0.002,
        "final_rotation_error_rad": 0.003,
        "final_feature_error_px": 1.5,
    }
    outside = {
        "violated": "x",
        "violation_depth": 0.125,
        "violation_time_s": 0.5,
        "settling_time_s": 4.0,
    }
    results = results_of(
        [result("tracking"), result("a", **own, **outside, phi_band=3.0, phi_band_bound=2.0)]
    )
    found = cells_of(
        "\n\n".join(
            metric_table(results, "one", group) for group in ("outcome", "task", "chattering")
        )
    )["a"]
    shown = {header: text.strip("()") for header, text in found.items()}
    expected = {
        "position error [mm]": "2.00", "orientation error [mrad]": "3.00", "image error [px]": "1.50",
        "worst depth [% of L]": "12.5", "time outside [s]": "0.500", "settling time [s]": "4.00",
        "φ band": "3.00", "bound T_s u⁺": "2.00", "band / bound": "1.50",
    }  # fmt: skip
    assert {header: shown[header] for header in expected} == expected


def test_a_law_that_alone_was_run_is_the_best_of_nothing() -> None:
    for lines in ([result("tracking"), result("a")], [result("a")], [result("tracking")]):
        found = summary_of(results_of(lines, controllers=("a", "b")))
        assert not [
            text for line in found.values() for text in line.values() if text.startswith("**")
        ]
    both = summary_of(results_of([result("a"), result("b", utilization=0.5)]))
    assert [both[name]["median utilization [%]"] for name in "ab"] == ["**90.00**", "50.00"]
    assert [both[name]["converged inside"] for name in "ab"] == ["1 of 1", "1 of 1"]


def test_where_nobody_converges_nobody_is_compared() -> None:
    found = summary_of(results_of([result(name, status="trapped") for name in "ab"]))
    for name in "ab":
        assert (
            found[name]["runs with a violated row"] == found[name]["worst depth [% of L]"] == "(0)"
        )
        assert found[name]["converged inside"] == "0 of 1"


# --- what is marked best ---


def test_a_cell_is_judged_by_the_median_as_shown() -> None:
    assert Cell.of([4.0, 1.0, 2.0]) == Cell("2.00 [1.00–4.00]", 2.0, "2.00")
    nothing = Cell.of([math.nan])
    assert (nothing.text, nothing.shown) == ("–", "–")
    assert math.isnan(nothing.value)
    cells = [Cell.of([value]) for value in (2.0, 2.001, 1.0, 3.0, math.nan)]
    may = [True, True, False, True, True]
    assert marked([*cells[:2], *cells[3:]], may[:2] + may[3:], "less") == [
        "**2.00**",
        "**2.00**",
        "3.00",
        "–",
    ]
    # what is not compared is beaten by nothing that is bold, either
    assert marked(cells, may, "less") == ["2.00", "2.00", "(1.00)", "3.00", "–"]
    assert marked(cells, may, "more") == ["2.00", "2.00", "(1.00)", "**3.00**", "–"]
    # what stands before the judged number is not bold
    assert marked(
        [Cell("2", 2.0, "2", "1 / "), Cell("3", 3.0, "3", "0 / ")], [True, True], "less"
    ) == [
        "1 / **2**",
        "0 / 3",
    ]
    assert marked(cells, may, None) == ["2.00", "2.00", "1.00", "3.00", "–"]
    # nothing is there that it could be compared with
    assert marked(cells[:1], [False], "less") == ["2.00"]
    assert marked(cells, [False] * 5, "less") == ["(2.00)", "(2.00)", "(1.00)", "(3.00)", "–"]


def test_who_may_be_compared() -> None:
    yes = [{"status": "converged"}, {"status": "converged"}]
    no = [{"status": "converged"}, {"status": "trapped"}]
    assert comparable([yes, no, []]) == [True, False, False]
    assert comparable([yes, yes]) == [True, True]
    assert comparable([yes, [], []]) == [False, False, False]


def metric(column: str) -> Metric:
    """The last one that is made from a column: the ratio of the φ band to its bound, not the band
    itself.
    """
    return [one for one in run_metrics() if one.column == column][-1]


@pytest.mark.parametrize("column", ["violation_depth", "violation_time_s"])
def test_violations_are_compared_of_everybody(column: str) -> None:
    assert judged_by(metric(column), [result("a", violation_depth=0.5, sliding_lost_s=1.0)])
    assert judged_by(metric(column), [])


def test_everything_else_is_compared_inside_and_the_band_while_sliding() -> None:
    """A law with a faultless run and one more, which is outside or loses a sliding mode."""
    good = result("a")
    outside = result("a", violation_depth=0.5)
    lost = result("a", sliding_lost_s=0.5)
    for runs, inside, sliding in (([good], True, True), ([good, outside], False, True), ([good, lost], True, False),
                                  ([], False, False)):  # fmt: skip
        assert judged_by(metric("utilization"), runs) is inside
        for column in ("phi_band", "sliding_lost_s"):
            assert judged_by(metric(column), runs) is (inside and sliding)
