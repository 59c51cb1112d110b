"""Tracks in the image of the worst run of each law, each in a scene of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....comparisons import RunRecord
from ....comparisons.metrics import NEGLIGIBLE
from ....simulation import Setup
from ...figures.close_up import rows_in_image
from ...plots import INK, WIDTH, Figure, Sheet, line, looks, shortened
from ...plots.image import Plane, symbol, tracks
from ...plots.sheet import rows_of
from ...plots.style import FAINT

COLUMNS = 3
LEFT, GAP, TITLE = 0.45, 0.5, 0.42
OUTSIDE: dict[str, Any] = {"color": "#B00020", "linewidth": 2.6}
START, GOAL = symbol("o", "white", size=6.0), symbol("*", INK, "white", 6.3)


@dataclass(frozen=True)
class Shown:
    """A run that is shown.

    Attributes
    ----------
    controller
        Of the law.
    where
        Which scene, for the title.
    setup
        What was simulated.
    run, baseline
        Of the law, and of tracking alone.
    """

    controller: str
    where: str
    setup: Setup
    run: RunRecord
    baseline: RunRecord


def draw_worst(shown: Sequence[Shown], laws: Sequence[str]) -> Sheet | None:
    """One panel per law."""
    shown = [one for one in shown if one.run.trajectory.features_px.size]
    if not shown:
        return None
    look = looks(laws)
    width = (WIDTH - LEFT - 0.1 - GAP * (COLUMNS - 1)) / COLUMNS
    planes = [Plane.of(one.setup) for one in shown]
    sheet = Sheet(left=LEFT)
    for row in range(rows_of(len(shown), COLUMNS)):
        some = slice(row * COLUMNS, (row + 1) * COLUMNS)
        left, top = LEFT, sheet.at + TITLE
        height = width * max(plane.size[1] / plane.size[0] for plane in planes[some])
        for one, plane in zip(shown[some], planes[some], strict=True):
            ax = sheet.axes(left, top, width, height)
            _panel(ax, one, plane, look[one.controller].colour)
            left += width + GAP
        sheet.at = top + height + 0.2
    entries = [
        START | {"label": "start"},
        GOAL | {"label": "goal"},
        line("tracking alone", looks(["tracking"])["tracking"].colour) | {"linewidth": 0.9},
        line("row in the image violated", **OUTSIDE),
        *Plane(planes[0].size, tuple(c for plane in planes for c in plane.constraints)).entries(),
    ]
    sheet.at += 0.1
    sheet.legend(entries)
    return sheet


def _panel(ax: Any, one: Shown, plane: Plane, colour: str) -> None:
    plane.draw(ax, labels=False)
    ax.set_aspect("equal", adjustable="box", anchor="N")
    pixels = one.run.trajectory.features_px
    if one.baseline.trajectory.features_px.size:
        grey = looks(["tracking"])["tracking"].colour
        tracks(ax, one.baseline.trajectory.features_px, color=grey, linewidth=0.9, zorder=2.2)
    tracks(ax, pixels, color=colour, linewidth=1.7, zorder=4)
    for i, marker in rows_in_image(one.run):
        outside = one.run.trajectory.clearance[:, i] < -NEGLIGIBLE * one.run.length[i]
        if outside.any():
            ax.plot(*np.where(outside[:, None], pixels[:, marker], np.nan).T, **OUTSIDE, zorder=5)
    ax.plot(*one.setup.task.goals[-1].pixels.T, **GOAL, zorder=6)
    ax.plot(*pixels[0].T, **START, zorder=6.4)
    ax.set_title(f"{shortened(one.controller)}\n", loc="left", fontsize=9.0, pad=2)
    ax.text(0.0, 1.02, one.where, transform=ax.transAxes, fontsize=8, color=FAINT, va="bottom")
    ax.set_title(f"{one.run.trajectory.status}\n", loc="right", fontsize=8, color=FAINT, pad=2)


WORST = Figure(
    "worst",
    "the worst run of each law",
    "Tracks of the markers in the worst run of each law, made again. Lengths are pixels from the image's centre.",
    draw_worst,
)
