"""Figures of a whole comparison: heat maps, and utilization against acceleration variation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...comparisons.suite import BASELINE
from ...rows import Array
from ..numbers import median
from ..plots import INK, WIDTH, Look, Sheet, darker, decades, logarithmic, looks, shortened, symbol
from ..results import Line, Results

# --- heat maps ---

COLOURS = "RdYlBu"
"""From the worst to the best, of matplotlib: told apart by colour-blind readers, too."""

EMPTY = "#EFEFEF"
"""Colour of cells without a value."""

MAX_CELL, MIN_CELL, MAX_HEIGHT = 0.25, 0.13, 12.0
"""Height of a cell, where there is room and where there is not, and how tall all together may be before [in]."""

MAX_WIDTH = 0.95
"""Width of a cell at most [in]."""

LETTER = 0.066
"""Width of a letter of the smallest type, at most [in]."""

MAX_LETTERS = 34
"""Letters of a row's name that are shown."""


@dataclass(frozen=True)
class HeatMap:
    """What a heat map shows.

    Attributes
    ----------
    rows, columns
        Names of its r rows, such as scenarios, and of its c columns, such as laws.
    values
        (r, c) from 0, the worst, to 1, the best; NaN where there is nothing.
    texts
        r rows of c texts for the cells, shown where there is room for all; nothing if empty.
    scale
        What the colours mean: texts for 0 and 1.
    breaks
        Numbers of the rows above which a line is drawn, between kinds of rows.
    """

    rows: Sequence[str]
    columns: Sequence[str]
    values: Array
    texts: Sequence[Sequence[str]] = ()
    scale: tuple[str, str] = ("none", "all")
    breaks: Sequence[int] = ()


def draw_heat_map(shown: HeatMap) -> Sheet | None:
    """One line per row, one cell per column; None if there is none of either."""
    r, c = len(shown.rows), len(shown.columns)
    if not r or not c:
        return None
    names = [shortened(name, MAX_LETTERS) for name in shown.rows]
    left = LETTER * max(len(name) for name in names) + 0.2
    columns = [shortened(name) for name in shown.columns]
    lean = 0.72 * LETTER * max(len(name) for name in columns)  # of names at 45°, to the right and upwards
    width = min((WIDTH - left - max(lean, 0.3)) / c, MAX_WIDTH)
    height = float(np.clip(MAX_HEIGHT / r, MIN_CELL, MAX_CELL))
    sheet = Sheet(left=left, right=WIDTH - left - c * width)
    (ax,) = sheet.panels(1, height=r * height, above=lean + 0.18)
    sheet.at -= 0.35  # no numbers stand below it
    _cells(ax, shown)
    ax.set_yticks(range(r), names)
    ax.set_xticks(range(c), columns, rotation=45, ha="left", rotation_mode="anchor")
    ax.tick_params(length=0, top=False, bottom=False, labeltop=True, labelbottom=False, pad=3)
    longest = max((len(text) for line in shown.texts for text in line), default=0)
    if longest and LETTER * longest + 0.04 < width and height > 0.16:
        _texts(ax, shown)
    _scale(sheet, shown.scale)
    return sheet


def _cells(ax: Any, shown: HeatMap) -> None:
    r, c = len(shown.rows), len(shown.columns)
    ax.set_facecolor(EMPTY)
    values = np.ma.masked_invalid(shown.values)
    look: dict[str, Any] = {"edgecolors": "white", "linewidth": 0.8 if r < 60 else 0.3}
    ax.pcolormesh(np.arange(c + 1) - 0.5, np.arange(r + 1) - 0.5, values, cmap=COLOURS, vmin=0.0, vmax=1.0, **look)
    for row in shown.breaks:
        ax.axhline(row - 0.5, color=INK, linewidth=1.0)
    ax.set_ylim(r - 0.5, -0.5)
    ax.grid(False)
    for side in ax.spines.values():
        side.set_visible(False)


def _texts(ax: Any, shown: HeatMap) -> None:
    for i, line in enumerate(shown.texts):
        for k, text in enumerate(line):
            value = float(shown.values[i, k])
            # the ends of the scale are dark
            colour = "white" if math.isfinite(value) and not 0.14 <= value <= 0.86 else INK
            ax.text(k, i, text, ha="center", va="center_baseline", fontsize=8, color=colour)


def _scale(sheet: Sheet, scale: tuple[str, str]) -> None:
    """A strip of all colours, with what its ends mean."""
    low, high = scale
    left, top = sheet.left + LETTER * len(low) + 0.1, sheet.at
    ax = sheet.axes(left, top, 1.6, 0.12)
    ax.imshow(np.linspace(0.0, 1.0, 128)[None], aspect="auto", cmap=COLOURS)
    ax.set_axis_off()
    place: dict[str, Any] = {"fontsize": 8, "va": "center", "color": INK}
    sheet.text(left - 0.08, top + 0.06, low, ha="right", **place)
    sheet.text(left + 1.68, top + 0.06, high, ha="left", **place)
    sheet.at += 0.1


# --- utilization against acceleration variation ---

LEAST_UNUSED = 1e-4
"""Share of the allowed space left unused below which points are drawn at the edge."""

SHARES = (0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 0.9999)
"""Ticks of utilization."""

HEIGHT = 3.6
GREY = "#666666"
OTHER = symbol("o", "#D0D0D0", "none", 4.0)


def shown_runs(results: Results, controllers: Sequence[str]) -> dict[str, list[Line]]:
    """By controller, lines of the runs that were held back and moved: the others have no place in the figure."""
    return {
        name: [
            line
            for line in results.all_runs(name)
            if math.isfinite(line["utilization"]) and line["acceleration_variation"] > 0.0
        ]
        for name in controllers
        if name != BASELINE
    }


def draw_trade_off(results: Results, controllers: Sequence[str]) -> Sheet | None:
    """A small marker for each run and a large one for the typical run of each controller that has several.

    The runs of those that are not among these controllers stand behind them, in grey.
    """
    every = shown_runs(results, results.competitors)
    found = {name: own for name, own in every.items() if own and name in controllers}
    if not found:
        return None
    others = [run for name, own in every.items() if name not in controllers for run in own]
    look = looks(controllers)
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=HEIGHT, above=0.02)
    for run in others:
        ax.plot([_unused(run)], [run["acceleration_variation"]], **OTHER, clip_on=False, zorder=2.2)
    for name, own in found.items():
        for run in own:
            _mark(ax, run, look[name], size=5.0, alpha=0.75, zorder=3)
        if len(own) > 1:
            _mark(ax, typical(own), look[name], size=12.0, alpha=0.9, zorder=2.5)
    _axes(ax, [run for own in every.values() for run in own])
    entries = [symbol(look[n].marker, look[n].colour, look[n].colour, 8.0, label=shortened(n)) for n in found]
    entries += [
        symbol("o", GREY, GREY, 12.0, label="run nearest to the law's medians"),
        symbol("o", GREY, GREY, 5.0, label="one run"),
        symbol("o", "white", GREY, 7.0, label="hollow: a constraint was violated") | {"markeredgewidth": 1.5},
    ]
    entries += [OTHER | {"label": "runs of other laws"}] * bool(others)
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


def _axes(ax: Any, shown: Sequence[Line]) -> None:
    unused = [_unused(run) for run in shown]
    most, least = 1.4 * max([*unused, 0.1]), max(min(unused) / 1.6, LEAST_UNUSED)
    logarithmic(ax.xaxis, ())
    logarithmic(ax.yaxis)
    logarithmic(ax.yaxis, decades(*ax.get_ylim()))
    ax.set_xlim(most, least)
    ticks = [share for share in SHARES if least <= 1.0 - share + 1e-12 and 1.0 - share <= most]
    ax.set_xticks([1.0 - s for s in ticks], ["≥ 99.99" if s == SHARES[-1] else f"{100.0 * s:g}" for s in ticks])
    ax.set_xlabel("utilization [%], more is better → (logarithmic in the unused share)")
    ax.set_ylabel("← less is better, acceleration variation [rad/s³]")
