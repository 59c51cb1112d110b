"""Many scenes or families by many laws at a glance: one coloured cell for each pair."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...rows import Array
from ..plots import INK, WIDTH, Sheet, shortened

COLOURS = "RdYlBu"
"""From the worst to the best, of matplotlib: told apart by colour-blind readers, too."""

NOTHING = "#EFEFEF"
"""Colour of cells without a value."""

TALLEST, LOWEST, ALL = 0.25, 0.13, 12.0
"""Height of a cell, where there is room and where there is not, and how tall all together may be before [in]."""

WIDEST = 0.95
"""Width of a cell at most [in]."""

LETTER = 0.066
"""Width of a letter of the smallest type, at most [in]."""

LONGEST = 34
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
    names = [shortened(name, LONGEST) for name in shown.rows]
    left = LETTER * max(len(name) for name in names) + 0.2
    columns = [shortened(name) for name in shown.columns]
    lean = 0.72 * LETTER * max(len(name) for name in columns)  # of names at 45°, to the right and upwards
    width = min((WIDTH - left - max(lean, 0.3)) / c, WIDEST)
    height = float(np.clip(ALL / r, LOWEST, TALLEST))
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
    ax.set_facecolor(NOTHING)
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
