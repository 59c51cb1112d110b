"""How much of the allowed space is used, against how much the command chatters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...figures import WIDTH, Look, Sheet, darker, decades, logarithmic, looks, shortened
from ...figures.image import symbol
from ..numbers import mean
from ..results import Results

LEAST_UNUSED = 1e-4
"""Share of the allowed space left unused below which points are drawn at the edge."""

SHARES = (0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 0.9999)
"""Ticks of utilization."""

RIGHT, HEIGHT = 2.25, 3.6
GREY = "#666666"


@dataclass(frozen=True)
class Point:
    """One run, or the mean of a controller's runs.

    Attributes
    ----------
    controller
        Whose.
    utilization, variation
        Where: share of the allowed space, and acceleration variation.
    kept
        Whether no row was violated.
    """

    controller: str
    utilization: float
    variation: float
    kept: bool


def points(results: Results) -> dict[str, list[Point]]:
    """By controller, its runs that used the allowed space and moved."""
    found: dict[str, list[Point]] = {}
    for name in results.competitors:
        found[name] = [
            Point(name, line["utilization"], line["acceleration_variation"], line["violation_depth"] == 0.0)
            for line in results.all_runs(name)
            if math.isfinite(line["utilization"]) and line["acceleration_variation"] > 0.0
        ]
    return found


def draw_trade_off(results: Results) -> Sheet | None:
    """A small marker for each run and a large one for the mean of each controller that has several."""
    found = {name: own for name, own in points(results).items() if own}
    if not found:
        return None
    look = looks(results.controllers)
    sheet = Sheet(left=0.72, right=RIGHT)
    (ax,) = sheet.panels(1, height=HEIGHT, above=0.02)
    for name, own in found.items():
        for point in own:
            _mark(ax, point, look[name], size=5.0, alpha=0.75, order=3)
        if len(own) > 1:
            utilization, variation = mean([p.utilization for p in own]), mean([p.variation for p in own])
            of_all = Point(name, utilization, variation, all(p.kept for p in own))
            _mark(ax, of_all, look[name], size=12.0, alpha=0.9, order=2.5)
    _axes(ax, [point for own in found.values() for point in own])
    entries = [symbol(look[n].marker, look[n].colour, look[n].colour, 8.0, label=shortened(n)) for n in found]
    entries += [
        symbol("o", GREY, GREY, 12.0, label="mean of a controller's runs"),
        symbol("o", GREY, GREY, 5.0, label="one run"),
        symbol("o", "white", GREY, 7.0, label="hollow: a row was violated") | {"markeredgewidth": 1.5},
    ]
    sheet.legend(entries, 1, (WIDTH - RIGHT + 0.15, 0.15), labelspacing=0.85)
    return sheet


def _mark(ax: Any, point: Point, look: Look, size: float, alpha: float, order: float) -> None:
    face, edge = (look.colour, darker(look.colour)) if point.kept else ("white", look.colour)
    place = [_unused(point)], [point.variation]
    mark = symbol(look.marker, face, edge, size) | {"markeredgewidth": 0.7 if point.kept else 1.5}
    ax.plot(*place, **mark, alpha=alpha, zorder=order, clip_on=False)


def _unused(point: Point) -> float:
    return max(1.0 - point.utilization, LEAST_UNUSED)


def _axes(ax: Any, shown: Sequence[Point]) -> None:
    widest = 1.4 * max([*(_unused(point) for point in shown), 0.1])
    logarithmic(ax.xaxis, ())
    logarithmic(ax.yaxis)
    logarithmic(ax.yaxis, decades(*ax.get_ylim()))
    # the right end is full use of the allowed space
    ax.set_xlim(widest, LEAST_UNUSED)
    ticks = [share for share in SHARES if 1.0 - share <= widest]
    ax.set_xticks([1.0 - s for s in ticks], ["≥ 99.99" if s == SHARES[-1] else f"{100.0 * s:g}" for s in ticks])
    ax.set_xlabel("utilization where rows hold the arm back [%], more is better → (logarithm of what is left)")
    ax.set_ylabel("← less is better, acceleration variation [rad/s³]")
