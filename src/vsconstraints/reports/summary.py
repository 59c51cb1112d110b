"""The table over all scenarios."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..comparisons.metrics import METRICS, Metric
from ..comparisons.suite import BASELINE
from .best import Cell, judged_by, marked, shown
from .markdown import bullets, table
from .numbers import DASH, FORMATS, count, largest, mean, median
from .results import Line, Results, violated, within_band

STATUSES = ("converged", "trapped", "aborted", "failed", "unfinished")

CONDENSED: dict[str, Callable[[Sequence[float]], float]] = {"mean": mean, "worst": largest, "median": median}
"""What stands for the values of several runs."""


def summary(results: Results) -> str:
    """One line per controller, the best value of each column bold."""
    lines = {name: results.all_runs(name) for name in results.controllers}
    reached = {name: [line for line in own if line["status"] == "converged"] for name, own in lines.items()}
    goals = {name: {(line["scenario"], line["trial"]) for line in own} for name, own in reached.items()}
    anyone = set().union(*(goals[name] for name in results.competitors))
    several = sum(bool(lines[name]) for name in results.competitors) > 1
    whole = [several and name != BASELINE and bool(anyone) and goals[name] == anyone for name in results.controllers]
    columns: list[tuple[str, list[str]]] = [("runs", [str(len(own)) for own in lines.values()])]
    for status in STATUSES:
        cells = [_count(sum(line["status"] == status for line in own)) for own in lines.values()]
        competes = [several and name != BASELINE and bool(reached[name]) for name in results.controllers]
        columns.append((status, marked(cells, competes, "more") if status == "converged" else [c.text for c in cells]))

    for metric in METRICS:
        if metric.overall:
            runs = reached if metric.condensed == "mean" else lines
            cells = [_cell(metric, own, len(lines[name])) for name, own in runs.items()]
            may = [ok and judged_by(metric, runs[name]) for name, ok in zip(results.controllers, whole, strict=True)]
            columns.append((metric.overall, marked(cells, may, metric.better)))
        if metric.column == "violated":
            columns += _violations(list(lines.values()), whole)
    body = [[name, *(texts[i] for _, texts in columns)] for i, name in enumerate(results.controllers)]
    return "\n\n".join(
        (
            "## All scenarios",
            table(["controller", *(header for header, _ in columns)], body),
            bullets(_legend()),
        )
    )


def _legend() -> list[str]:
    return [
        "**Bold** is the best of a column, judged by the digits shown; ties are all bold. More is better for "
        "*converged* and *utilization*, less for the others. In parentheses is what is not compared: the baseline's "
        f"({BASELINE}), and that of a controller that did not converge in every run in which another one did. Only "
        "controllers that violated no row in the runs concerned are compared in other columns than those of "
        "violations, only those that never lost a sliding mode by their φ band, and nobody by times or by the other "
        "counts.",
        "*Mean* is over the runs that converged, *worst* the greatest and *median* the median of all runs; where fewer "
        f"runs than all have a value, it says of how many. {DASH} stands where no run has one: utilization needs a "
        "row that acts, the φ band a row at its boundary.",
        "Depth is relative to the row's characteristic length L. The φ band is compared with T_s u⁺ (43): up to 1 "
        "means chattering as small as the sampling time allows, and much more that a sliding mode was lost.",
    ]


def _count(value: int) -> Cell:
    return Cell(count(value), float(value), count(value))


def _violations(lines: list[list[Line]], whole: list[bool]) -> list[tuple[str, list[str]]]:
    """Two columns: how many runs of each controller violate a row, and how many more are outside by sampling."""
    outside = [_count(sum(bool(violated(line)) for line in own)) for own in lines]
    slight = [str(sum(not violated(line) and bool(within_band(line)) for line in own)) for own in lines]
    return [
        ("runs with a violated row", marked(outside, whole, "less")),
        ("others outside within the sampling band", slight),
    ]


def _cell(metric: Metric, lines: list[Line], runs: int) -> Cell:
    """One value of several runs; if it does not rest on all of a controller's runs, with how many it rests on."""
    values = [shown(metric, line) for line in lines]
    value = CONDENSED[metric.condensed](values)
    text, rests_on = FORMATS[metric.style](value), sum(v == v for v in values)
    return Cell(text if text == DASH or rests_on == runs else f"{text}, {rests_on} of {runs}", value, text)
