"""The findings, the table over all scenarios and what is marked best, of made-up results worked out by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from test_reports import result, row
from vsconstraints.comparisons import StoredComparison
from vsconstraints.comparisons.metrics import METRICS, Metric
from vsconstraints.reports.best import Cell, comparable, judged_by, keeps_rows, marked
from vsconstraints.reports.headlines import opening, some
from vsconstraints.reports.results import Results
from vsconstraints.reports.scenario_section import metric_table
from vsconstraints.reports.summary import summary

WINNERS = "among the controllers that converged and violated no row"
USED, CALM = f"Most of the allowed space used, {WINNERS}: ", f"Least chattering (acceleration variation), {WINNERS}: "


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
    return Results(StoredComparison(Path(), {"configuration": chosen}, lines, rows or []))


def findings(results: Results) -> list[str]:
    """The lines under Findings."""
    _, _, below = opening(results).partition("## Findings\n\n")
    return [line.removeprefix("- ") for line in below.splitlines()]


# --- the opening ---


def test_the_title_is_that_of_the_configuration_or_else_the_suites_name() -> None:
    lines = [result("tracking"), result("a")]
    assert opening(results_of(lines, title="Title", suite="suite")).startswith("# Title\n")
    assert opening(results_of(lines, suite="suite")).startswith("# suite\n")
    assert opening(results_of(lines)).startswith("# Comparison\n")


def test_what_was_run_is_counted_and_what_is_missing_is_said() -> None:
    whole = opening(results_of([result("tracking"), result("a")]))
    assert "(1 scenario, 2 controllers):" in whole
    assert "Incomplete" not in whole
    part = opening(results_of([result("tracking"), result("a"), result("b", "two", 1)], trials=2))
    assert "(2 scenarios, 3 controllers, 2 trials):" in part
    assert "\n\n**Incomplete: 3 of 12 runs finished.** What is missing is blank below" in part


def test_one_law_alone_is_compared_with_nothing() -> None:
    assert findings(results_of([result("tracking")])) == ["Only tracking alone was run: there is nothing to compare."]
    one, two = findings(results_of([result("tracking"), result("a")]))
    assert one == "Runs that converged without violating a row: **a** 1 of 1."
    assert two == "**a** converged in 1 of 1 run; it violated no row."


# --- the findings ---


def test_clean_runs_are_counted_and_ranked() -> None:
    """A law that is clean once, one that is clean three times and one that is clean twice, of three runs each."""
    band = "speed[joint 1].upper"
    lines = [
        result("once", "one"),
        result("once", "two", violated="x", violation_depth=0.5, within_band=band),
        result("once", "three", status="trapped", within_band=band),
        *(result("thrice", name, within_band=band) for name in ("one", "two")),
        result("thrice", "three"),
        *(result("twice", name) for name in ("one", "two")),
        result("twice", "three", status="unfinished"),
    ]
    assert findings(results_of(lines, controllers=("idle",)))[0] == (
        "Runs that converged without violating a row: "
        "**thrice** 3 of 3 (2 of them outside within the sampling band), **twice** 2 of 3, **once** 1 of 3, "
        "**idle** 0 of 0."
    )


def test_what_became_of_each_laws_runs() -> None:
    ends = {"one": "converged", "two": "trapped", "three": "aborted", "four": "failed", "five": "unfinished"}
    lines = [result("a", name, status=status) for name, status in ends.items()]
    lines += [result("b", name, status="trapped" if name in ("one", "three") else "converged") for name in ends]
    found = findings(results_of(lines, controllers=("idle",)))
    assert found[1:4] == [
        "**a** converged in 1 of 5 runs, was trapped in two, was aborted in three, failed in four, was still moving at "
        "the end in five; until then it violated no row.",
        "**b** converged in 3 of 5 runs, was trapped in one and three; it violated no row.",
        "**idle**: no run finished.",
    ]


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
    said = "**a** converged in 4 of 4 runs; it violated rows in 3 runs (one and two), at worst by 37.5 % of L "
    assert findings(results_of(lines, rows, trials=2))[1] == f"{said}(`y`, two)."
    assert findings(results_of(lines, trials=2))[1] == f"{said}(row unknown, two)."


def test_winners_are_the_best_of_the_clean() -> None:
    """By the median of the trials, as shown; of chattering there is no number in the second scenario."""

    def runs(name: str, scenario: str, used: tuple[float, ...], varies: float, **changes: Any) -> list[dict[str, Any]]:
        values = {"acceleration_variation": varies, **changes}
        return [result(name, scenario, i, utilization=value, **values) for i, value in enumerate(used)]

    lines = [
        *runs("used", "one", (0.95, 0.5, 0.9), 3.0),
        *runs("b", "one", (0.7, 0.8, 0.0), 2.0),
        *runs("used", "two", (0.6, 0.6, 0.6), math.nan),
        *runs("b", "two", (0.1, 0.99, 0.7), math.nan),
        *runs("out", "two", (0.99, 0.99, 0.99), 0.1, violation_depth=0.1, violated="x"),
        *runs("used", "three", (0.80001,), 5.0),
        *runs("b", "three", (0.80002,), 4.0),
        *runs("out", "three", (0.99,), 0.1, status="unfinished"),
        result("used", "four", 0, violated="x", violation_depth=1e-3),
        result("used", "four", 1),
        result("b", "four", 0, status="trapped"),
        result("b", "four", 1),
    ]
    found = findings(results_of(lines, trials=3))
    assert found[4:] == [
        f"{USED}**used** in one (90.00 %) and three (80.00 %); **b** in two (70.00 %) and three (80.00 %).",
        f"{CALM}**b** in one (2.00 rad/s³) and three (4.00 rad/s³).",
        "Nobody converged without violating a row in [four](#scenario-four).",
    ]


def test_a_law_that_wins_more_stands_before_one_that_wins_first() -> None:
    wins = {"one": ("early winner", 0.9), "two": ("b", 0.9), "three": ("b", 0.9)}
    lines = [
        result(name, scenario, utilization=best if name == winner else 0.5, acceleration_variation=math.nan)
        for scenario, (winner, best) in wins.items()
        for name in ("early winner", "b")
    ]
    assert findings(results_of(lines))[3:] == [
        f"{USED}**b** in two (90.00 %) and three (90.00 %); **early winner** in one (90.00 %)."
    ]


def test_scenarios_that_nobody_solves_are_named_and_those_nobody_ran_are_not() -> None:
    lines = [
        result("a", "solved"),
        result("b", "solved", status="trapped"),
        result("a", "of one law", violated="x", violation_depth=0.5),
        result("tracking", "of none"),
        result("a", "of both", status="failed"),
        result("b", "of both", violated="x", violation_depth=0.5),
    ]
    assert findings(results_of(lines))[-1] == (
        "Nobody converged without violating a row in [of one law](#scenario-of%20one%20law) and "
        "[of both](#scenario-of%20both)."
    )
    solved = findings(results_of(lines[:2]))
    assert len(solved) == 5
    assert solved[-1] == f"{CALM}**a** in solved (1.00 rad/s³)."


def test_a_sentence_names_nine_scenarios() -> None:
    assert some(list("abcdefghi")) == list("abcdefghi")
    assert some(list("abcdefghij")) == [*"abcdefgh", "2 more"]
    assert some(list("abcdefghijkl")) == [*"abcdefgh", "4 more"]


# --- the table over all scenarios ---


def summary_of(results: Results) -> dict[str, dict[str, str]]:
    """Its cells, by controller and column."""
    return cells_of(summary(results))


def cells_of(text: str) -> dict[str, dict[str, str]]:
    """A table's cells, by controller and column."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    header, _, *body = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    return {cells[0]: dict(zip(header[1:], cells[1:], strict=True)) for cells in body}


ENDINGS = ("converged", "trapped", "aborted", "failed", "unfinished")


def test_every_cell_of_the_summary() -> None:
    """Law *good* and *wide* converge in two runs, *part* in one of them; *wide* violates a row in one."""
    numbers: dict[str, Any] = {"step_time_median_us": 10.0, "switching_rate_hz": 3.0}
    lines = [
        result("tracking", "one", **numbers, violated="x", violation_depth=0.5, utilization=math.nan),
        result("tracking", "two", status="aborted", utilization=math.nan, phi_band=math.nan),
        result("good", "one", **numbers, phi_band=3.0, phi_band_bound=2.0, acceleration_variation=4.0),
        result("good", "two", utilization=0.7, phi_band=8.0, phi_band_bound=16.0, within_band="y"),
        result("good", "three", status="trapped", step_time_median_us=7.0, utilization=0.1, switching_rate_hz=50.0),
        result("wide", "one", **numbers, phi_band=0.5, phi_band_bound=2.0, acceleration_variation=0.5),
        result("wide", "two", utilization=0.95, violated="x; y", violation_depth=0.02, within_band="z"),
        result("wide", "three", status="failed", violated="x", violation_depth=0.25, utilization=math.nan),
        result("part", "one", **numbers, utilization=0.99, sliding_lost_s=0.5, acceleration_variation=math.nan),
        result("part", "two", status="unfinished", within_band="y", step_time_median_us=math.nan),
        result("part", "three", status="unfinished", phi_band_bound=0.0),
    ]
    found = summary_of(results_of(lines))
    assert {name: [line[header] for header in ("runs", *ENDINGS)] for name, line in found.items()} == {
        "tracking": ["2", "(1)", "0", "1", "0", "0"],
        "good": ["3", "**2**", "1", "0", "0", "0"],
        "wide": ["3", "**2**", "0", "0", "1", "0"],
        "part": ["3", "1", "0", "0", "0", "2"],
    }
    scores = {name: [text for header, text in line.items() if header not in ("runs", *ENDINGS)]
              for name, line in found.items()}  # fmt: skip
    assert list(found["good"])[6:] == [
        "mean utilization [%]", "runs with a violated row", "others outside within the sampling band",
        "worst depth [% of L]", "worst φ band / bound", "switching rate [Hz]", "acceleration variation [rad/s³]",
        "median call [µs]",
    ]  # fmt: skip
    assert scores == {
        "tracking": ["–", "(1)", "0", "(50.0)", "(1.00, 1 of 2)", "(3.00, 1 of 2)", "(1.00, 1 of 2)", "5.50"],
        # (0.9 + 0.7)/2; 3/2 is more than 8/16 and 1/1; (3 + 1)/2; (4 + 1)/2; the median of 10, 1 and 7
        "good": ["**80.00, 2 of 3**", "**0**", "1", "**0**", "**1.50**", "**2.00, 2 of 3**", "**2.50, 2 of 3**",
                 "7.00"],
        # violations are compared, nothing else
        "wide": ["(92.50, 2 of 3)", "2", "0", "25.0", "(1.00)", "(2.00, 2 of 3)", "(0.750, 2 of 3)", "1.00"],
        "part": ["(99.00, 1 of 3)", "(0)", "1", "(0)", "(1.00, 2 of 3)", "(3.00, 1 of 3)", "–", "5.50, 2 of 3"],
    }  # fmt: skip


def test_means_of_the_summary_are_no_medians() -> None:
    """Of 0.5, 0.75 and 0.7; of 1, 2 and 6; of 2, 3 and 7."""
    lines = [
        result("a", name, utilization=used, switching_rate_hz=rate, acceleration_variation=rate + 1.0)
        for name, used, rate in (("one", 0.5, 1.0), ("two", 0.75, 2.0), ("three", 0.7, 6.0))
    ]
    found = summary_of(results_of(lines))["a"]
    headers = ("mean utilization [%]", "switching rate [Hz]", "acceleration variation [rad/s³]")
    assert [found[header] for header in headers] == ["(65.00)", "(3.00)", "(4.00)"]


def test_a_scenarios_tables_show_numbers_in_the_units_of_their_headers() -> None:
    """Of a law that ends 2 mm and 3 mrad away and was outside by an eighth of L, for 0.5 s."""
    own = {"final_translation_error_m": 0.002, "final_rotation_error_rad": 0.003, "final_feature_error_px": 1.5}
    outside = {"violated": "x", "violation_depth": 0.125, "violation_time_s": 0.5, "settling_time_s": 4.0}
    results = results_of([result("tracking"), result("a", **own, **outside, phi_band=3.0, phi_band_bound=2.0)])
    found = (
        cells_of(metric_table(results, "one", "task"))["a"] | cells_of(metric_table(results, "one", "chattering"))["a"]
    )
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
        assert not [text for line in found.values() for text in line.values() if text.startswith("**")]
    both = summary_of(results_of([result("a"), result("b", utilization=0.5)]))
    assert [both[name]["mean utilization [%]"] for name in "ab"] == ["**90.00**", "50.00"]
    assert [both[name]["converged"] for name in "ab"] == ["**1**", "**1**"]


def test_where_nobody_converges_nobody_is_compared() -> None:
    found = summary_of(results_of([result(name, status="trapped") for name in "ab"]))
    for name in "ab":
        assert found[name]["runs with a violated row"] == found[name]["worst depth [% of L]"] == "(0)"
        assert found[name]["converged"] == "(0)"


# --- what is marked best ---


def test_a_cell_is_judged_by_the_median_as_shown() -> None:
    assert Cell.of([4.0, 1.0, 2.0]) == Cell("2.00 [1.00–4.00]", 2.0, "2.00")
    nothing = Cell.of([math.nan])
    assert (nothing.text, nothing.shown) == ("–", "–")
    assert math.isnan(nothing.value)
    cells = [Cell.of([value]) for value in (2.0, 2.001, 1.0, 3.0, math.nan)]
    may = [True, True, False, True, True]
    assert marked(cells, may, "less") == ["**2.00**", "**2.00**", "(1.00)", "3.00", "–"]
    assert marked(cells, may, "more") == ["2.00", "2.00", "(1.00)", "**3.00**", "–"]
    assert marked(cells, may, None) == ["2.00", "2.00", "1.00", "3.00", "–"]
    assert marked(cells, [False] * 5, "less") == ["(2.00)", "(2.00)", "(1.00)", "(3.00)", "–"]


def test_who_may_be_compared() -> None:
    yes, no = ["converged", "converged"], ["converged", "trapped"]
    assert comparable([yes, no, []]) == [True, False, False]
    assert comparable([yes, yes]) == [True, True]
    assert comparable([yes, [], []]) == [False, False, False]


def metric(column: str) -> Metric:
    """The last one that is made from a column: the ratio of the φ band to its bound, not the band itself."""
    return [one for one in METRICS if one.column == column][-1]


@pytest.mark.parametrize("column", ["violation_depth", "violation_time_s"])
def test_violations_are_compared_of_everybody(column: str) -> None:
    assert judged_by(metric(column), [result("a", violation_depth=0.5, sliding_lost_s=1.0)])
    assert judged_by(metric(column), [])


def test_everything_else_is_compared_inside_and_the_band_while_sliding() -> None:
    """A law with a faultless run and one more, which is outside or loses a sliding mode."""
    good, outside, lost = result("a"), result("a", violation_depth=0.5), result("a", sliding_lost_s=0.5)
    for runs, inside, sliding in (([good], True, True), ([good, outside], False, True), ([good, lost], True, False),
                                  ([], False, False)):  # fmt: skip
        assert keeps_rows(runs) is inside
        assert judged_by(metric("utilization"), runs) is inside
        for column in ("phi_band", "sliding_lost_s"):
            assert judged_by(metric(column), runs) is (inside and sliding)
