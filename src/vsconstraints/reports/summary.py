"""The tables over all scenarios: the one that a report begins with, how runs ended, and further scores."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ..comparisons.metrics import METRICS, NEGLIGIBLE, TOLERANCES, TOLERANT, Metric
from .best import Better, Cell, judged_by, marked, shown
from .markdown import bullets, tables
from .numbers import DASH, FORMATS, count, largest, median, of_length
from .results import DIVERGED, Line, Results, diverged, violated

STATUSES = ("converged", "slow", "trapped", "unfinished", "aborted", "failed")

CONDENSED: dict[str, Callable[[Sequence[float]], float]] = {"worst": largest, "median": median}
"""What stands for the values of several runs."""

FIRST = ("violation_depth", "utilization", "acceleration_variation", "step_time_median_us")
"""What the table that a report begins with has of the metrics."""

MOST_COLUMNS = 8
"""Of that table."""

Column = tuple[str, list[str]]


def law_table(results: Results) -> str:
    """What matters most of each law, best first, in at most :data:`MOST_COLUMNS` columns; what is best is bold."""
    names, columns = law_columns(results)
    return _table(names, columns)


def law_columns(results: Results) -> tuple[list[str], list[Column]]:
    """The laws in the order of that table, and its columns: what stands above each, and a text for each law."""
    names = results.competitors
    runs = [len(results.all_runs(name)) for name in names]
    good = [
        Cell(f"{n} of {of}", float(n) if of else math.nan, str(n))
        for n, of in zip(results.clean.values(), runs, strict=True)
    ]
    tolerant = [
        Cell(str(n), float(n) if of else math.nan, str(n))
        for n, of in zip(results.clean_tolerant.values(), runs, strict=True)
    ]
    scores = dict(_column(results, one) for one in METRICS if one.overall and one.column in FIRST)
    columns = [
        ("converged inside", marked(good, [True] * len(names), _better(results, "more"))),
        (f"at {of_length(TOLERANT)}", marked(tolerant, [True] * len(names), _better(results, "more"))),
        *scores.items(),
        ("form", [results.form(name) for name in names]),
    ]
    order = sorted(range(len(names)), key=lambda i: (-results.clean[names[i]], -results.clean_tolerant[names[i]]))
    return [names[i] for i in order], [(header, [texts[i] for i in order]) for header, texts in columns]


FIRST_LEGEND = (
    "*Converged inside*: runs that converged and violated no row, by the strict standard: none was deeper outside than "
    f"{of_length(NEGLIGIBLE)}; beside it by the tolerant one, {of_length(TOLERANT)}. Medians are of the runs that "
    "converged, those of times of all. **Bold** is the best of a column where no other value in it is better; in "
    "parentheses is what is not compared, since the law did not converge in every run in which another one did, or "
    "violated a row, strictly. Times are not compared: *form* says what they are times of."
)


def summary(results: Results) -> str:
    """How all runs ended, and the scores that the first table does not have."""
    legend = [
        f"*Diverged*: did not converge, and was outside by more than {100.0 * DIVERGED:g} % of L. These runs are "
        "counted under their status, too.",
        "*Worst* is the greatest of all runs. Medians are of the runs that converged, and say of how many if not all "
        f"of these have a value; {DASH} stands where none has: the φ band needs a row at its boundary, utilization a "
        "row that tracking alone violates.",
        "**Bold** is the best of a column, judged by the digits shown; ties are all bold. Nothing is bold where "
        "another value of the column is better, nor where all are alike. In parentheses is what is not compared: "
        "that of a controller that did not converge in every run in which another one did. Only controllers that "
        "violated no row in the runs concerned are compared in other columns than those of violations, and only "
        "those that never lost a sliding mode by their φ band.",
        "Depth is relative to the row's characteristic length L. A row is violated if it is deeper outside than "
        f"{of_length(NEGLIGIBLE)}; of the runs in which one is, those are counted where one is deeper than "
        f"{of_length(TOLERANT)}, and those where none is deeper than its sampling band T_s u⁺, which excuses nobody.",
        "The φ band is compared with T_s u⁺ (43): up to 1 "
        "means chattering as small as the sampling time allows, and much more that a sliding mode was lost.",
    ]
    return "\n\n".join(
        text
        for text in ("## All scenarios", _endings(results), _scores(results), bullets(legend), _by_tolerance(results))
        if text
    )


def _endings(results: Results) -> str:
    """How many runs of each controller ended how; tracking alone, too."""
    lines = {name: results.all_runs(name) for name in results.controllers}
    columns: list[Column] = [("runs", [str(len(own)) for own in lines.values()])]
    for status in STATUSES:
        columns.append((status, [str(sum(line["status"] == status for line in own)) for own in lines.values()]))
    columns.append(("diverged", [str(sum(diverged(line) for line in own)) for own in lines.values()]))
    return _table(results.controllers, columns)


def _scores(results: Results) -> str:
    if not results.competitors:
        return ""
    lines = {name: results.all_runs(name) for name in results.competitors}
    outside = [_count(sum(bool(violated(line)) for line in own)) for own in lines.values()]
    beyond = [_count(sum(bool(violated(line, "violated_tolerant")) for line in own)) for own in lines.values()]
    columns: list[Column] = [
        ("runs with a violated row", marked(outside, _whole(results), _better(results, "less"))),
        (f"beyond {of_length(TOLERANT)}", marked(beyond, _whole(results), _better(results, "less"))),
        ("within the sampling band", [str(sum(map(_within_band, own))) for own in lines.values()]),
    ]
    columns += [_column(results, metric) for metric in METRICS if metric.overall and metric.column not in FIRST]
    return _table(results.competitors, columns)


def _within_band(line: Line) -> bool:
    """Whether a run violated rows, each by no more than its sampling band."""
    return bool(violated(line)) and violated(line) == violated(line, "within_band")


def _by_tolerance(results: Results) -> str:
    """How many runs of each law are successes at each tolerance."""
    if not results.competitors:
        return ""
    lines = []
    for name in results.competitors:
        depths = [line["violation_fraction"] for line in results.all_runs(name) if line["status"] == "converged"]
        lines.append([name, *(str(sum(depth <= tolerance for depth in depths)) for tolerance in TOLERANCES)])
    told = "Runs that converged with no row deeper outside than the head of the column says, in % of L:"
    return f"{told}\n\n" + tables(["controller", *(f"{100.0 * one:g} %" for one in TOLERANCES)], lines)


def _whole(results: Results) -> list[bool]:
    """Who converged in every run in which anybody that is compared did; nobody if there is only one."""
    goals = {
        name: {(line["scenario"], line["trial"]) for line in results.all_runs(name) if line["status"] == "converged"}
        for name in results.competitors
    }
    anyone = set().union(*goals.values())
    several = sum(bool(results.all_runs(name)) for name in results.competitors) > 1
    return [several and bool(anyone) and own == anyone for own in goals.values()]


def _column(results: Results, metric: Metric) -> Column:
    """A metric over all scenarios, of each controller that is compared."""
    cells, may = [], []
    for name, whole in zip(results.competitors, _whole(results), strict=True):
        lines = results.all_runs(name)
        if metric.condensed != "worst" and metric.kind != "time":
            lines = [line for line in lines if line["status"] == "converged"]
        cells.append(_cell(metric, lines))
        may.append(whole and judged_by(metric, lines))
    return metric.overall, marked(cells, may, _better(results, metric.better))


def _better(results: Results, better: Better | None) -> Better | None:
    """What nobody challenges crowns no winner."""
    return better if results.challenged_scenarios else None


def _cell(metric: Metric, lines: list[Line]) -> Cell:
    """One value of several runs; if it does not rest on all of them, with how many it rests on."""
    values = [shown(metric, line) for line in lines]
    value = CONDENSED[metric.condensed](values)
    text, rests_on = FORMATS[metric.style](value), sum(v == v for v in values)
    return Cell(text if text == DASH or rests_on == len(lines) else f"{text}, {rests_on} of {len(lines)}", value, text)


def _count(value: int) -> Cell:
    return Cell(count(value), float(value), count(value))


def _table(names: Sequence[str], columns: Sequence[Column]) -> str:
    lines = [[name, *(texts[i] for _, texts in columns)] for i, name in enumerate(names)]
    return tables(["controller", *(header for header, _ in columns)], lines)
