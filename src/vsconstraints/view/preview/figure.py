"""Presentation of a preview: lines for a terminal, and a figure with image, arm and rows."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap
from typing import Any

import numpy as np

from ...reports.plots.image import OUTSIDE, START, Plane, numbered
from ...reports.plots.sheet import WIDTH, Figure, Sheet
from ...reports.plots.style import INK, Style, shortened, symbol
from ...rows import Array
from ...rows.readable import counted
from ..setup_scene import draw_setup, viewpoint_of
from .preview import NEAR, Preview, Row

MAX_LISTED = 15  # rows listed in a terminal, unless more are near
COLUMNS = 3
LEFT = 0.62
GAP = 0.16
TITLE = 0.3
#: Most rows that are shown, and most rows that are shown far from their boundary.
MAX_ROWS = 12
MIN_ROWS = 4
#: Greatest width of an image; greatest height of an arm, and height of a row of moments without a
#: known configuration [in].
MAX_PANEL_WIDTH = 3.6
MAX_ARM_HEIGHT = 2.5
UNKNOWN_HEIGHT = 0.35
# Characters per line and lines of the warnings in the figure.
CHARACTERS = 115
LINES = 12
#: Height of a row; widths of the labels, of a cell of a moment, and of a cell of the nearest
#: moment [in].
ROW = 0.19
LABELS = 1.95
CELL = 1.36
NEAREST = 1.8
MAX_USAGE = 1.15  # greatest usage that is shown; larger values are drawn at the edge
ON_TOP: Style = {"zorder": 4.0, "clip_on": False}
STARTED = symbol("o", "white", size=8.5, **ON_TOP)
GOAL = symbol("*", INK, size=5.2, **ON_TOP)
EARLIER = symbol("*", "white", size=5.2, **ON_TOP)


def lines(preview: Preview) -> Iterator[str]:
    """Yield the lines for a terminal, without the warnings."""
    scene = preview.setup.scene
    robot = scene.robot
    yield f"{preview.name}: {robot.name}, {robot.n} joints, {len(scene.markers)} markers"
    for moment in preview.moments:
        q = "unknown"
        if moment.q is not None:
            q = " ".join(f"{x:.4g}" for x in moment.q)
        yield f"  {moment.name:8s} t = {moment.t:g} s, q = {q}"
    if not preview.rows:
        yield "  no rows and no joint limits"
        return
    shown = preview.rows[: max(MAX_LISTED, len(preview.near))]
    yield "  rows nearest to their boundary: distance, φ in parentheses; ! violated, * near"
    names = [moment.name for moment in preview.moments]
    table = [["", "", *names]]
    for row in shown:
        mark = ""
        if row.greatest > 1.0:
            mark = "!"
        elif row.greatest >= NEAR:
            mark = "*"
        distances = [row.text(k) for k in range(len(names))]
        table.append([mark, row.label, *distances])
    columns = zip(*table, strict=True)
    widths = [max(map(len, column)) for column in columns]
    for cells in table:
        mark, *others = map(str.ljust, cells, widths)
        yield f"  {mark} {'  '.join(others)}".rstrip()
    hidden_count = len(preview.rows) - len(shown)
    if hidden_count:
        yield f"  … and {hidden_count} farther away"


def draw_preview(preview: Preview) -> Sheet:
    """Draw image and arm at the start and at each goal, the nearest rows, and the warnings."""
    sheet = Sheet(left=LEFT)
    columns = min(len(preview.moments), COLUMNS)
    panels_width = WIDTH - LEFT - 0.08 - GAP * (columns - 1)
    width = min(panels_width / columns, MAX_PANEL_WIDTH)
    robot = preview.setup.scene.robot
    headline = f"{shortened(preview.name, 50)}: {shortened(robot.name, 40)}"
    sheet.text(LEFT, sheet.bottom + 0.16, headline, fontsize=10, fontweight="bold")
    sheet.bottom += 0.2
    _draw_images(sheet, preview, columns, width)
    _draw_arms(sheet, preview, columns, width)
    _draw_rows(sheet, preview)
    _write_warnings(sheet, preview)
    return sheet


def _write_warnings(sheet: Sheet, preview: Preview) -> None:
    """Write the warnings, as many as there is room for."""
    lines = list[str]()
    for warning in preview.warnings:
        lines += wrap(f"! {warning}", CHARACTERS, subsequent_indent="   ")
    if not lines:
        return
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], "… and more, see the text"]
    for line in lines:
        sheet.text(LEFT, sheet.bottom + 0.12, line, fontsize=8, color=OUTSIDE)
        sheet.bottom += 0.16
    sheet.bottom += 0.08


def _draw_images(sheet: Sheet, preview: Preview, columns: int, width: float) -> None:
    """Draw the markers in the image in each moment, with the boundaries of constraints."""
    plane = Plane.of(preview.setup)
    panels = sheet.panels(
        len(preview.moments),
        columns,
        height=width * plane.half[1] / plane.half[0],
        width=width,
        gap=GAP,
        above=TITLE,
        labels=("u [px]", "v [px], downwards"),
        same_y=True,
    )
    entries = [START | {"label": "marker 1, 2, …"}]
    any_beyond = False
    for ax, moment in zip(panels, preview.moments, strict=True):
        plane.times = (moment.t,)
        plane.draw(ax, labels=False)
        _draw_markers(ax, moment.pixels, plane.half)
        if (np.abs(moment.pixels) > plane.half).any():
            any_beyond = True
        ax.set_title(moment.name, loc="left", color=INK, fontweight="bold", pad=4)
        if moment.problems:
            text = counted(len(moment.problems), "warning")
            ax.set_title(text, loc="right", color=OUTSIDE, fontsize=8, pad=4)
    if any_beyond:
        entries.append(START | {"label": "marker beyond", "markeredgecolor": OUTSIDE})
    entries += plane.entries(forbidden="forbidden to markers")
    sheet.legend(entries, 4)


def _draw_markers(ax: Any, pixels: Array, half: Array) -> None:
    """Draw markers (M, 2) and the outline of their target; ``half`` (2,) is that of the plane."""
    if len(pixels) > 1 and np.isfinite(pixels).all():
        outline = np.append(pixels, pixels[:1], axis=0)
        ax.plot(*outline.T, color="#909090", linewidth=0.9, zorder=3.5)
    numbered(ax, pixels, within=half)


def _draw_arms(sheet: Sheet, preview: Preview, columns: int, width: float) -> None:
    """Draw the arm in each moment, all from one viewpoint."""
    moments = preview.moments
    known = [(moment.q, moment.t) for moment in moments if moment.q is not None]
    if not known:
        return
    top = sheet.bottom + 0.12
    arm_height = min(width, MAX_ARM_HEIGHT)
    viewpoint = viewpoint_of(preview.setup, known, width / arm_height)
    for first in range(0, len(moments), columns):
        row = moments[first : first + columns]
        height = UNKNOWN_HEIGHT
        if any(moment.q is not None for moment in row):
            height = arm_height
        left = LEFT
        for moment in row:
            if moment.q is None:
                text = f"{moment.name}: no configuration found"
                sheet.text(left + 0.1, top + 0.5 * height, text, color=OUTSIDE)
            else:
                ax = sheet.axes_3d(left, top, width, height)
                draw_setup(ax, preview.setup, moment.q, moment.t, viewpoint)
            left += width + GAP
        top += height
    sheet.bottom = top + 0.1


def _draw_rows(sheet: Sheet, preview: Preview) -> None:
    """Draw the usage of the nearest rows in each moment, with distances and φ in their units."""
    known = [row for row in preview.rows if np.isfinite(row.greatest)]
    shown = known[:MIN_ROWS]
    for row in known[MIN_ROWS:MAX_ROWS]:
        if row.greatest > 0.0:
            shown.append(row)
    if not shown:
        sheet.text(LEFT, sheet.bottom + 0.1, "No rows and no joint limits.")
        sheet.bottom += 0.3
        return
    names = [moment.name for moment in preview.moments]
    marks = [EARLIER] * len(names)
    marks[-1] = GOAL
    marks[0] = STARTED
    # many moments have no room beside each other: only the nearest of each row is written
    has_all_moments = len(names) <= COLUMNS
    cells_width = CELL * len(names) if has_all_moments else NEAREST
    cells_left = WIDTH - cells_width - 0.1
    top = sheet.bottom + 0.38
    height = ROW * len(shown)
    ax = sheet.axes(LABELS, top, cells_left - 0.1 - LABELS, height)
    _draw_usage(ax, shown, marks)
    if has_all_moments:
        for k, name in enumerate(names):
            left = cells_left + k * CELL - 0.08
            entry = marks[k] | {"label": name}
            sheet.legend([entry], 1, (left, top - 0.22))
    else:
        entries = [
            STARTED | {"label": names[0]},
            EARLIER | {"label": "earlier goals"},
            GOAL | {"label": names[-1]},
        ]
        sheet.legend(entries, 3, (LABELS, top - 0.22))
    for y, row in enumerate(shown):
        middle = top + ROW * (y + 0.5)
        if has_all_moments:
            for k in range(len(names)):
                left = cells_left + k * CELL
                _write_cell(sheet, left, middle, row, k)
        else:
            nearest = int(np.nanargmax(row.usage))
            _write_cell(sheet, cells_left, middle, row, nearest, f"{names[nearest]}: ")
    sheet.bottom = top + height + 0.45
    if any(row.limit for row in shown):
        note = "limit[…]: a range of the robot that no row bounds"
        sheet.text(LABELS, sheet.bottom + 0.12, note, fontsize=7.5)
        sheet.bottom += 0.16


def _write_cell(
    sheet: Sheet, left: float, middle: float, row: Row, k: int, before: str = ""
) -> None:
    """Write the distance of a row in moment k at a place, in another colour if it is violated."""
    colour = OUTSIDE if row.usage[k] > 1.0 else INK
    text = before + row.text(k)
    sheet.text(left, middle, text, fontsize=7.5, color=colour, va="center")


def _draw_usage(ax: Any, shown: list[Row], marks: list[Style]) -> None:
    """Draw the used share of the allowed range of rows, with one mark for each moment."""
    end = MAX_USAGE + 0.03
    last_row = len(shown) - 1
    ax.set_xlim(-0.04, end)
    ax.set_ylim(last_row + 0.5, -0.5)
    ax.axvspan(1.0, end, color="#F6DADA", linewidth=0.0, zorder=0.5)
    middle = 0.5 * (1.0 + end)
    ax.text(
        middle,
        0.5 * last_row,
        "outside",
        fontsize=7.5,
        color=OUTSIDE,
        rotation=90,
        ha="center",
        va="center",
        zorder=1.0,
    )
    ax.axvline(1.0, color=INK, linewidth=0.9, zorder=1.6)
    ax.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
    labels = [shortened(row.label, 32) for row in shown]
    ax.set_yticks(range(len(shown)), labels)
    ax.tick_params(axis="y", length=0.0, labelsize=7.5)
    ax.set_xlabel("usage of the allowed range: 1 is the boundary", labelpad=2)
    for y, row in enumerate(shown):
        usage = np.clip(row.usage, 0.0, MAX_USAGE)
        least = np.nanmin(usage)
        greatest = np.nanmax(usage)
        level = [y, y]
        ax.plot([0.0, MAX_USAGE], level, color="#E3E3E3", linewidth=0.6, zorder=1.0)
        ax.plot([least, greatest], level, color="#909090", linewidth=1.4, zorder=2.0)
        for value, mark in zip(usage, marks, strict=True):
            if np.isfinite(value):
                ax.plot(value, y, **mark)


#: Drawn from a :class:`~vsconstraints.view.preview.preview.Preview`.
FIGURE = Figure.named("preview", draw_preview)
