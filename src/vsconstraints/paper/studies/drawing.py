"""Figures of studies, drawn from their tables in ``studies.toml``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ...reports.plots import INK, REFERENCE, Sheet, darker, logarithmic, widths
from ...reports.plots.style import LOOKS
from .tables import Numbers, Points, about, ended_early, grouped, scenario_title, where


def sweep_figure(table: Mapping[str, Any], points: Points, numbers: Numbers) -> Sheet:
    """Draw the figure of a study from its points and numbers, as defined by its table.

    Below a legend, each of the ``measures`` has a row of panels, one for each scenario. With
    ``columns`` in the ``layout``, each measure has one panel, and so many panels form a row.

    The layout gives the left margin, the height of panels and the gaps between them in inches. For
    the horizontal axis it gives the column ``x``, its label (``below``), ``limits`` (or only the
    last one) and, if the axis is logarithmic, ``ticks`` with optional ``names``. Values smaller
    than ``least`` are drawn there.

    A measure is logarithmic, linear ``linear_below`` a value, unless it is ``linear``. It has a
    ``label`` or a ``title``, and may have ``ticks``, horizontal ones too (``below``), a ``level``
    to compare with, a ``margin``, or limits: ``low``, and ``top`` or ``headroom`` times the
    greatest value, the ``same`` in all panels. Settings that differ between scenarios are a table
    by scenario. ``layers`` are drawn into all panels or those ``on`` some measures: see
    :class:`Series`.
    """
    layout = table["layout"]
    measures = table["measures"]
    series = list(all_series(table, points, numbers))
    scenarios = [None] if "columns" in layout else list(grouped(points, "scenario"))
    sheet = Sheet(left=layout["left"])
    entries: dict[str, dict[str, Any]] = {}
    for one in series:
        entries.setdefault(one.look.get("label", ""), one.look)
    sheet.legend([look for label, look in entries.items() if label], layout.get("legend", 3))
    sheet.at += layout.get("above", 0.15)
    places = list(product(measures, scenarios))
    size = {
        "height": layout["height"],
        "gap": layout.get("gap", 0.7),
        "labels": (layout["below"], ""),
    }
    axes = dict(
        zip(
            places,
            sheet.panels(len(places), layout.get("columns", len(scenarios)), **size),
            strict=True,
        )
    )
    for (name, scenario), ax in axes.items():
        own = {
            key: value[scenario] if isinstance(value, dict) else value
            for key, value in measures[name].items()
        }
        if scenario == scenarios[0] or own != measures[name]:
            ax.set_ylabel(own.get("label", ""))
        ax.set_title(
            scenario_title(scenario)
            if scenario and name == next(iter(measures))
            else own.get("title", "")
        )
        for one in series:
            if name in one.layer.get("on", measures):
                one.draw(ax, layout, name, scenario)
        ticks = own.get("below", layout.get("ticks"))
        if ticks is not None:
            logarithmic(ax.xaxis, ticks)
        if not own.get("linear"):
            logarithmic(ax.yaxis, own.get("ticks"), own.get("linear_below"))
        if "limits" in layout:
            *first, last = layout["limits"]
            ax.set_xlim(*(first or ax.get_xlim()[1:]), last)
        if "names" in layout:
            ax.set_xticks(ticks, layout["names"])
        ax.margins(layout.get("margin"), own.get("margin"))
        if "level" in own:
            ax.axhline(own["level"], **REFERENCE)
        if "low" in own:
            reached = own.get("headroom", 1.0) * ax.get_ylim()[1]
            ax.set_ylim(own["low"], max(reached, own.get("top", 0.0)))
    for name in [name for name, measure in measures.items() if measure.get("same")]:
        row = [ax for place, ax in axes.items() if place[0] == name]
        top = max(ax.get_ylim()[1] for ax in row)
        for ax in row:
            ax.set_ylim(top=top)
    return sheet


class Series(NamedTuple):
    """Series drawn by a layer of a table: name, points, matplotlib style, and the layer.

    Its points are those ``where`` columns have values, ``without`` those that have others, or the
    ``numbers`` about so many of the first varied fields, all together or ``by`` a column.

    A line joins them unless their ``kind`` is ``level`` (a line across the panel), ``below`` (the
    area below is shaded), ``crosses`` (near the upper edge, for failed runs), ``edge`` (at the left
    edge) or ``distribution`` (against the share of points with smaller values). ``y`` is the
    measure if no other column is given.

    The style is that of a law, or is given by the table's ``looks`` or the layer's ``palette`` and
    ``look``; ``reference`` is dashed; lines become thinner with ``widths``.
    """

    name: str
    points: Points
    look: dict[str, Any]
    layer: Mapping[str, Any]

    def draw(self, ax: Any, layout: Mapping[str, Any], measure: str, scenario: str | None) -> None:
        """Draw the series into the panel of a measure and of a scenario, or of all scenarios."""
        x = layout.get("x", "")
        y = self.layer.get("y", measure)
        kind = self.layer.get("kind")
        points = where(self.points, scenario=scenario) if scenario else self.points
        if kind == "crosses":
            shift = self.layer.get("shift", {}).get(self.name, 0.0)
            values = [point[x] + shift for point in points if ended_early(point)]
            look = self.look | {
                "linestyle": "none",
                "marker": "x",
                "markersize": 6.0,
                "markeredgewidth": 1.4,
            }
            look |= {"markeredgecolor": self.look["color"], "clip_on": False, "zorder": 5}
            ax.plot(values, [0.92] * len(values), transform=ax.get_xaxis_transform(), **look)
            return
        # failed runs are shown where the data have an outcome
        finite = [
            p for p in points if math.isfinite(p[y]) and ("outcome" in p or not ended_early(p))
        ]
        if kind in ("level", "below"):
            for point in finite:
                ax.axhline(point[y], **self.look) if kind == "level" else ax.axvspan(
                    point[y], 1e-9, **self.look
                )
            return
        if kind in ("distribution", "edge"):
            values = [p[y] for p in finite]
            if kind == "edge":
                ax.plot(
                    [0.02] * len(values), values, transform=ax.get_yaxis_transform(), **self.look
                )
            elif values:
                ax.ecdf(
                    values + [math.inf] * (len(points) - len(finite)),
                    orientation="horizontal",
                    **self.look,
                )
            return
        least = layout.get("least", -math.inf)
        pairs = sorted((max(p[x], least), p[y]) for p in finite if math.isfinite(p[x]))
        ax.plot(*np.array(pairs).reshape(-1, 2).T, **self.look)


def all_series(table: Mapping[str, Any], points: Points, numbers: Numbers) -> Iterator[Series]:
    """Yield the series of the table's layers, in their order."""
    looks = table.get("looks", {})
    for layer in table["layers"]:
        of = points
        if count := layer.get("numbers"):
            keys = dict.fromkeys(key[:-1] for key in numbers if len(key) == count + 1)
            of = [
                dict(zip(table["varied"], key, strict=False))
                | about(numbers, *key)
                | {"status": ""}
                for key in keys
            ]
        own = where(of, **layer.get("where", {}))
        own = (
            [point for point in own if point not in where(own, **layer["without"])]
            if "without" in layer
            else own
        )
        groups = grouped(own, layer["by"]) if "by" in layer else {"": own}
        names = [name for name in looks if name in groups] or [
            name for name in groups if name or "by" not in layer
        ]
        thinner = (
            widths(names, *layer["widths"]) if "widths" in layer else dict.fromkeys(names, 1.4)
        )
        for k, name in enumerate(names):
            look: dict[str, Any] = {}
            if layer.get("kind") != "below":
                look = {
                    "linewidth": thinner[name],
                    "color": INK,
                    "markersize": 5.0,
                    "label": scenario_title(name),
                }
                look |= looks.get(name, {})
                if law := LOOKS.get(look.pop("law", name)):
                    look |= {"color": law.colour, "marker": law.marker}
                if "palette" in layer:
                    look["color"], look["marker"] = layer["palette"][k]
                look = {"markeredgecolor": darker(look["color"]), "markeredgewidth": 0.6, **look}
            if layer.get("reference"):
                look |= {key: REFERENCE[key] for key in ("linestyle", "linewidth")}
            yield Series(name, groups[name], look | layer.get("look", {}), layer)
