"""Tables over all scenarios of a comparison: summary, outcomes, scores and violations."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Sequence
from urllib.parse import quote

from ..comparisons.metrics import NEGLIGIBLE, TOLERANT, Metric, run_metrics
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
    shown_values,
    tally,
    violated,
)

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

    def success(name: str) -> tuple[int, int]:
        return results.clean[name], results.clean_tolerant[name]

    names = sorted(results.competitors, key=success, reverse=True)
    strict = []
    tolerant = []
    for name in names:
        run_count = len(results.all_runs(name))
        count = results.clean[name]
        cell = Cell(_rate_text(results, count, run_count), count, str(count))
        tolerant_count = results.clean_tolerant[name]
        tolerant_cell = Cell(str(tolerant_count), tolerant_count, str(tolerant_count))
        if not run_count:
            cell = cell._replace(value=math.nan)
            tolerant_cell = tolerant_cell._replace(value=math.nan)
        strict.append(cell)
        tolerant.append(tolerant_cell)
    eligible = [True] * len(names)
    better = _better(results, "more")
    columns = {
        "converged inside": marked(strict, eligible, better),
        f"at {of_length(TOLERANT)}": marked(tolerant, eligible, better),
    }
    columns |= _overall(results, names, lambda metric: metric.column in FIRST)
    columns[IMPLEMENTATION] = [results.implementation(name) for name in names]
    return columns_table("controller", names, columns)


def _rate_text(results: Results, count: int, run_count: int) -> str:
    if results.trials == 1:
        return f"{count} of {run_count}"
    # The import takes longer than all other imports of a report.
    from ..comparisons.rates import rate_of, rate_text

    return rate_text(rate_of(count, run_count))


def score_table(results: Results) -> Table:
    """Return violations, and the scores that are not in the first table."""
    names = results.competitors

    def violation_counts(column: str) -> list[str]:
        cells = []
        for name in names:
            count = sum(bool(violated(run, column)) for run in results.all_runs(name))
            cells.append(Cell(str(count), count, str(count)))
        return marked(cells, _complete(results, names), _better(results, "less"))

    within_band = []
    for name in names:
        count = 0
        for run in results.all_runs(name):
            rows = violated(run)
            if rows and rows == violated(run, "within_band"):
                count += 1
        within_band.append(str(count))
    beyond = f"beyond {of_length(TOLERANT)}"
    columns = {
        "runs with a violated row": violation_counts("violated"),
        beyond: violation_counts("violated_tolerant"),
        "within the sampling band": within_band,
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

    def relative_depth(run: Line) -> float:
        return float(run["violation_depth"])

    worst = max(runs, key=relative_depth)
    rows = []
    for row in results.rows(worst["scenario"], controller):
        natural_depth = row["violation_depth"]
        if row["trial"] == worst["trial"] and natural_depth > 0.0:
            rows.append(row)
    if not rows:
        return runs, worst, DASH
    deepest = max(rows, key=lambda row: float(row["usage_max"]))
    return runs, worst, code(deepest["constraint"])


def scenarios_won(results: Results, metric: Metric) -> dict[str, list[str]]:
    """Return the scenarios that each controller wins, with its value.

    A scenario has no winner if all values are equal as printed.
    """
    show = FORMATS[metric.style]
    choose = max if metric.better == "more" else min
    won = defaultdict[str, list[str]](list)
    for scenario in results.challenged_scenarios:
        values = {}
        texts = {}
        for name in results.solvers(scenario):
            value = median(shown_values(metric, results.runs(scenario, name)))
            if math.isfinite(value):
                values[name] = value
                texts[name] = show(value)
        if len(set(texts.values())) < 2:
            continue
        best = show(choose(values.values()))
        for name, text in texts.items():
            if text == best:
                won[name].append(f"{scenario} ({best})")
    return won


def unsolved(results: Results) -> dict[str, str]:
    """Return the scenarios that no controller solved, with the reason if it is known."""
    reasons = {}
    for scenario in results.scenarios:
        run_reasons = []
        for name in results.competitors:
            run_reasons += [run["reason"] for run in results.runs(scenario, name)]
        if not run_reasons or results.solvers(scenario):
            continue
        warnings = results.stored.warnings.get(scenario, ())
        all_report = all(UNSOLVABLE in reason for reason in run_reasons)
        if all_report or any(UNSOLVABLE in warning for warning in warnings):
            reasons[scenario] = "constraints close off a marker from its goal"
        elif obstacles(results, scenario):
            reasons[scenario] = PERHAPS
        else:
            reasons[scenario] = ""
    return reasons


def obstacles(results: Results, scenario: str) -> list[str]:
    """Return the warnings that a scenario may be unsolvable for every controller.

    Questions about units and goals that could not be checked are left out.
    """
    warnings = results.stored.warnings.get(scenario, ())
    return [text for text in warnings if OF_A_GOAL.match(text) or UNSOLVABLE in text]


def warning_counts(results: Results) -> dict[str, int]:
    """Return the number of warnings of each scenario that has any."""
    counts = {}
    for name, warnings in results.stored.warnings.items():
        if warnings and name in results.scenarios:
            counts[name] = len(warnings)
    return counts


def outcome(results: Results, scenario: str, controller: str, scored: bool = False) -> str:
    """Format the outcomes of a controller on a scenario.

    With ``scored`` a single run also has its utilization [%], or its violation depth [% of L].
    """
    runs = results.runs(scenario, controller)
    endings = []
    for run in runs:
        status = run["status"] or "unknown"
        endings.append(status + _mark(run))
    text = tally(endings)
    if not scored or len(runs) != 1 or controller == BASELINE:
        return text
    (run,) = runs
    share = run["violation_depth"] if violated(run) else run["utilization"]
    value = 100.0 * share
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
    converged: dict[str, set[tuple[str, int]]] = {}
    for name in results.competitors:
        runs = results.all_runs(name)
        if not runs:
            continue
        converged[name] = set()
        for run in runs:
            if run["status"] == "converged":
                converged[name].add((run["scenario"], run["trial"]))
    by_anyone = set().union(*converged.values())
    if len(converged) < 2 or not by_anyone:
        return [False] * len(names)
    return [converged.get(name) == by_anyone for name in names]


def _overall(
    results: Results, names: Sequence[str], chosen: Callable[[Metric], bool]
) -> dict[str, list[str]]:
    """Return columns of the chosen metrics over all scenarios.

    Each is the worst or the median value, with the number of runs that have one.
    """
    columns = {}
    complete = _complete(results, names)
    for metric in run_metrics():
        if not metric.overall or not chosen(metric):
            continue
        condense = largest if metric.condensed == "worst" else median
        cells = []
        eligible = []
        for name, is_complete in zip(names, complete, strict=True):
            runs = results.all_runs(name)
            if metric.condensed != "worst" and metric.kind != "time":
                runs = [run for run in runs if run["status"] == "converged"]
            values = shown_values(metric, runs)
            overall = condense(values)
            digits = FORMATS[metric.style](overall)
            known = sum(not math.isnan(value) for value in values)
            text = digits
            if digits != DASH and known < len(runs):
                text += f", {known} of {len(runs)}"
            cells.append(Cell(text, overall, digits))
            eligible.append(is_complete and judged_by(metric, runs))
        columns[metric.overall] = marked(cells, eligible, _better(results, metric.better))
    return columns


def _better(results: Results, better: Better) -> Better:
    """Return ``better``, or None if the unconstrained baseline violates no row."""
    return better if results.challenged_scenarios else None
