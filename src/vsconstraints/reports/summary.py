"""Tables over all scenarios of a comparison: summary, outcomes, scores and violations."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from urllib.parse import quote

from ..comparisons.metrics import METRICS, NEGLIGIBLE, TOLERANT, Metric
from ..comparisons.suite import BASELINE
from ..simulation.start import UNSOLVABLE
from .markdown import Table, code
from .numbers import DASH, FORMATS, largest, median, number, of_length
from .results import (
    Better,
    Cell,
    Line,
    Results,
    clean,
    columns_table,
    judged_by,
    marked,
    shown,
    tally,
    violated,
)  # fmt: skip

#: Explanation of the marks of :func:`outcome`.
MARKS = (
    f"† A row was violated by more than {of_length(TOLERANT)}; ‡ by more than "
    f"{of_length(NEGLIGIBLE)}, "
    "but not more than that."
)
STATUSES = ("converged", "slow", "trapped", "unfinished", "aborted", "failed")
#: Columns of results.csv in the first table.
FIRST = ("violation_depth", "utilization", "acceleration_variation", "step_time_median_us")
#: Warnings about what holds at a goal.
OF_A_GOAL = re.compile(r"goal( \d+)?(:| is forbidden by )")
PERHAPS = "it may be impossible"  #: Reason why a scenario may be unsolvable, if that is not proved.
IMPLEMENTATION = "implementation"  #: Last column of the first table.
MAX_NAMES = 9  #: Most scenarios that a cell names.


def law_table(results: Results) -> Table:
    """Return the main results of each controller, best first."""
    runs = {name: len(results.all_runs(name)) for name in results.competitors}
    names = sorted(runs, key=lambda name: (-results.clean[name], -results.clean_tolerant[name]))

    def inside(
        counts: Mapping[str, int], text: Callable[[int, int], str] = lambda count, of: str(count)
    ) -> list[str]:
        cells = [
            Cell(text(counts[n], runs[n]), counts[n] if runs[n] else math.nan, str(counts[n]))
            for n in names
        ]
        return marked(cells, [True] * len(names), _better(results, "more"))

    def counted(count: int, of: int) -> str:
        if results.trials == 1:
            return f"{count} of {of}"
        # The import takes longer than all other imports of a report.
        from ..comparisons.rates import rate_of, rate_text

        return rate_text(rate_of(count, of))

    columns = {
        "converged inside": inside(results.clean, counted),
        f"at {of_length(TOLERANT)}": inside(results.clean_tolerant),
        **_overall(results, names, lambda metric: metric.column in FIRST),
        IMPLEMENTATION: [results.implementation(name) for name in names],
    }
    return columns_table("controller", names, columns)


def score_table(results: Results) -> Table:
    """Return violations, and the scores that are not in the first table."""
    names = results.competitors

    def outside(column: str) -> list[str]:
        counts = [
            sum(bool(violated(run, column)) for run in results.all_runs(name)) for name in names
        ]
        cells = [Cell(str(count), count, str(count)) for count in counts]
        return marked(cells, _complete(results, names), _better(results, "less"))

    def within_band(run: Line) -> bool:
        return bool(violated(run)) and violated(run) == violated(run, "within_band")

    columns = {
        "runs with a violated row": outside("violated"),
        f"beyond {of_length(TOLERANT)}": outside("violated_tolerant"),
        "within the sampling band": [
            str(sum(map(within_band, results.all_runs(name)))) for name in names
        ],
        **_overall(results, names, lambda metric: metric.column not in FIRST),
    }
    return columns_table("controller", names, columns)


def worst_violation(results: Results, controller: str) -> tuple[list[Line], Line, str]:
    """Return the runs of a controller that violate a row, the deepest run, and its deepest row.

    Without a violation: an empty list, an empty line and a dash.
    """
    runs = [run for run in results.all_runs(controller) if violated(run)]
    if not runs:
        return [], {}, DASH
    worst = max(runs, key=lambda run: float(run["violation_depth"]))
    rows = [
        row for row in results.rows(worst["scenario"], controller) if row["trial"] == worst["trial"]
    ]
    rows = [row for row in rows if row["violation_depth"] > 0.0]
    deepest = max(rows, key=lambda row: float(row["usage_max"]), default=None)
    return runs, worst, code(deepest["constraint"]) if deepest else DASH


def won(results: Results, metric: Metric) -> dict[str, list[str]]:
    """Return the scenarios that each controller wins, with its value.

    A scenario has no winner if all values are equal as printed.
    """
    show = FORMATS[metric.style]
    found = defaultdict[str, list[str]](list)
    for scenario in results.challenged_scenarios:
        runs = {name: results.runs(scenario, name) for name in _solvers(results, scenario)}
        medians = {name: median([shown(metric, run) for run in own]) for name, own in runs.items()}
        values = {name: value for name, value in medians.items() if math.isfinite(value)}
        if len(set(map(show, values.values()))) > 1:
            top = show((max if metric.better == "more" else min)(values.values()))
            for name in (name for name, value in values.items() if show(value) == top):
                found[name].append(f"{scenario} ({top})")
    return found


def _solvers(results: Results, scenario: str) -> list[str]:
    """Return the controllers that converged without violation in every trial."""
    return [
        name
        for name in results.competitors
        if (own := results.runs(scenario, name)) and all(map(clean, own))
    ]


def unsolved(results: Results) -> dict[str, str]:
    """Return the scenarios that no controller solved, with the reason if it is known."""
    reasons = {}
    for scenario in results.scenarios:
        runs = [run for name in results.competitors for run in results.runs(scenario, name)]
        if runs and not _solvers(results, scenario):
            warnings = results.stored.warnings.get(scenario, ())
            closed = all(UNSOLVABLE in run["reason"] for run in runs) or any(
                UNSOLVABLE in text for text in warnings
            )
            perhaps = PERHAPS if obstacles(results, scenario) else ""
            reasons[scenario] = (
                "constraints close off a marker from its goal" if closed else perhaps
            )
    return reasons


def obstacles(results: Results, scenario: str) -> list[str]:
    """Return the warnings that a scenario may be unsolvable for every controller.

    Questions about units and goals that could not be checked are left out.
    """
    return [
        text
        for text in results.stored.warnings.get(scenario, ())
        if OF_A_GOAL.match(text) or UNSOLVABLE in text
    ]


def warned(results: Results) -> dict[str, int]:
    """Return the number of warnings of each scenario that has any."""
    return {
        name: len(own)
        for name, own in results.stored.warnings.items()
        if own and name in results.scenarios
    }


def outcome(results: Results, scenario: str, controller: str, scored: bool = False) -> str:
    """Format the outcomes of a controller on a scenario.

    With ``scored`` a single run also has its utilization [%], or its violation depth [% of L].
    """
    runs = results.runs(scenario, controller)
    marks = (
        "†" if violated(run, "violated_tolerant") else "‡" if violated(run) else "" for run in runs
    )
    text = tally(
        [f"{run['status'] or 'unknown'}{mark}" for run, mark in zip(runs, marks, strict=True)]
    )
    single = scored and len(runs) == 1 and controller != BASELINE
    value = (
        100.0 * runs[0]["violation_depth" if violated(runs[0]) else "utilization"]
        if single
        else math.nan
    )
    return f"{text} {number(value)}" if math.isfinite(value) else text


def anchor(scenario: str) -> str:
    """Return the anchor of a scenario's section, for links."""
    return quote(f"scenario-{scenario}")


def _complete(results: Results, names: Sequence[str]) -> list[bool]:
    """Return True for each controller that converged in every run in which any competitor did.

    All are False if there is only one competitor.
    """
    solved = {
        name: {
            (run["scenario"], run["trial"])
            for run in results.all_runs(name)
            if run["status"] == "converged"
        }
        for name in results.competitors
    }
    anyone = set().union(*solved.values())
    several = sum(bool(results.all_runs(name)) for name in results.competitors) > 1
    return [several and bool(anyone) and solved[name] == anyone for name in names]


def _overall(
    results: Results, names: Sequence[str], chosen: Callable[[Metric], bool]
) -> dict[str, list[str]]:
    """Return columns of the chosen metrics over all scenarios.

    Each is the worst or the median value, with the number of runs that have one.
    """
    columns = {}
    for metric in (metric for metric in METRICS if metric.overall and chosen(metric)):
        cells = []
        eligible = []
        for name, complete in zip(names, _complete(results, names), strict=True):
            runs = results.all_runs(name)
            if metric.condensed != "worst" and metric.kind != "time":
                runs = [run for run in runs if run["status"] == "converged"]
            values = [shown(metric, run) for run in runs]
            value = (largest if metric.condensed == "worst" else median)(values)
            text = FORMATS[metric.style](value)
            finite = sum(v == v for v in values)
            some = "" if text == DASH or finite == len(runs) else f", {finite} of {len(runs)}"
            cells.append(Cell(text + some, value, text))
            eligible.append(complete and judged_by(metric, runs))
        columns[metric.overall] = marked(cells, eligible, _better(results, metric.better))
    return columns


def _better(results: Results, better: Better) -> Better:
    """Return ``better``, or None if the unconstrained baseline violates no row."""
    return better if results.challenged_scenarios else None
