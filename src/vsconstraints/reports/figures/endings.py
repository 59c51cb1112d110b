"""How every scenario ended with every controller: a heat map."""

from __future__ import annotations

import math

import numpy as np

from ..numbers import largest, median, number
from ..plots import Sheet
from ..results import Line, Results, clean, violated
from .heat_map import HeatMap, draw_heat_map

LETTERS = {"slow": "S", "trapped": "T", "aborted": "A", "failed": "F", "unfinished": "U"}
"""Of statuses, where words have no room."""

NARROW = 9
"""More columns than these have room for short texts only."""

UNUSED = (1e-4, 0.3)
"""Shares of the allowed space left unused where the colours of runs that stayed inside end."""

SCALE = ("far outside", "inside, all of the space used")

DEPTHS = (1e-4, 0.3)
"""Shares of L outside where the colours of runs that did not end."""


def draw_endings(results: Results) -> Sheet | None:
    """Scenarios by controllers, or the other way round where there are more controllers."""
    laws, scenarios = results.competitors, results.scenarios
    cells = [[results.runs(scenario, law) for law in laws] for scenario in scenarios]
    rows, columns = scenarios, laws
    if len(laws) > len(scenarios):
        rows, columns, cells = laws, scenarios, [list(line) for line in zip(*cells, strict=True)]
    values = np.array([[worth(list(own)) for own in line] for line in cells]).reshape(len(rows), len(columns))
    texts = [[told(list(own), len(columns) > NARROW) for own in line] for line in cells]
    return draw_heat_map(HeatMap(rows, columns, values, texts, SCALE))


def worth(lines: list[Line]) -> float:
    """From 0 to 1: the mean of the trials, but below 1/2 if any was not done inside the limits; NaN of no run."""
    if not lines:
        return math.nan
    mean = sum(map(_worth, lines)) / len(lines)
    return mean if all(map(clean, lines)) else min(mean, 0.48)


def _worth(line: Line) -> float:
    """Inside the limits, from 0.65 by the room used; without reaching the goal 0.4; outside, less by how deep."""
    depth, unused = line["violation_depth"], 1.0 - line["utilization"]
    if not clean(line):
        return 0.4 if depth == 0.0 else 0.25 * (1.0 - _share(depth, *DEPTHS)) if math.isfinite(depth) else 0.0
    return 0.65 + 0.35 * (1.0 - _share(unused, *UNUSED)) if math.isfinite(unused) else 0.75


def _share(value: float, least: float, greatest: float) -> float:
    """Where a value is between two others on a logarithmic scale, from 0 to 1."""
    return float(np.clip(math.log(max(value, least) / least) / math.log(greatest / least), 0.0, 1.0))


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
