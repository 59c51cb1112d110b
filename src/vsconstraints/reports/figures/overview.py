"""Figures of a whole comparison: how every scenario ended, and utilization against acceleration variation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...comparisons.suite import BASELINE
from ...rows import Array
from ..numbers import largest, median, number
from ..plots import INK, WIDTH, Look, Sheet, darker, decades, logarithmic, looks, shortened, symbol
from ..results import Line, Results, clean, violated

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


# --- how every scenario ended ---

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
    texts = [[cell_text(list(own), len(columns) > NARROW) for own in line] for line in cells]
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


def cell_text(lines: list[Line], narrow: bool = False) -> str:
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
