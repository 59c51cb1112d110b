"""The table over all scenarios."""

from __future__ import annotations

import math

from ..comparisons.suite import BASELINE
from .best import Better, Cell, marked
from .markdown import bullets, table
from .numbers import DASH, Format, count, largest, mean, median, number, percent
from .results import CARRIED_THROUGH, Line, Results, violated

STATUSES = ("converged", "trapped", "aborted", "failed", "unfinished")


def summary(results: Results) -> str:
    """One line per controller, the best value of each column bold."""
    lines = {name: results.all_runs(name) for name in results.controllers}
    through = {name: sum(line["status"] in CARRIED_THROUGH for line in own) for name, own in lines.items()}
    most = max((through[name] for name in results.competitors), default=0)
    compared = sum(bool(lines[name]) for name in results.competitors) > 1
    eligible = [compared and name != BASELINE and 0 < through[name] == most for name in results.controllers]
    columns: list[tuple[str, Better | None, list[Cell]]] = [
        ("runs", None, [_count(len(own)) for own in lines.values()])
    ]
    for status in STATUSES:
        cells = [_count(sum(line["status"] == status for line in own)) for own in lines.values()]
        columns.append((status, "more" if status == "converged" else None, cells))
    columns += [
        ("mean utilization [%]", "more", [_mean(own, "utilization", percent) for own in lines.values()]),
        (
            "runs with a violated row",
            "less",
            [_count(sum(bool(violated(line)) for line in own)) for own in lines.values()],
        ),
        ("worst depth [% of L]", "less", [_worst_depth(own) for own in lines.values()]),
        ("worst φ band / bound", "less", [_worst_band(own) for own in lines.values()]),
        ("switching rate [Hz]", "less", [_mean(own, "switching_rate_hz") for own in lines.values()]),
        ("acceleration variation [rad/s³]", "less", [_mean(own, "acceleration_variation") for own in lines.values()]),
        ("median step time [µs]", "less", [_step_time(own) for own in lines.values()]),
    ]
    kept = [
        ok and not any(violated(line) for line in lines[name])
        for name, ok in zip(results.controllers, eligible, strict=True)
    ]
    texts = [
        marked(cells, kept if header.startswith("mean utilization") else eligible, better)
        for header, better, cells in columns
    ]
    body = [[name, *(text[i] for text in texts)] for i, name in enumerate(results.controllers)]
    return "\n\n".join(
        (
            "## All scenarios",
            table(["controller", *(header for header, _, _ in columns)], body),
            bullets(_legend(results)),
        )
    )


def _legend(results: Results) -> list[str]:
    return [
        f"**Bold** is the best of a column, judged by the digits shown; ties are all bold. More is better for "
        f"*converged* and *utilization*, less for the others; the other counts are not judged. {BASELINE} is the "
        "baseline without constraints and never marked, nor is a controller that carried fewer runs to their end "
        "(neither failed nor aborted) than another.",
        "*Mean* is over the runs that have a value, *worst* the greatest of all runs, *median step time* the median "
        f"over runs of each run's median. {DASH} stands where no run has a value: utilization needs a challenged "
        "row, the φ band a row that slides.",
        "Utilization counts a violated row as fully used: it is marked only for controllers that violated no row in "
        "any run, and to be read together with the two columns after it otherwise.",
        "Depth is relative to the row's characteristic length L. The φ band is compared with T_s u⁺ (43); up to 1 "
        "means chattering as small as the sampling time allows.",
    ]


def _count(value: int) -> Cell:
    return Cell(count(value), float(value), count(value))


def _mean(lines: list[Line], column: str, show: Format = number) -> Cell:
    value = mean([line[column] for line in lines])
    return Cell(show(value), value, show(value))


def _worst_depth(lines: list[Line]) -> Cell:
    deepest = 100.0 * largest([line["violation_depth"] for line in lines])
    return Cell(number(deepest), deepest, number(deepest))


def _worst_band(lines: list[Line]) -> Cell:
    worst = largest([band_ratio(line) for line in lines])
    return Cell(number(worst), worst, number(worst))


def _step_time(lines: list[Line]) -> Cell:
    value = median([line["step_time_median_us"] for line in lines])
    return Cell(number(value), value, number(value))


def band_ratio(line: Line) -> float:
    """The measured φ band relative to its bound; NaN where there is none."""
    bound = float(line["phi_band_bound"])
    return float(line["phi_band"]) / bound if math.isfinite(bound) and bound > 0.0 else math.nan
