"""Laws that studies compare, and what the figures of studies share: lines by law, panels by scenario, outcomes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

from ...comparisons.runs.spec import SLIDING_MODE, ControllerSpec
from ...reports.plots import INK, Look, Sheet, darker, line, looks
from .study import grouped, where


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
SCENARIO_TITLES: dict[str, str] = {
    "example-2d-fov": "first example",
    "example-2d-fast-high-gain": "first example, fast",
    "case-study-6r": "case study",
    "experiment-1-pbvs": "experiment 1 (PBVS)",
    "experiment-2-ibvs": "experiment 2 (IBVS)",
}


def scenario_title(scenario: str) -> str:
    """What figures and sentences call a scenario."""
    return SCENARIO_TITLES.get(scenario, scenario)


def sentence_start(scenario: str) -> str:
    """The same at the beginning of a sentence."""
    title = scenario_title(scenario)
    return title[:1].upper() + title[1:]


def scenario_grid(
    table: Mapping[str, Any], points: Iterable[dict[str, Any]], entries: Sequence[dict[str, Any]]
) -> tuple[Sheet, dict[tuple[str, str], Any]]:
    """A sheet with a legend and, below it, a row of panels for each measure and a column for each scenario.

    Parameters
    ----------
    table
        Of the study: ``measures``, labels by column of the data; and ``layout``, which names the horizontal axis
        (``below``) and gives the left margin, the height of panels and the gap between columns in inches.
    points
        The data, which tell the scenarios.
    entries
        Of the legend.

    Returns
    -------
    tuple
        The sheet, and its panels by measure and scenario.
    """
    layout, scenarios = table["layout"], list(grouped(points, "scenario"))
    sheet = Sheet(left=layout["left"])
    sheet.legend(entries)
    sheet.at += 0.15
    places = list(product(table["measures"], scenarios))
    size = {"height": layout["height"], "gap": layout["gap"]}
    panels = dict(
        zip(places, sheet.panels(len(places), len(scenarios), **size, labels=(layout["below"], "")), strict=True)
    )
    for (measure, scenario), ax in panels.items():
        if scenario == scenarios[0]:
            ax.set_ylabel(table["measures"][measure])
        if measure == next(iter(table["measures"])):
            ax.set_title(scenario_title(scenario))
    return sheet, panels


def entry(label: str, colour: str, marker: str = "", **look: Any) -> dict[str, Any]:
    """Legend entry of points joined by a line."""
    return line(label, colour, **{"marker": marker, "markersize": 5.0, "linewidth": 1.4, **look})


def law_entries(names: Iterable[str]) -> list[dict[str, Any]]:
    """Legend entries of laws, with their markers."""
    return [entry(name, LOOKS[name].colour, LOOKS[name].marker) for name in names]


def joined(
    ax: Any, points: Iterable[dict[str, Any]], x: str, y: str, colour: str, marker: str = "", **look: Any
) -> None:
    """Points joined by a line in their order; those that are not finite are left out."""
    pairs = [(p[x], p[y]) for p in points if math.isfinite(p[x]) and math.isfinite(p[y])]
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


def failed_marks(ax: Any, values: Sequence[float], colour: str, height: float = 0.97) -> None:
    """Crosses near the upper edge, at the x values of runs that failed."""
    cross = {"marker": "x", "color": colour, "markersize": 6.0, "markeredgewidth": 1.4, "linestyle": "none"}
    ax.plot(values, [height] * len(values), transform=ax.get_xaxis_transform(), **cross, clip_on=False, zorder=5)
