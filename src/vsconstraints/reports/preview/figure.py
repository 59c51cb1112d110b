"""The figure of a preview: image, space and the nearest rows."""

from __future__ import annotations

from textwrap import wrap
from typing import Any

import numpy as np

from ...rows import Array
from ..plots import FAINT, INK, WIDTH, Figure, Sheet, shortened, symbol
from ..plots.image import Plane
from ..scene3d import draw_setup, viewpoint_of
from .moments import Moment, Row
from .preview import Preview

COLUMNS = 3
LEFT, GAP, TITLE = 0.62, 0.16, 0.3
MAX_ROWS, MIN_ROWS = 12, 4
"""Rows that are shown: up to the first, but of those far from their boundary no more than the second."""

UNKNOWN_HEIGHT = 0.35
"""Height of a row of views in which no moment's configuration is known [in]."""

CHARACTERS, LINES = 115, 12
"""Of the warnings in the figure."""

ROW = 0.19
"""Height of a row [in]."""

LABELS, CELL, NEAREST = 1.95, 1.36, 1.8
"""Room for the rows' labels, for what a column says of them in a moment, and where they are nearest [in]."""

MAX_USAGE = 1.15
"""Greatest usage that is shown; what is beyond stands at the edge."""

OUTSIDE = "#B00020"
NUMBERED = symbol("o", "white", size=10.5)
STARTED, GOAL, EARLIER = symbol("o", "white", size=8.5), symbol("*", INK, size=5.2), symbol("*", "white", size=5.2)


def draw_preview(preview: Preview) -> Sheet:
    """Image and arm at the start and at each goal, then the rows nearest to their boundary."""
    sheet = Sheet(left=LEFT)
    columns = min(len(preview.moments), COLUMNS)
    width = (WIDTH - LEFT - 0.08 - GAP * (columns - 1)) / columns
    width = min(width, 3.6)
    sheet.text(LEFT, sheet.at + 0.16, _headline(preview), fontsize=10, fontweight="bold")
    sheet.at += 0.2
    _images(sheet, preview, columns, width)
    _space(sheet, preview, columns, width)
    _rows(sheet, preview)
    _warnings(sheet, preview)
    return sheet


def _headline(preview: Preview) -> str:
    return f"{shortened(preview.name, 50)}: {shortened(preview.setup.scene.robot.name, 40)}"


def _warnings(sheet: Sheet, preview: Preview) -> None:
    """What is wrong, in as many lines as it takes, up to a number."""
    lines = [line for warning in preview.warnings for line in wrap(f"! {warning}", CHARACTERS, subsequent_indent="   ")]
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], "… and more, see the text"]
    for line in lines:
        sheet.text(LEFT, sheet.at + 0.12, line, fontsize=8, color=OUTSIDE)
        sheet.at += 0.16
    sheet.at += 0.08 if lines else 0.0


def _images(sheet: Sheet, preview: Preview, columns: int, width: float) -> None:
    planes = [Plane.at(preview.setup, moment.t) for moment in preview.moments]
    height = width * planes[0].half[1] / planes[0].half[0]
    grid: dict[str, Any] = {"width": width, "gap": GAP, "above": TITLE, "labels": ("u [px]", "v [px], downwards")}
    panels = sheet.panels(len(preview.moments), columns, height=height, **grid, same_y=True)
    for ax, plane, moment in zip(panels, planes, preview.moments, strict=True):
        plane.draw(ax, labels=False)
        _markers(ax, moment, plane.half)
        ax.set_title(moment.name, loc="left", color=INK, fontweight="bold", pad=4)
        colour = OUTSIDE if moment.problems else FAINT
        ax.set_title(_verdict(moment), loc="right", color=colour, fontsize=8, pad=4)
    entries = [NUMBERED | {"label": "marker 1, 2, …"}]
    if any((np.abs(moment.pixels) > planes[0].half).any() for moment in preview.moments):
        entries.append(NUMBERED | {"label": "marker beyond", "markeredgecolor": OUTSIDE})
    entries += [*planes[0].entries(forbidden="forbidden to markers")]
    sheet.legend(entries, 4)


def _markers(ax: Any, moment: Moment, half: Array) -> None:
    """Markers with their numbers; those beyond what is shown stand at its edge, in red."""
    known = moment.pixels[np.isfinite(moment.pixels).all(axis=1)]
    if len(known) == len(moment.pixels) > 1:
        ax.plot(*np.concatenate((known, known[:1])).T, color="#909090", linewidth=0.9, zorder=3.5)
    for i, (u, v) in enumerate(moment.pixels):
        if np.isfinite(u):
            at = np.clip((u, v), -half, half)
            colour = INK if (at == (u, v)).all() else OUTSIDE
            ax.plot(*at, **{**NUMBERED, "markeredgecolor": colour}, zorder=6.0 + 0.01 * i, clip_on=False)
            place = {"ha": "center", "va": "center_baseline"}
            ax.text(*at, str(i + 1), fontsize=8, color=colour, zorder=6.005 + 0.01 * i, **place)


def _verdict(moment: Moment) -> str:
    """In a few words, what is wrong."""
    count = len(moment.problems)
    return "" if count == 0 else "1 warning" if count == 1 else f"{count} warnings"


def _space(sheet: Sheet, preview: Preview, columns: int, width: float) -> None:
    known = [(moment.q, moment.t) for moment in preview.moments if moment.q is not None]
    if not known:
        return
    top, height = sheet.at + 0.12, min(width, 2.5)
    viewpoint = viewpoint_of(preview.setup, known, width / height)
    for first in range(0, len(preview.moments), columns):
        row = preview.moments[first : first + columns]
        tall = height if any(moment.q is not None for moment in row) else UNKNOWN_HEIGHT
        for column, moment in enumerate(row):
            left = LEFT + column * (width + GAP)
            if moment.q is None:
                sheet.text(left + 0.1, top + 0.5 * tall, f"{moment.name}: no configuration found", color=OUTSIDE)
            else:
                ax = sheet.axes(left, top, width, height, projection="3d", computed_zorder=False)
                draw_setup(ax, preview.setup, moment.q, moment.t, viewpoint)
        top += tall
    sheet.at = top + 0.1


def _rows(sheet: Sheet, preview: Preview) -> None:
    """Usage of the nearest rows in each moment, with distances and φ in their own units."""
    known = [row for row in preview.rows if np.isfinite(row.greatest)]
    shown = [row for k, row in enumerate(known[:MAX_ROWS]) if k < MIN_ROWS or row.greatest > 0.0]
    if not shown:
        sheet.text(LEFT, sheet.at + 0.1, "No rows, and no limits of joints.")
        sheet.at += 0.3
        return
    moments = list(range(len(preview.moments)))
    listed = moments if len(moments) <= COLUMNS else []
    cells = CELL * len(listed) or NEAREST
    top, height = sheet.at + 0.38, ROW * len(shown)
    ax = sheet.axes(LABELS, top, WIDTH - LABELS - cells - 0.2, height)
    ax.set_xlim(-0.04, MAX_USAGE + 0.03)
    ax.set_ylim(len(shown) - 0.5, -0.5)
    band_at = {"color": "#F6DADA", "linewidth": 0.0, "zorder": 0.5}
    ax.axvspan(1.0, MAX_USAGE + 0.03, **band_at)
    middle = 0.5 * (1.0 + MAX_USAGE + 0.03), 0.5 * (len(shown) - 1)
    ax.text(*middle, "outside", fontsize=7.5, color=OUTSIDE, rotation=90, ha="center", va="center", zorder=1.0)
    ax.axvline(1.0, color=INK, linewidth=0.9, zorder=1.6)
    ax.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
    ax.set_yticks(range(len(shown)), [shortened(row.label, 32) for row in shown])
    ax.tick_params(axis="y", length=0.0, labelsize=7.5)
    ax.set_xlabel("usage of the allowed range: 1 is the boundary", labelpad=2)
    for y, row in enumerate(shown):
        _row(ax, preview, y, row)
    where = WIDTH - cells - 0.1
    for column, k in enumerate(listed):
        entry = _mark(preview, k) | {"label": preview.moments[k].name}
        sheet.legend([entry], 1, (where + column * CELL - 0.08, top - 0.22))
        for y, row in enumerate(shown):
            _cell(sheet, where + column * CELL, top + ROW * (y + 0.5), row.text(k), row.usage[k] > 1.0)
    if not listed:
        marks = [_mark(preview, k) | {"label": preview.moments[k].name} for k in (0, -1)]
        marks.insert(1, EARLIER | {"label": "earlier goals"})
        sheet.legend(marks, 3, (LABELS, top - 0.22))
        for y, row in enumerate(shown):
            k = int(np.nanargmax(row.usage))
            text = f"{preview.moments[k].name}: {row.text(k)}"
            _cell(sheet, where, top + ROW * (y + 0.5), text, row.usage[k] > 1.0)
    sheet.at = top + height + 0.45
    if any(row.limit for row in shown):
        note = "limit[…]: the robot's own range, about which there is no row"
        sheet.text(LABELS, sheet.at + 0.12, note, fontsize=7.5)
        sheet.at += 0.16


def _cell(sheet: Sheet, left: float, top: float, text: str, outside: bool) -> None:
    sheet.text(left, top, text, fontsize=7.5, color=OUTSIDE if outside else INK, va="center")


def _mark(preview: Preview, k: int) -> dict[str, Any]:
    return STARTED if k == 0 else GOAL if k in (-1, len(preview.moments) - 1) else EARLIER


def _row(ax: Any, preview: Preview, y: int, row: Row) -> None:
    usage = np.clip(row.usage, 0.0, MAX_USAGE)
    ax.plot([0.0, MAX_USAGE], [y, y], color="#E3E3E3", linewidth=0.6, zorder=1.0)
    known = usage[np.isfinite(usage)]
    ax.plot([known.min(), known.max()], [y, y], color="#909090", linewidth=1.4, zorder=2.0)
    for k, u in enumerate(usage):
        if np.isfinite(u):
            ax.plot(u, y, **_mark(preview, k), zorder=4.0, clip_on=False)


FIGURE = Figure(
    "preview",
    "start and goals, before anything is simulated",
    "The image and the arm at the start and at each goal, and the rows nearest to their boundary.",
    draw_preview,
)
"""Drawn from a :class:`~vsconstraints.reports.preview.preview.Preview`."""
