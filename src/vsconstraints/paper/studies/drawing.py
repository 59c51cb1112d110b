"""Figures of studies: panels of measures and scenarios, and layers of series drawn into them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from ...reports.plots import INK, REFERENCE, Sheet, darker, logarithmic, widths
from ...reports.plots.style import LOOKS
from .tables import Numbers, Points, about, ended_early, grouped, scenario_title, where

Look = Mapping[str, Any]  #: Style of a series, as arguments of matplotlib.


@dataclass(frozen=True, kw_only=True)
class Measure:
    """Vertical axis of the panels of a measure; it is logarithmic unless ``linear``."""

    label: str = ""
    title: str = ""
    ticks: Sequence[float] | None = None
    below: Sequence[float] | None = None  #: Ticks of the horizontal axis.
    linear: bool = False
    linear_below: float | None = None  #: Value below which the axis is linear.
    level: float | None = None  #: Value to compare with.
    low: float | None = None  #: Lower limit; with it, ``headroom`` and ``top`` count.
    top: float = 0.0  #: Least upper limit.
    headroom: float = 1.0  #: Upper limit, relative to that of the data.
    margin: float | None = None
    same: bool = False  #: True if all panels have the same upper limit.
    #: Measures that replace this one in the panels of some scenarios.
    by_scenario: Mapping[str, Measure] = field(default_factory=dict)

    def of(self, scenario: str | None) -> Measure:
        """Return the measure for a scenario."""
        return self.by_scenario.get(scenario or "", self)


@dataclass(frozen=True, kw_only=True)
class Layer:
    """Points joined by lines: one series for each value of the column ``by``, or one of all.

    The style is that of a law or given by the figure's looks, by ``palette`` and by ``look``.
    """

    by: str = ""
    on: tuple[str, ...] = ()  #: Measures into whose panels it is drawn; empty: all.
    y: str = ""  #: Column of vertical values; empty: the measure.
    where: Mapping[str, Any] = field(default_factory=dict)  #: Values of columns of its points.
    without: Mapping[str, Any] = field(default_factory=dict)  #: Values that its points lack.
    #: Columns by which numbers are taken instead of points.
    about: tuple[str, ...] = ()
    look: Look = field(default_factory=dict)
    reference: bool = False  #: True if dashed.
    least: float = -math.inf  #: Smaller horizontal values are drawn here.
    palette: Sequence[tuple[str, str]] = ()  #: Colours and markers, in order of the series.
    widths: tuple[float, float] | None = None  #: Widths of the first and the last line.

    def points(self, points: Points, numbers: Numbers) -> Points:
        """Return the points that the layer shows."""
        if self.about:
            points = numbers_as_points(numbers, self.about)
        chosen = where(points, **self.where)
        if not self.without:
            return chosen
        left_out = where(chosen, **self.without)
        return [point for point in chosen if point not in left_out]

    def base_look(self, k: int, name: str, looks: Mapping[str, Look]) -> dict[str, Any]:
        """Return the style of series k before that of the layer."""
        look = {"linewidth": 1.4, "color": INK, "markersize": 5.0, "label": scenario_title(name)}
        look |= looks.get(name, {})
        if law := LOOKS.get(str(look.pop("law", name))):
            look |= {"color": law.colour, "marker": law.marker}
        if self.palette:
            look["color"], look["marker"] = self.palette[k]
        edge = {"markeredgecolor": darker(str(look["color"])), "markeredgewidth": 0.6}
        return {**edge, **look}

    def series(
        self, points: Points, numbers: Numbers, looks: Mapping[str, Look]
    ) -> Iterator[Series]:
        """Yield the series, in the order of the figure's looks if these name them."""
        selected = self.points(points, numbers)
        groups = grouped(selected, self.by) if self.by else {"": selected}
        names = [name for name in looks if name in groups]
        names = names or [name for name in groups if name or not self.by]
        thinner = widths(names, *self.widths) if self.widths else {}
        for k, name in enumerate(names):
            look = self.base_look(k, name, looks)
            if thinner:
                look["linewidth"] = thinner[name]
            if self.reference:
                look |= {key: REFERENCE[key] for key in ("linestyle", "linewidth")}
            yield Series(name, groups[name], {**look, **self.look}, self)

    def draw(self, ax: Any, series: Series, points: Points, x: str, y: str) -> None:
        """Draw points of a series with their columns ``x`` and ``y`` into axes."""
        finite = [point for point in shown(points, y) if math.isfinite(point[x])]
        pairs = sorted((max(point[x], self.least), point[y]) for point in finite)
        ax.plot(*np.array(pairs).reshape(-1, 2).T, **series.look)


class Level(Layer):
    """A line across the panel at the value of each point."""

    def draw(self, ax: Any, series: Series, points: Points, x: str, y: str) -> None:
        """See :class:`Layer`."""
        for point in shown(points, y):
            ax.axhline(point[y], **series.look)


class Shaded(Layer):
    """Shades all horizontal values below a column of each point."""

    def base_look(self, k: int, name: str, looks: Mapping[str, Look]) -> dict[str, Any]:
        """Return no style: an area has no line."""
        return {}

    def draw(self, ax: Any, series: Series, points: Points, x: str, y: str) -> None:
        """See :class:`Layer`."""
        for point in shown(points, y):
            ax.axvspan(point[y], 1e-9, **series.look)


#: Style of a cross, besides its colour.
CROSS: Look = {
    "linestyle": "none",
    "marker": "x",
    "markersize": 6.0,
    "markeredgewidth": 1.4,
    "clip_on": False,
    "zorder": 5,
}


@dataclass(frozen=True, kw_only=True)
class Crosses(Layer):
    """Crosses near the upper edge for runs that failed or were aborted."""

    shift: Mapping[str, float] = field(default_factory=dict)  #: To the right, by series.

    def draw(self, ax: Any, series: Series, points: Points, x: str, y: str) -> None:
        """See :class:`Layer`."""
        shift = self.shift.get(series.name, 0.0)
        values = [point[x] + shift for point in points if ended_early(point)]
        look = {**series.look, **CROSS, "markeredgecolor": series.look["color"]}
        ax.plot(values, [0.92] * len(values), transform=ax.get_xaxis_transform(), **look)


class Edge(Layer):
    """A symbol at the left edge for each point."""

    def draw(self, ax: Any, series: Series, points: Points, x: str, y: str) -> None:
        """See :class:`Layer`."""
        values = [point[y] for point in shown(points, y)]
        ax.plot([0.02] * len(values), values, transform=ax.get_yaxis_transform(), **series.look)


class Distribution(Layer):
    """Values against the share of points with smaller values; missing values count as infinite."""

    def draw(self, ax: Any, series: Series, points: Points, x: str, y: str) -> None:
        """See :class:`Layer`."""
        values = [point[y] for point in shown(points, y)]
        if values:
            missing = [math.inf] * (len(points) - len(values))
            ax.ecdf(values + missing, orientation="horizontal", **series.look)


@dataclass(frozen=True)
class Series:
    """Points of a layer that have the same style."""

    name: str
    points: Points
    look: Look
    layer: Layer


def numbers_as_points(numbers: Numbers, columns: Sequence[str]) -> Points:
    """Return numbers as points, one for each subject that has values of these columns."""
    points = []
    for subject in dict.fromkeys(key[:-1] for key in numbers if len(key) == len(columns) + 1):
        point: dict[str, Any] = dict(zip(columns, subject, strict=True))
        point["status"] = ""
        for name, value in about(numbers, *subject).items():
            point[str(name)] = value
        points.append(point)
    return points


def shown(points: Iterable[dict[str, Any]], column: str) -> Points:
    """Return points with a finite value; failed runs are shown where the data have an outcome."""
    return [
        point
        for point in points
        if math.isfinite(point[column]) and ("outcome" in point or not ended_early(point))
    ]


@dataclass(frozen=True, kw_only=True)
class SweepFigure:
    """Figure of a study: a legend, and below it a row of panels for each measure.

    A row has one panel for each scenario. With ``columns``, each measure has one panel, and so many
    panels form a row. Lengths are in inches.
    """

    measures: Mapping[str, Measure]
    layers: Sequence[Layer]
    looks: Mapping[str, Look] = field(default_factory=dict)  #: Styles of series, by name.
    x: str = ""  #: Column of the horizontal axis.
    below: str = ""  #: Label of the horizontal axis.
    ticks: Sequence[float] | None = None  #: The horizontal axis is logarithmic if there are any.
    names: Sequence[str] = ()  #: Texts at the ticks.
    limits: tuple[float | None, float] | None = None  #: First limit None: that of the data.
    margin: float | None = None
    columns: int = 0
    left: float = 0.75
    height: float = 1.5
    gap: float = 0.7
    above: float = 0.15  #: Space between legend and panels.
    legend: int = 3  #: Columns of the legend.

    def draw(self, points: Points, numbers: Numbers) -> Sheet:
        """Draw the figure from a study's points and numbers."""
        every = [
            series for layer in self.layers for series in layer.series(points, numbers, self.looks)
        ]
        sheet = Sheet(left=self.left)
        entries: dict[str, Look] = {}
        for series in every:
            entries.setdefault(series.look.get("label", ""), series.look)
        sheet.legend([look for label, look in entries.items() if label], self.legend)
        sheet.bottom += self.above
        scenarios = [None] if self.columns else list(grouped(points, "scenario"))
        places = list(product(self.measures, scenarios))
        made = sheet.panels(
            len(places),
            self.columns or len(scenarios),
            height=self.height,
            gap=self.gap,
            labels=(self.below, ""),
        )
        axes = dict(zip(places, made, strict=True))
        for (name, scenario), ax in axes.items():
            self._label(ax, name, scenario, first=scenario == scenarios[0])
            for series in every:
                layer = series.layer
                if name in (layer.on or self.measures):
                    shown = where(series.points, scenario=scenario) if scenario else series.points
                    layer.draw(ax, series, shown, self.x, layer.y or name)
            measure = self.measures[name].of(scenario)
            self._set_scales(ax, measure)
            self._set_limits(ax, measure)
        for name, measure in self.measures.items():
            if measure.same:
                row = [ax for place, ax in axes.items() if place[0] == name]
                top = max(ax.get_ylim()[1] for ax in row)
                for ax in row:
                    ax.set_ylim(top=top)
        return sheet

    def _label(self, ax: Any, name: str, scenario: str | None, first: bool) -> None:
        measure = self.measures[name]
        if first or measure.by_scenario:
            ax.set_ylabel(measure.of(scenario).label)
        title = measure.title
        if scenario and name == next(iter(self.measures)):
            title = scenario_title(scenario)
        ax.set_title(title)

    def _set_scales(self, ax: Any, measure: Measure) -> None:
        ticks = measure.below or self.ticks
        if ticks is not None:
            logarithmic(ax.xaxis, ticks)
        if self.names:
            ax.set_xticks(ticks, self.names)
        if not measure.linear:
            logarithmic(ax.yaxis, measure.ticks, measure.linear_below)

    def _set_limits(self, ax: Any, measure: Measure) -> None:
        if self.limits:
            first, last = self.limits
            ax.set_xlim(ax.get_xlim()[1] if first is None else first, last)
        ax.margins(self.margin, measure.margin)
        if measure.level is not None:
            ax.axhline(measure.level, **REFERENCE)
        if measure.low is not None:
            reached = measure.headroom * ax.get_ylim()[1]
            ax.set_ylim(measure.low, max(reached, measure.top))
