"""Tables over all scenarios of a comparison: summary, outcomes, scores and violations."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Sequence
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
    names = sorted(
        results.competitors,
        key=lambda name: (results.clean[name], results.clean_tolerant[name]),
        reverse=True,
    )
    strict = []
    tolerant = []
    for name in names:
        of = len(results.all_runs(name))
        count = results.clean[name]
        strict.append(Cell(_rate_text(results, count, of), count if of else math.nan, str(count)))
        count = results.clean_tolerant[name]
        tolerant.append(Cell(str(count), count if of else math.nan, str(count)))
    eligible = [True] * len(names)
    better = _better(results, "more")
    columns = {
        "converged inside": marked(strict, eligible, better),
        f"at {of_length(TOLERANT)}": marked(tolerant, eligible, better),
    }
    columns |= _overall(results, names, lambda metric: metric.column in FIRST)
    columns[IMPLEMENTATION] = [results.implementation(name) for name in names]
    return columns_table("controller", names, columns)


def _rate_text(results: Results, count: int, of: int) -> str:
    if results.trials == 1:
        return f"{count} of {of}"
    # The import takes longer than all other imports of a report.
    from ..comparisons.rates import rate_of, rate_text

    return rate_text(rate_of(count, of))


def score_table(results: Results) -> Table:
    """Return violations, and the scores that are not in the first table."""
    names = results.competitors

    def counts(condition: Callable[[Line], object]) -> list[int]:
        return [sum(map(bool, map(condition, results.all_runs(name)))) for name in names]

    def ranked_counts(column: str) -> list[str]:
        cells = []
        for count in counts(lambda run: violated(run, column)):
            cells.append(Cell(str(count), count, str(count)))
        return marked(cells, _complete(results, names), _better(results, "less"))

    def within_band(run: Line) -> bool:
        return bool(violated(run)) and violated(run) == violated(run, "within_band")

    columns = {
        "runs with a violated row": ranked_counts("violated"),
        f"beyond {of_length(TOLERANT)}": ranked_counts("violated_tolerant"),
        "within the sampling band": list(map(str, counts(within_band))),
    }
    columns |= _overall(results, names, lambda metric: metric.column not in FIRST)
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
        row
        for row in results.rows(worst["scenario"], controller)
        if row["trial"] == worst["trial"] and row["violation_depth"] > 0.0
    ]
    if not rows:
        return runs, worst, DASH
    deepest = max(rows, key=lambda row: float(row["usage_max"]))
    return runs, worst, code(deepest["constraint"])


def won(results: Results, metric: Metric) -> dict[str, list[str]]:
    """Return the scenarios that each controller wins, with its value.

    A scenario has no winner if all values are equal as printed.
    """
    show = FORMATS[metric.style]
    choose = max if metric.better == "more" else min
    won = defaultdict[str, list[str]](list)
    for scenario in results.challenged_scenarios:
        values = {}
        for name in results.solvers(scenario):
            value = median([shown(metric, run) for run in results.runs(scenario, name)])
            if math.isfinite(value):
                values[name] = value
        texts = {name: show(value) for name, value in values.items()}
        if len(set(texts.values())) > 1:
            best = show(choose(values.values()))
            for name, text in texts.items():
                if text == best:
                    won[name].append(f"{scenario} ({best})")
    return won


def unsolved(results: Results) -> dict[str, str]:
    """Return the scenarios that no controller solved, with the reason if it is known."""
    reasons = {}
    for scenario in results.scenarios:
        runs = [run for name in results.competitors for run in results.runs(scenario, name)]
        if not runs or results.solvers(scenario):
            continue
        warnings = results.stored.warnings.get(scenario, ())
        all_report = all(UNSOLVABLE in run["reason"] for run in runs)
        if all_report or any(UNSOLVABLE in text for text in warnings):
            reasons[scenario] = "constraints close off a marker from its goal"
        else:
            reasons[scenario] = PERHAPS if obstacles(results, scenario) else ""
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
        name: len(warnings)
        for name, warnings in results.stored.warnings.items()
        if warnings and name in results.scenarios
    }


def outcome(results: Results, scenario: str, controller: str, scored: bool = False) -> str:
    """Format the outcomes of a controller on a scenario.

    With ``scored`` a single run also has its utilization [%], or its violation depth [% of L].
    """
    runs = results.runs(scenario, controller)
    text = tally([f"{run['status'] or 'unknown'}{_mark(run)}" for run in runs])
    if not scored or len(runs) != 1 or controller == BASELINE:
        return text
    column = "violation_depth" if violated(runs[0]) else "utilization"
    value = 100.0 * runs[0][column]
    return f"{text} {number(value)}" if math.isfinite(value) else text


def _mark(run: Line) -> str:
    """Return the mark of a run that violated a row, see :data:`MARKS`."""
    if violated(run, "violated_tolerant"):
        return "†"
    return "‡" if violated(run) else ""


def anchor(scenario: str) -> str:
    """Return the anchor of a scenario's section, for links."""
    return quote(f"scenario-{scenario}")


def _complete(results: Results, names: Sequence[str]) -> list[bool]:
    """Return True for each controller that converged in every run in which any competitor did.

    All are False if there is only one competitor.
    """
    if sum(bool(results.all_runs(name)) for name in results.competitors) < 2:
        return [False] * len(names)
    converged = {}
    for name in results.competitors:
        runs = results.all_runs(name)
        converged[name] = {
            (run["scenario"], run["trial"]) for run in runs if run["status"] == "converged"
        }
    by_anyone = set().union(*converged.values())
    return [bool(by_anyone) and converged[name] == by_anyone for name in names]


def _overall(
    results: Results, names: Sequence[str], chosen: Callable[[Metric], bool]
) -> dict[str, list[str]]:
    """Return columns of the chosen metrics over all scenarios.

    Each is the worst or the median value, with the number of runs that have one.
    """
    columns = {}
    complete = _complete(results, names)
    for metric in METRICS:
        if not metric.overall or not chosen(metric):
            continue
        condense = largest if metric.condensed == "worst" else median
        cells = []
        eligible = []
        for name, is_complete in zip(names, complete, strict=True):
            runs = results.all_runs(name)
            if metric.condensed != "worst" and metric.kind != "time":
                runs = [run for run in runs if run["status"] == "converged"]
            values = [shown(metric, run) for run in runs]
            value = condense(values)
            digits = FORMATS[metric.style](value)
            known = sum(not math.isnan(each) for each in values)
            text = digits
            if digits != DASH and known < len(runs):
                text += f", {known} of {len(runs)}"
            cells.append(Cell(text, value, digits))
            eligible.append(is_complete and judged_by(metric, runs))
        columns[metric.overall] = marked(cells, eligible, _better(results, metric.better))
    return columns


def _better(results: Results, better: Better) -> Better:
    """Return ``better``, or None if the unconstrained baseline violates no row."""
    return better if results.challenged_scenarios else None
