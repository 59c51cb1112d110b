"""The figure of a whole comparison: utilization against acceleration variation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ...comparisons.suite import BASELINE
from ..numbers import median
from ..plots import Look, Sheet, darker, decades, logarithmic, looks, shortened, symbol
from ..results import Line, Results

LEAST_UNUSED = 1e-4  # share of the allowed space left unused below which points are drawn at the edge
SHARES = (0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 0.9999)  # ticks of utilization
HEIGHT, GREY = 3.6, "#666666"


def shown_runs(results: Results, controllers: Sequence[str]) -> dict[str, list[Line]]:
    """By controller, lines of the runs that were held back and moved: the others have no place in the figure."""

    def drawn(run: Line) -> bool:
        return math.isfinite(run["utilization"]) and run["acceleration_variation"] > 0.0

    return {name: [run for run in results.all_runs(name) if drawn(run)] for name in controllers if name != BASELINE}


def draw_trade_off(results: Results, controllers: Sequence[str]) -> Sheet | None:
    """A small marker for each run and a large one for the typical run of each controller that has several."""
    every = shown_runs(results, results.competitors)
    found = {name: own for name, own in every.items() if own and name in controllers}
    if not found:
        return None
    look, sheet = looks(controllers), Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=HEIGHT, above=0.02)
    for name, own in found.items():
        for run in own:
            _mark(ax, run, look[name], size=5.0, alpha=0.75, zorder=3)
        if len(own) > 1:
            _mark(ax, typical(own), look[name], size=12.0, alpha=0.9, zorder=2.5)
    unused = [_unused(run) for own in every.values() for run in own]
    most, least = 1.4 * max([*unused, 0.1]), max(min(unused) / 1.6, LEAST_UNUSED)
    logarithmic(ax.xaxis, ())
    logarithmic(ax.yaxis)
    logarithmic(ax.yaxis, decades(*ax.get_ylim()))
    ax.set_xlim(most, least)
    ticks = [share for share in SHARES if least <= 1.0 - share + 1e-12 and 1.0 - share <= most]
    ax.set_xticks([1.0 - s for s in ticks], ["≥ 99.99" if s == SHARES[-1] else f"{100.0 * s:g}" for s in ticks])
    ax.set_xlabel("utilization [%], more is better → (logarithmic in the unused share)")
    ax.set_ylabel("← less is better, acceleration variation [rad/s³]")
    entries = [symbol(look[n].marker, look[n].colour, look[n].colour, 8.0, label=shortened(n)) for n in found]
    entries += [
        symbol("o", GREY, GREY, 12.0, label="run nearest to the law's medians"),
        symbol("o", GREY, GREY, 5.0, label="one run"),
        symbol("o", "white", GREY, 7.0, label="hollow: a constraint was violated") | {"markeredgewidth": 1.5},
    ]
    sheet.at += 0.08
    sheet.legend(entries, 3)
    return sheet


def typical(runs: Sequence[Line]) -> Line:
    """Of several runs the one that is nearest, as drawn, to the medians of all: where these lie there may be none."""
    places = [(math.log(_unused(run)), math.log(run["acceleration_variation"])) for run in runs]
    middle = [median(values) for values in zip(*places, strict=True)]
    return min(zip(runs, places, strict=True), key=lambda pair: math.dist(pair[1], middle))[0]


def _mark(ax: Any, run: Line, look: Look, size: float, **options: Any) -> None:
    """A run, hollow if a row was violated."""
    kept = run["violation_depth"] == 0.0
    face, edge = (look.colour, darker(look.colour)) if kept else ("white", look.colour)
    mark = symbol(look.marker, face, edge, size) | {"markeredgewidth": 0.7 if kept else 1.5}
    ax.plot([_unused(run)], [run["acceleration_variation"]], **mark, clip_on=False, **options)


def _unused(run: Line) -> float:
    return max(1.0 - float(run["utilization"]), LEAST_UNUSED)
