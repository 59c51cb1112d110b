"""The markers' tracks in the image, one panel per controller."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...comparisons.suite import BASELINE
from ..style import Look, darker, shortened
from .close_up import CloseUp, close_up, marker_of
from .outlines import AROUND, FORBIDDEN, HATCH, Outlines, moving_style
from .sheet import WIDTH, Sheet, rows_of
from .view import View

OUTSIDE = "#B00020"
INK = "#222222"
FRAME = "#6A6A6A"
COLUMNS = 3
LEFT, GAP, TITLE, FOOT = 0.62, 0.16, 0.3, 0.45


def draw_tracks(view: View, path: Path) -> None:
    """Tracks of all markers, with the image's frame and the boundaries of the constraints in the image."""
    names = view.competitors or view.shown
    size = _image_size(view)
    columns = min(COLUMNS, len(names))
    rows = rows_of(len(names), columns)
    width = (WIDTH - LEFT - 0.08 - GAP * (COLUMNS - 1)) / COLUMNS
    height = width * size[1] / size[0]
    outlines = Outlines.of(view.setup, size)
    detail = close_up(view, size, outlines.half_size)
    handles = _legend(view, outlines, detail)
    # a legend stands in a free place of the grid, or below it
    taken = len(names) - columns * (rows - 1)
    beside = taken < COLUMNS and height > 0.21 * len(handles)
    below = 0.0 if beside else 0.2 * rows_of(len(handles), 3) + 0.05
    sheet = Sheet(rows * (height + TITLE) + FOOT + below)
    for i, name in enumerate(names):
        row, column = divmod(i, columns)
        ax = sheet.axes(LEFT + column * (width + GAP), TITLE + row * (height + TITLE), width, height)
        _prepare(ax, size, show_u=i + columns >= len(names), show_v=column == 0)
        _panel(ax, view, name, outlines)
        if detail is not None:
            _detail(ax, view, name, outlines, detail)
        ax.set_title(shortened(name), loc="left", color=darker(view.looks[name].colour), fontweight="bold", pad=4)
        ax.set_title(view.runs[name].trajectory.status, loc="right", color="#444444", fontsize=8, pad=4)
    if beside:
        top = TITLE + (rows - 1) * (height + TITLE)
        pad = 0.5 * (height - 0.21 * len(handles)) if rows == 1 else 0.45
        sheet.legend(handles, LEFT + taken * (width + GAP) + 0.2, top + pad, 1, labelspacing=0.7)
    else:
        sheet.legend(handles, LEFT, sheet.height - below, 3, columnspacing=1.4)
    sheet.save(path)


def _panel(ax: Any, view: View, name: str, outlines: Outlines) -> None:
    run, look = view.runs[name], view.looks[name]
    outlines.draw(ax)
    if view.baseline is not None and name != BASELINE:
        _lines(ax, view.baseline, view.looks[BASELINE], width=0.9, order=2.2)
    _lines(ax, run, look, width=1.7, order=4.0)
    _outside(ax, run)
    _ends(ax, view, run, look)


def _detail(ax: Any, view: View, name: str, outlines: Outlines, detail: CloseUp) -> None:
    inset = detail.place(ax)
    outlines.draw(inset, detail.centre, detail.half)
    if view.baseline is not None and name != BASELINE:
        _lines(inset, view.baseline, view.looks[BASELINE], width=0.9, order=2.2)
    _lines(inset, view.runs[name], view.looks[name], width=1.3, order=4.0)
    _outside(inset, view.runs[name])
    half = detail.half
    ax.add_patch(
        Rectangle(
            tuple(detail.centre - half), 2.0 * half, 2.0 * half, fill=False, edgecolor=INK, linewidth=0.8, zorder=8
        )
    )


def _image_size(view: View) -> tuple[float, float]:
    if view.setup is not None:
        w, h = view.setup.scene.camera.size
        return float(w), float(h)
    seen = np.concatenate([run.trajectory.features_px.reshape(-1, 2) for run in view.runs.values()])
    w, h = 2.0 * np.nanmax(np.abs(seen), axis=0)
    return float(w), float(h)


def _prepare(ax: Any, size: tuple[float, float], *, show_u: bool, show_v: bool) -> None:
    w, h = size
    ax.set_xlim(-0.5 * AROUND * w, 0.5 * AROUND * w)
    ax.set_ylim(0.5 * AROUND * h, -0.5 * AROUND * h)
    ax.grid(False)
    ax.add_patch(Rectangle((-0.5 * w, -0.5 * h), w, h, fill=False, edgecolor=FRAME, linewidth=1.6, zorder=2.5))
    ticks = _ticks(0.5 * max(size))
    ax.set_xticks([x for x in ticks if abs(x) <= 0.5 * w])
    ax.set_yticks([y for y in ticks if abs(y) <= 0.5 * h])
    ax.tick_params(labelbottom=show_u, labelleft=show_v)
    if show_u:
        ax.set_xlabel("u [px]", labelpad=1)
    if show_v:
        ax.set_ylabel("v [px], downwards", labelpad=0)


def _ticks(half: float) -> list[float]:
    """Up to three round numbers on either side of zero."""
    decade = 10.0 ** np.floor(np.log10(half))
    step = next(decade * k for k in (0.2, 0.5, 1.0, 2.0, 5.0, 10.0) if half / (decade * k) <= 3.0)
    k = int(half / step)
    return [i * step for i in range(-k, k + 1)]


def _lines(ax: Any, run: RunRecord, look: Look, width: float, order: float) -> None:
    pixels = run.trajectory.features_px
    for i in range(pixels.shape[1]):
        ax.plot(*pixels[:, i].T, color=look.colour, linestyle=look.line, linewidth=width, zorder=order)


def _outside(ax: Any, run: RunRecord) -> None:
    """Where a row in the image is violated: a red line on top of the marker's track."""
    trajectory = run.trajectory
    for k, label in enumerate(trajectory.labels):
        marker = marker_of(label)
        if run.units[k] != "px" or marker is None or marker >= trajectory.features_px.shape[1]:
            continue
        outside = trajectory.clearance[:, k] < -NEGLIGIBLE * run.length[k]
        if outside.any():
            track = np.where(outside[:, None], trajectory.features_px[:, marker], np.nan)
            ax.plot(*track.T, color=OUTSIDE, linewidth=2.6, zorder=5, solid_capstyle="round")


def _ends(ax: Any, view: View, run: RunRecord, look: Look) -> None:
    pixels = run.trajectory.features_px
    goals = view.setup.task.goals if view.setup is not None else ()
    ax.plot(*pixels[-1].T, **_dot(look.colour), zorder=6)
    for k, goal in enumerate(goals):
        ax.plot(*goal.pixels.T, **_star(last=k == len(goals) - 1), zorder=6.2)
    ax.plot(*pixels[0].T, **_circle(), zorder=6.4)
    for i, (u, v) in enumerate(pixels[0]):
        ax.text(u, v, str(i + 1), ha="center", va="center_baseline", fontsize=8, color=INK, zorder=6.5, clip_on=True)


def _circle() -> dict[str, Any]:
    return {"linestyle": "none", "marker": "o", "markersize": 10.5, "markerfacecolor": "white", "markeredgecolor": INK}


def _dot(colour: str) -> dict[str, Any]:
    return {"linestyle": "none", "marker": "o", "markersize": 5.5, "color": colour, "markeredgecolor": "white"}


def _star(*, last: bool) -> dict[str, Any]:
    face, edge = (INK, "white") if last else ("white", INK)
    return {
        "linestyle": "none",
        "marker": "*",
        "markersize": 9.5,
        "markerfacecolor": face,
        "markeredgecolor": edge,
        "markeredgewidth": 0.7,
    }


def _legend(view: View, outlines: Outlines, detail: CloseUp | None) -> list[Any]:
    goals = len(view.setup.task.goals) if view.setup is not None else 0
    handles: list[Any] = [Line2D([], [], **_circle(), label="start of marker 1, 2, …")]
    if goals > 1:
        handles.append(Line2D([], [], **_star(last=False), label="earlier goal"))
    if goals:
        handles.append(Line2D([], [], **_star(last=True), label="goal" if goals == 1 else "last goal"))
    handles.append(Line2D([], [], **_dot("#777777"), label="end, where not at the goal"))
    if view.baseline is not None and view.competitors:
        handles.append(Line2D([], [], color=view.looks[BASELINE].colour, linewidth=0.9, label="tracking alone"))
    if outlines.any:
        handles.append(Line2D([], [], color=OUTSIDE, linewidth=2.6, label="row in the image violated"))
    handles.append(Patch(facecolor="none", edgecolor=FRAME, linewidth=1.6, label="image"))
    if outlines.constraints:
        handles.append(
            Patch(facecolor=FORBIDDEN, edgecolor=HATCH, hatch="/////", linewidth=0.0, label="forbidden to markers")
        )
    if outlines.moving:
        handles.append(Line2D([], [], **moving_style(2), label="moving boundary, at the times given"))
    if detail is not None:
        side = 2.0 * detail.half
        handles.append(
            Patch(facecolor="none", edgecolor=INK, linewidth=0.8, label=f"close-up, {side:.0f} × {side:.0f} px")
        )
    return handles
