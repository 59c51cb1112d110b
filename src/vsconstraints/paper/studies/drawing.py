"""Laws that studies compare, and what the figures of studies share: panels by scenario, lines by law, outcomes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from ...comparisons.runs.spec import SLIDING_MODE, ControllerSpec
from ...reports.plots import INK, Look, Sheet, darker, line, logarithmic, looks
from .study import Points, completed, ended_early, grouped, scenario_title, where


def potential_field(blend: str, region: float = 0.2, strength: float = 1.0) -> ControllerSpec:
    """A potential field; the default region is that of studies that do not vary it."""
    name = "potential-field" if blend == "additive" else f"potential-field-{blend}"
    options = {"blend": blend, "region": region} | ({"strength": strength} if strength != 1.0 else {})
    return ControllerSpec(name, "potential-field", options)


def hierarchical_qp(alpha: float = 20.0) -> ControllerSpec:
    """The hierarchical QP with barrier rows of rate α [1/s]; the default is that of studies that do not vary it."""
    return ControllerSpec("hierarchical-qp", options={"rows": "barrier", "alpha": alpha})


ACTIVE_QP = ControllerSpec("hierarchical-qp-active", "hierarchical-qp", {"rows": "active"})

#: Every law that studies compare with its usual options, by name.
LAWS: dict[str, ControllerSpec] = {
    law.name: law
    for law in (SLIDING_MODE, potential_field("additive"), potential_field("priority"), hierarchical_qp(), ACTIVE_QP)
}

LOOKS: dict[str, Look] = looks(["tracking", *LAWS])


class Panels:
    """A figure of panels below a legend: for each of the table's ``measures`` a row, with a column for each scenario.

    ``layout`` of the table gives the left margin, the height of panels and what is between them in inches, and of the
    horizontal axis the label (``below``), ``limits``, and, if it is logarithmic, ``ticks``; with ``columns`` there is
    one panel for each measure, and so many in a row. A measure is logarithmic, linear ``linear_below`` a value, unless
    it is ``linear``; it has a ``label`` or a ``title``, and may have ``ticks``, horizontal ones too (``below``), and a
    ``margin``, or limits: ``low``, and ``top`` or so many times (``headroom``) what the data reach.
    """

    def __init__(self, table: Mapping[str, Any], points: Iterable[dict[str, Any]], entries: Sequence[Any]) -> None:
        self.points, self.layout, self.measures = list(points), table["layout"], table["measures"]
        columns = self.layout.get("columns", 0)
        scenarios = [None] if columns else list(grouped(self.points, "scenario"))
        self.sheet = Sheet(left=self.layout["left"])
        self.sheet.legend(entries, self.layout.get("legend", 3))
        self.sheet.at += self.layout.get("above", 0.15)
        places = list(product(self.measures, scenarios))
        size = {"height": self.layout["height"], "gap": self.layout.get("gap", 0.7)}
        labels = self.layout["below"], ""
        axes = self.sheet.panels(len(places), columns or len(scenarios), **size, labels=labels)
        self.axes: dict[tuple[str, str | None], Any] = dict(zip(places, axes, strict=True))

    def __iter__(self) -> Iterator[tuple[Any, str, Points]]:
        """Each panel with its measure and its points, to be drawn; after that its axes are scaled."""
        first = next(iter(self.axes))
        for (name, scenario), ax in self.axes.items():
            measure = self.measures[name]
            if scenario == first[1]:
                ax.set_ylabel(measure.get("label", ""))
            title = scenario_title(scenario) if scenario and name == first[0] else measure.get("title", "")
            ax.set_title(title)
            yield ax, name, where(self.points, scenario=scenario) if scenario else self.points
            ticks = measure.get("below", self.layout.get("ticks"))
            if ticks is not None:
                logarithmic(ax.xaxis, ticks)
            if not measure.get("linear"):
                logarithmic(ax.yaxis, measure.get("ticks"), measure.get("linear_below"))
            if "limits" in self.layout:
                ax.set_xlim(*self.layout["limits"])
            if "margin" in measure:
                ax.margins(y=measure["margin"])
            if "low" in measure:
                reached = measure.get("headroom", 1.0) * ax.get_ylim()[1]
                ax.set_ylim(measure["low"], max(reached, measure.get("top", 0.0)))


def entry(label: str, colour: str, marker: str = "", **look: Any) -> dict[str, Any]:
    """Legend entry of points joined by a line."""
    return line(label, colour, **{"marker": marker, "markersize": 5.0, "linewidth": 1.4, **look})


def law_entries(names: Iterable[str]) -> list[dict[str, Any]]:
    """Legend entries of laws, with their markers."""
    return [entry(name, LOOKS[name].colour, LOOKS[name].marker) for name in names]


def joined(
    ax: Any, points: Iterable[dict[str, Any]], x: str, y: str, colour: str, marker: str = "", **look: Any
) -> None:
    """Points of completed runs joined by a line in their order; those that are not finite are left out."""
    pairs = [(p[x], p[y]) for p in completed(points) if math.isfinite(p[x]) and math.isfinite(p[y])]
    if pairs:
        edge = {"markeredgecolor": darker(colour), "markeredgewidth": 0.6}
        line = {"color": colour, "marker": marker, "markersize": 5.0, "linewidth": 1.4, **edge, **look}
        ax.plot(*zip(*pairs, strict=True), **line)


Outcomes = Mapping[str, tuple[str, str, str]]  #: Colour, marker and label of each outcome of a run.


def by_outcome(ax: Any, points: Iterable[dict[str, Any]], x: str, y: str, outcomes: Outcomes) -> None:
    """A marker for each run that shows its outcome."""
    for name, (colour, marker, _) in outcomes.items():
        own, edge = where(points, outcome=name), colour if marker == "x" else INK
        look = {"marker": marker, "color": colour, "markersize": 7.5, "markeredgecolor": edge, "markeredgewidth": 0.5}
        ax.plot([p[x] for p in own], [p[y] for p in own], **look, linestyle="none", zorder=3)


def outcome_entries(points: Iterable[dict[str, Any]], outcomes: Outcomes) -> list[dict[str, Any]]:
    """Legend entries of the outcomes that occur."""
    shown = [look for name, look in outcomes.items() if where(points, outcome=name)]
    return [entry(label, colour, marker, linestyle="none", markersize=7.0) for colour, marker, label in shown]


def failed_marks(ax: Any, points: Iterable[dict[str, Any]], x: str, colour: str, shift: float = 0.0) -> None:
    """Crosses near the upper edge for runs that failed."""
    values = [point[x] + shift for point in points if ended_early(point)]
    cross = {"marker": "x", "color": colour, "markersize": 6.0, "markeredgewidth": 1.4, "linestyle": "none"}
    ax.plot(values, [0.92] * len(values), transform=ax.get_xaxis_transform(), **cross, clip_on=False, zorder=5)
