"""How every scenario ended with every controller: a heat map."""

from __future__ import annotations

import math

import numpy as np

from ...figures import Sheet
from ..numbers import largest, median, number
from ..results import Line, Results, clean, violated
from .heat_map import HeatMap, draw_heat_map

LETTERS = {"trapped": "T", "aborted": "A", "failed": "F", "unfinished": "U"}
"""Of statuses, where words have no room."""

NARROW = 9
"""More columns than these have room for short texts only."""

LEAST_UNUSED, MOST_UNUSED = 1e-4, 0.3
"""Shares of the allowed space left unused where the colours of runs that stayed inside end."""

DEEP = 0.3
"""Share of L by which the worst colour is outside."""


def draw_endings(results: Results) -> Sheet | None:
    """Scenarios by controllers, or the other way round where there are more controllers."""
    laws, scenarios = results.competitors, results.scenarios
    cells = [[results.runs(scenario, law) for law in laws] for scenario in scenarios]
    rows, columns = scenarios, laws
    if len(laws) > len(scenarios):
        rows, columns, cells = laws, scenarios, [list(line) for line in zip(*cells, strict=True)]
    values = np.array([[worth(list(own)) for own in line] for line in cells]).reshape(len(rows), len(columns))
    texts = [[told(list(own), len(columns) > NARROW) for own in line] for line in cells]
    return draw_heat_map(HeatMap(rows, columns, values, texts, ("far outside", "inside, all of the space used")))


def worth(lines: list[Line]) -> float:
    """From 0 to 1: below 1/2 what was not done inside the limits in every trial, above it by how much room was used."""
    if not lines:
        return math.nan
    good, depth = sum(map(clean, lines)) / len(lines), largest([line["violation_depth"] for line in lines])
    if good < 1.0:
        outside = min(depth / DEEP, 1.0) if math.isfinite(depth) else 1.0
        return 0.1 + 0.3 * good - 0.1 * outside + 0.05 * all(line["status"] == "converged" for line in lines)
    unused = 1.0 - median([line["utilization"] for line in lines])
    if not math.isfinite(unused):
        return 0.75
    share = math.log(max(unused, LEAST_UNUSED) / MOST_UNUSED) / math.log(LEAST_UNUSED / MOST_UNUSED)
    return 0.65 + 0.35 * min(max(share, 0.0), 1.0)


def told(lines: list[Line], narrow: bool = False) -> str:
    """Utilization of what was done inside the limits [%]; otherwise the status and the depth outside [% of L]."""
    if not lines:
        return ""
    good = sum(map(clean, lines))
    depth = largest([line["violation_depth"] for line in lines if violated(line)])
    outside = f"†{_digits(100.0 * depth, narrow)}" if math.isfinite(depth) else ""
    if good == len(lines):
        used = median([line["utilization"] for line in lines])
        return (f"{100.0 * used:.0f}" if narrow else f"{100.0 * used:.2f}") if math.isfinite(used) else "✓"
    if len(lines) > 1:
        return f"{good}/{len(lines)}" if narrow else f"{good} of {len(lines)} {outside}".strip()
    return f"{LETTERS.get(lines[0]['status'], '')}{outside}"


def _digits(value: float, narrow: bool) -> str:
    return f"{value:.0f}" if narrow else number(value)
