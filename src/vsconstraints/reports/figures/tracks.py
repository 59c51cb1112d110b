"""Tracks of the markers in the image, one panel per controller, with a close-up.

The close-up shows the place where controllers differ most.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...comparisons.suite import BASELINE
from ...rows import Array
from ..plots.image import OUTSIDE, START, Plane, numbered, passes_through, rectangle, tracks
from ..plots.sheet import WIDTH, Sheet
from ..plots.style import FAINT, INK, Style, line, patch, symbol
from .view import View, violated_in_samples

#: Half the side of the close-up, larger for a deeper violation, and the depth beyond which
#: violations need no close-up, relative to the larger side of the image.
SHARE = 0.025
MAX_DEPTH = 0.05
GRID = 33  # points per direction at which a boundary is searched
COLUMNS = 3
LEFT = 0.62
GAP = 0.16
TITLE = 0.27
TITLE_LINE = 0.14
LEGEND_LINE = 0.21
# Side of a close-up relative to the width of its panel; gap between them [in].
BESIDE = 0.5
APART = 0.06
EARLIER = symbol("*", "white", size=6.3, zorder=6.2)
LAST = symbol("*", INK, "white", size=6.3, zorder=6.2)
VIOLATED: Style = {"color": OUTSIDE, "linewidth": 2.6, "zorder": 5}


class CloseUp(NamedTuple):
    """Square of the image: its centre (2,) and half its side [px]."""

    centre: Array
    half: float


def draw_tracks(view: View) -> Sheet | None:
    """Draw the tracks of all markers, the frame of the image and the boundaries in the image."""
    if not any(run.trajectory.features_px.size for run in view.runs.values()):
        return None
    names = view.competitors or view.shown
    plane = _plane_of(view)
    detail = close_up(view, plane)
    # With its close-up a panel takes half as much room again.
    columns = COLUMNS if detail is None else COLUMNS - 1
    room = (WIDTH - LEFT - 0.08 - GAP * (columns - 1)) / columns
    width = room
    if detail is not None:
        width = (room - APART) / (1.0 + BESIDE)
    height = width * plane.half[1] / plane.half[0]
    above = TITLE + TITLE_LINE * (view.title_lines(names) - 1)
    sheet = Sheet(left=LEFT)
    panels = sheet.panels(
        len(names),
        columns,
        height=height,
        width=width,
        above=above,
        gap=room - width + GAP,
        labels=("u [px]", "v [px], downwards"),
        same_y=True,
    )
    for ax, name in zip(panels, names, strict=True):
        plane.draw(ax, labels=False)
        draw_run(ax, view, name)
        view.title(ax, name, fontsize=8)  # leaves room for the longest status
        status = view.runs[name].trajectory.status
        ax.set_title(status, loc="right", color=FAINT, fontsize=8, pad=4)
        if detail is not None:
            rectangle(ax, detail.centre, detail.half, color=INK, linewidth=0.8, zorder=8)
            beside = sheet.beside_panel(ax, APART, BESIDE * width)
            plane.draw_part(beside, detail.centre, np.full(2, detail.half))
            draw_run(beside, view, name, 1.5)
    # The legend stands in a free place of the grid, or below it.
    entries = _entries(view, plane, names, detail)
    panels_in_last_row = (len(names) - 1) % columns + 1
    legend_height = LEGEND_LINE * len(entries)
    row_height = above + height
    if panels_in_last_row < columns and row_height > legend_height:
        # The space above that place has the numbers and the label of a panel.
        left = LEFT + panels_in_last_row * (room + GAP) + 0.2
        top = sheet.bottom - 0.5 * (row_height + legend_height)
        sheet.legend(entries, 1, (left, top), labelspacing=0.7)
    else:
        sheet.legend(entries)
    return sheet


def _plane_of(view: View) -> Plane:
    """Return the image plane of a view's setup, or one around all tracks without a setup."""
    if view.setup is not None:
        return Plane.of(view.setup)
    pixels = [run.trajectory.features_px.reshape(-1, 2) for run in view.runs.values()]
    reach = np.nanmax(np.abs(np.concatenate(pixels)), axis=0)
    return Plane(tuple(2.0 * reach))


def draw_run(ax: Any, view: View, name: str, width: float = 1.7) -> None:
    """Draw the tracks of all markers with starts, goals and violations, above the baseline's."""
    run = view.runs[name]
    look = view.looks[name]
    pixels = run.trajectory.features_px
    if view.baseline is not None and name != BASELINE:
        tracks(
            ax,
            view.baseline.trajectory.features_px,
            color=view.looks[BASELINE].colour,
            linewidth=0.9,
            zorder=2.2,
        )
    tracks(
        ax,
        pixels,
        color=look.colour,
        linestyle=look.line,
        linewidth=width,
        zorder=4,
    )
    for track in _violations(run):
        ax.plot(*track.T, **VIOLATED)
    end = symbol("o", look.colour, "white", 5.5, zorder=6)
    ax.plot(*pixels[-1].T, **end)
    if view.setup is not None:
        goals = view.setup.task.goals
        for goal in goals[:-1]:
            ax.plot(*goal.pixels.T, **EARLIER)
        for goal in goals[-1:]:
            ax.plot(*goal.pixels.T, **LAST)
    numbered(ax, pixels[0])


def _rows_in_image(run: RunRecord) -> Iterator[tuple[int, Array]]:
    """Yield the index of each row on a marker's place in the image, and that place (N, 2) [px]."""
    trajectory = run.trajectory
    pixels = trajectory.features_px
    marker_count = pixels.shape[1]
    for i, label in enumerate(trajectory.labels):
        match = re.search(r"marker (\d+)\]*$", label)
        if run.units[i] != "px" or match is None:
            continue
        marker = int(match[1]) - 1
        if marker < marker_count:
            yield i, pixels[:, marker]


def _entries(view: View, plane: Plane, names: list[str], detail: CloseUp | None) -> list[Style]:
    """Return the legend entries of tracks, image and close-up."""
    entries = [START | {"label": "start of marker 1, 2, …"}]
    if view.setup is not None:
        if len(view.setup.task.goals) > 1:
            entries.append(EARLIER | {"label": "earlier goal"})
            entries.append(LAST | {"label": "last goal"})
        else:
            entries.append(LAST | {"label": "goal"})
    end = symbol("o", "#777777", "white", 5.5, label="end, where not at the goal")
    entries.append(end)
    if view.baseline is not None and view.competitors:
        colour = view.looks[BASELINE].colour
        entries.append(line("tracking alone", colour, linewidth=0.9))
    violations = [track for name in names for track in _violations(view.runs[name])]
    if violations:
        entries.append(line("row in the image violated", **VIOLATED))
    entries += plane.entries(forbidden="forbidden to markers")
    if detail is not None:
        side = round(2.0 * detail.half)
        text = f"close-up, {side} × {side} px"
        entries.append(patch(text, "none", edgecolor=INK, linewidth=0.8))
    return entries


def _violations(run: RunRecord) -> Iterator[Array]:
    """Yield pixels (N, 2) of a marker while it violates a row in the image, NaN otherwise."""
    outside = violated_in_samples(run)
    for i, pixels in _rows_in_image(run):
        if outside[:, i].any():
            yield np.where(outside[:, i, None], pixels, np.nan)


def close_up(view: View, plane: Plane) -> CloseUp | None:
    """Return the same close-up for all panels, or None if no row in the image matters.

    It is centred where a competitor is deepest outside, or nearest to a boundary of an active row,
    relative to the row's L. It lies in the shown part of the plane, and a boundary passes through
    it.
    """
    candidates: list[tuple[float, CloseUp]] = []
    for name in view.runs:
        if name == BASELINE:
            continue
        run = view.runs[name]
        for i, pixels in _rows_in_image(run):
            if run.trajectory.labels[i] in view.phi_rows:
                candidates += _candidates(run, i, pixels, plane)
    candidates.sort(key=lambda candidate: candidate[0])
    for _, detail in candidates:
        if _has_boundary(plane, detail):
            return detail
    return None


def _candidates(
    run: RunRecord, i: int, pixels: Array, plane: Plane
) -> Iterator[tuple[float, CloseUp]]:
    """Yield the close-up of a row where its marker (N, 2) [px] comes nearest to the boundary.

    Yield it with the clearance there relative to L; none if the row does not matter, or if the
    violation is deep enough to be seen in the whole image, or unknown.
    """
    trajectory = run.trajectory
    size = max(plane.size)
    is_shown = (np.abs(pixels) <= plane.half).all(axis=1)
    clearance = np.where(is_shown, trajectory.clearance[:, i], np.inf)
    nearest = int(np.argmin(clearance))
    least = float(clearance[nearest])
    if math.isnan(least) or least <= -MAX_DEPTH * size:
        return
    length = run.length[i]
    is_outside = least < -NEGLIGIBLE * length
    if is_outside or trajectory.active[:, i].any():
        half = max(SHARE * size, -1.6 * least)
        yield least / length, CloseUp(pixels[nearest], half)


def _has_boundary(plane: Plane, detail: CloseUp) -> bool:
    """Return True if a fixed or moving boundary passes through a close-up."""
    centre = detail.centre
    for _, lines in plane.moving:
        for points in lines:
            if passes_through(points - centre, detail.half):
                return True
    offsets = np.linspace(-detail.half, detail.half, GRID)
    u, v = centre[:, None] + offsets
    depth = plane.depth(u, v)
    return bool(depth.min() <= 0.0 <= depth.max())
