"""Common parts of studies' figures: panels of measures and scenarios, lines and marks in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...reports.plots import INK, REFERENCE, Sheet, Style, darker, logarithmic
from ...reports.plots.style import LOOKS
from .tables import Point, Points, ended_early, grouped, scenario_title

BELOW_LEGEND = 0.15  #: Space between the legend and the panels [in].
#: Line style of bounds and references.
DASHED: Style = {"linestyle": REFERENCE["linestyle"], "linewidth": REFERENCE["linewidth"]}
#: Style of symbols that no line joins.
SYMBOLS: Style = {
    "linestyle": "none",
    "markersize": 7.5,
    "markeredgecolor": INK,
    "markeredgewidth": 0.5,
    "zorder": 3,
}
#: Style of a cross, besides its colour.
CROSS: Style = {
    "linestyle": "none",
    "marker": "x",
    "markersize": 6.0,
    "markeredgewidth": 1.4,
    "clip_on": False,
    "alpha": 1.0,
    "zorder": 5,
}


@dataclass(frozen=True, kw_only=True)
class Measure:
    """Vertical axis of a measure; it is logarithmic unless ``linear``.

    With a lower limit ``low``, the upper limit is ``headroom`` times that of the data, and at least
    ``top``.
    """

    label: str = ""
    ticks: tuple[float, ...] | None = None
    linear: bool = False
    linear_below: float | None = None  #: Value below which the axis is linear.
    level: float | None = None  #: Value to compare with.
    low: float | None = None
    top: float = 0.0
    headroom: float = 1.0

    def finish(self, ax: Any) -> None:
        """Set the scale and the limits; call it after drawing."""
        if not self.linear:
            logarithmic(ax.yaxis, self.ticks, self.linear_below)
        if self.level is not None:
            ax.axhline(self.level, **REFERENCE)
        if self.low is not None:
            reached = self.headroom * ax.get_ylim()[1]
            ax.set_ylim(self.low, max(reached, self.top))


@dataclass(frozen=True)
class Panel:
    """Axes of a measure in a scenario, with the points of this scenario."""

    ax: Any
    measure: str
    scenario: str
    points: Points


def add_panels(
    sheet: Sheet,
    points: Points,
    measures: Mapping[str, Measure],
    below: str,
    *,
    height: float,
    gap: float,
) -> list[Panel]:
    """Add a row of panels for each measure, with one panel for each scenario.

    ``below`` is the label of the horizontal axis. Lengths are in inches.
    """
    sheet.bottom += BELOW_LEGEND
    by_scenario = grouped(points, "scenario")
    axes = sheet.panels(
        len(measures) * len(by_scenario),
        len(by_scenario),
        height=height,
        gap=gap,
        labels=(below, ""),
    )
    for scenario, ax in zip(by_scenario, axes, strict=False):
        ax.set_title(scenario_title(scenario))
    for first, measure in zip(axes[:: len(by_scenario)], measures.values(), strict=True):
        first.set_ylabel(measure.label)
    panels: list[Panel] = []
    for name in measures:
        for scenario, of_scenario in by_scenario.items():
            panels.append(Panel(axes[len(panels)], name, scenario, of_scenario))
    return panels


def style_of(label: str, color: str = INK, **more: Any) -> Style:
    """Return the style of a series; its symbols have edges in a darker colour."""
    style = {"label": label, "color": color, "linewidth": 1.4, "markersize": 5.0}
    return {**style, "markeredgecolor": darker(color), "markeredgewidth": 0.6, **more}


def law_style(law: str, **more: Any) -> Style:
    """Return the style of a law, with its usual colour and symbol."""
    usual = LOOKS[law]
    return style_of(law, usual.colour, marker=usual.marker, **more)


def shown(points: Iterable[Point], column: str) -> Points:
    """Return points with a finite value; failed runs are shown where the data have an outcome."""
    return [
        point
        for point in points
        if math.isfinite(point[column]) and ("outcome" in point or not ended_early(point))
    ]


def draw_line(
    ax: Any, points: Points, x: str, y: str, style: Style, least: float = -math.inf
) -> None:
    """Draw points from left to right, joined by lines.

    ``x`` and ``y`` are columns. Smaller horizontal values than ``least`` are drawn at ``least``.
    """
    finite = [point for point in shown(points, y) if math.isfinite(point[x])]
    pairs = sorted((max(point[x], least), point[y]) for point in finite)
    ax.plot(*np.array(pairs).reshape(-1, 2).T, **style)


def draw_levels(ax: Any, points: Points, y: str, style: Style) -> None:
    """Draw a line across the panel at the value of each point."""
    for point in shown(points, y):
        ax.axhline(point[y], **style)


def draw_crosses(ax: Any, points: Points, x: str, style: Style, shift: float = 0.0) -> None:
    """Draw crosses near the upper edge for runs that failed or were aborted."""
    values = [point[x] + shift for point in points if ended_early(point)]
    heights = [0.92] * len(values)
    cross = {**style, **CROSS, "markeredgecolor": style["color"]}
    ax.plot(values, heights, transform=ax.get_xaxis_transform(), **cross)
