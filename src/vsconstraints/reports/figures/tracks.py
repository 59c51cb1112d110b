"""The markers' tracks in the image, one panel per controller, with a close-up where controllers differ most."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...comparisons.suite import BASELINE
from ...rows import Array, BoolArray
from ..plots import FAINT, INK, WIDTH, Sheet, line, patch, symbol
from ..plots.image import Plane, square, tracks
from .view import View

SHARE = 0.025
"""Half the side of the close-up, relative to the image's larger side; more where a violation is deeper."""

MAX_DEPTH = 0.05
"""A violation deeper than this share of the image needs no close-up."""

GRID = 33
"""Points in each direction at which it is asked whether a boundary passes."""

COLUMNS = 3
LEFT, GAP, TITLE = 0.62, 0.16, 0.27
BESIDE, APART = 0.5, 0.06
"""Side of a close-up relative to the width of its panel, and the gap between them [in]."""

START = symbol("o", "white", size=10.5)
EARLIER, LAST = symbol("*", "white", size=6.3), symbol("*", INK, "white", size=6.3)
SEEN = 0.005
"""Distance from the goal that is seen, relative to the size of the picture."""

NO_MARKER = "no marker\nenters"
REMARK: dict[str, Any] = {"fontsize": 8, "color": INK, "bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1.5}}
"""In a close-up of a law that stays away from where another one is shown; and how that is written."""

OUTSIDE: dict[str, Any] = {"color": "#B00020", "linewidth": 2.6}


def draw_tracks(view: View) -> Sheet | None:
    """Tracks of all markers, with the image's frame and the boundaries of the constraints in the image."""
    if not any(run.trajectory.features_px.size for run in view.runs.values()):
        return None
    names = view.competitors or view.shown
    plane = Plane.of(view.setup) if view.setup is not None else Plane(_size_seen(view))
    detail = close_up(view, plane)
    entries = _entries(view, plane, detail)
    # beside its close-up a panel takes half as much room again
    columns, share, apart = (COLUMNS, 1.0, 0.0) if detail is None else (COLUMNS - 1, 1.0 + BESIDE, APART)
    room = (WIDTH - LEFT - 0.08 - GAP * (columns - 1)) / columns
    width = (room - apart) / share
    height = width * plane.half[1] / plane.half[0]
    sheet = Sheet(left=LEFT)
    grid: dict[str, Any] = {"width": width, "above": TITLE, "labels": ("u [px]", "v [px], downwards")}
    panels = sheet.panels(len(names), columns, height=height, gap=room - width + GAP, **grid, same_y=True)
    whole = plane.whole
    for ax, name in zip(panels, names, strict=True):
        plane.draw(ax, labels=False, part=whole)
        draw_run(ax, view, name)
        view.title(ax, name)
        ax.set_title(view.runs[name].trajectory.status, loc="right", color=FAINT, fontsize=8, pad=4)
    if detail is not None:
        enlarged = plane.part(detail.centre, np.full(2, detail.half))
        for ax, name in zip(panels, names, strict=True):
            square(ax, detail.centre, detail.half, detail.half, color=INK, linewidth=0.8, zorder=8)
            beside = sheet.beside_panel(ax, APART, BESIDE * width)
            enlarged.draw(beside)
            if not enters(view.runs[name], detail):
                beside.text(0.5, 0.5, NO_MARKER, transform=beside.transAxes, ha="center", va="center", **REMARK)
            draw_run(beside, view, name, 1.5)
    # a legend stands in a free place of the grid, or below it
    taken, needed, tall = (len(names) - 1) % columns + 1, 0.21 * len(entries), TITLE + height
    if taken < columns and tall > needed:
        # above that place are the numbers and the label of a panel
        left = LEFT + taken * (room + GAP) + 0.2
        sheet.legend(entries, 1, (left, sheet.at - 0.5 * (tall + needed)), labelspacing=0.7)
    else:
        sheet.legend(entries)
    return sheet


def draw_run(ax: Any, view: View, name: str, width: float = 1.7) -> None:
    """Tracks of all markers with starts and goals, on those of tracking alone, and where a constraint is violated."""
    run, look = view.runs[name], view.looks[name]
    if view.baseline is not None and name != BASELINE:
        tracks(ax, view.baseline.trajectory.features_px, color=view.looks[BASELINE].colour, linewidth=0.9, zorder=2.2)
    tracks(ax, run.trajectory.features_px, color=look.colour, linestyle=look.line, linewidth=width, zorder=4)
    for marker, outside in _outside(run):
        ax.plot(*np.where(outside[:, None], run.trajectory.features_px[:, marker], np.nan).T, **OUTSIDE, zorder=5)
    _ends(ax, view, name)


def _outside(run: RunRecord) -> list[tuple[int, BoolArray]]:
    """Markers that are outside a row in the image, and in which samples (N,)."""
    clearance = run.trajectory.clearance
    every = [(marker, clearance[:, i] < -NEGLIGIBLE * run.length[i]) for i, marker in rows_in_image(run)]
    return [(marker, outside) for marker, outside in every if outside.any()]


def _apart(view: View, plane: Plane, name: str) -> bool:
    """Whether a marker ends in the part of the plane that is shown, where its goal's symbol does not hide it."""
    goals = view.setup.task.goals if view.setup is not None else ()
    ends = view.runs[name].trajectory.features_px[-1]
    seen = (np.abs(ends) <= plane.half).all(axis=-1)
    if not goals or ends.shape != goals[-1].pixels.shape:
        return bool(seen.any())
    away = (np.abs(ends - goals[-1].pixels) > SEEN * max(_size_seen(view))).any(axis=-1)
    return bool((seen & away).any())


def _size_seen(view: View) -> tuple[float, float]:
    seen = np.concatenate([run.trajectory.features_px.reshape(-1, 2) for run in view.runs.values()])
    w, h = 2.0 * np.nanmax(np.abs(seen), axis=0)
    return float(w), float(h)


def _ends(ax: Any, view: View, name: str) -> None:
    pixels = view.runs[name].trajectory.features_px
    ax.plot(*pixels[-1].T, **symbol("o", view.looks[name].colour, "white", 5.5), zorder=6)
    goals = view.setup.task.goals if view.setup is not None else ()
    for k, goal in enumerate(goals):
        ax.plot(*goal.pixels.T, **(LAST if k == len(goals) - 1 else EARLIER), zorder=6.2)
    ax.plot(*pixels[0].T, **START, zorder=6.4)
    for i, (u, v) in enumerate(pixels[0]):
        place: dict[str, Any] = {"ha": "center", "va": "center_baseline", "clip_on": True}
        ax.text(u, v, str(i + 1), fontsize=8, color=INK, zorder=6.5, **place)


def _entries(view: View, plane: Plane, detail: CloseUp | None) -> list[dict[str, Any]]:
    goals = len(view.setup.task.goals) if view.setup is not None else 0
    entries = [START | {"label": "start of marker 1, 2, …"}]
    if goals > 1:
        entries.append(EARLIER | {"label": "earlier goal"})
    if goals:
        entries.append(LAST | {"label": "goal" if goals == 1 else "last goal"})
    if any(_apart(view, plane, name) for name in view.competitors or view.shown):
        entries.append(symbol("o", "#777777", "white", 5.5, label="end, where not at the goal"))
    if view.baseline is not None and view.competitors:
        entries.append(line("tracking alone", view.looks[BASELINE].colour) | {"linewidth": 0.9})
    if any(_outside(view.runs[name]) for name in view.competitors or view.shown):
        entries.append(line("row in the image violated", **OUTSIDE))
    entries += plane.entries(forbidden="forbidden to markers")
    if detail is not None:
        side = 2.0 * detail.half
        entries.append(patch(f"close-up, {side:.0f} × {side:.0f} px", "none", edgecolor=INK, linewidth=0.8))
    return entries


# --- close-ups ---


class CloseUp(NamedTuple):
    """A square of the image: its centre (2,) and half its side [px]."""

    centre: Array
    half: float


def rows_in_image(run: RunRecord) -> list[tuple[int, int]]:
    """Index of each row that is about a marker's place in the image, and of its marker."""
    rows, count = [], run.trajectory.features_px.shape[1]
    for i, (label, unit) in enumerate(zip(run.trajectory.labels, run.units, strict=True)):
        digits = label.rpartition("marker ")[2].rstrip("]")
        if unit == "px" and digits.isdecimal() and int(digits) <= count:
            rows.append((i, int(digits) - 1))
    return rows


def close_up(view: View, plane: Plane) -> CloseUp | None:
    """The same close-up for all panels, or None where no row in the image matters.

    Around the deepest violation of a competitor if there is one; otherwise where the first
    controller that acts on such a row comes nearest to its boundary. It lies in the part of the plane that is
    shown, and a boundary passes through it: without one there is nothing to see.
    """
    size = max(plane.size)
    for place in (_deepest(view, plane, MAX_DEPTH * size), _nearest(view, plane)):
        if place is not None:
            centre, depth = place
            detail = CloseUp(centre, max(SHARE * size, 1.6 * depth))
            if _has_boundary(plane, detail):
                return detail
    return None


def enters(run: RunRecord, detail: CloseUp) -> bool:
    """Whether a marker of a run comes into the close-up, between samples included."""
    from matplotlib.path import Path
    from matplotlib.transforms import Bbox

    pixels, window = run.trajectory.features_px, Bbox([detail.centre - detail.half, detail.centre + detail.half])
    known = (track[np.isfinite(track).all(axis=1)] for track in np.moveaxis(pixels, 1, 0))
    return any(len(track) > 0 and Path(track).intersects_bbox(window, filled=False) for track in known)


def _has_boundary(plane: Plane, detail: CloseUp) -> bool:
    """Whether a boundary passes through a close-up."""
    moving = [points for _, lines in plane.moving for points in lines]
    if any((np.abs(points - detail.centre) < detail.half).all(axis=1).any() for points in moving):
        return True
    if not plane.constraints:
        return False
    u, v = (middle + np.linspace(-detail.half, detail.half, GRID) for middle in detail.centre)
    depth = plane.depth(u, v)
    return bool(depth.min() <= 0.0 <= depth.max())


def _phi_rows(view: View, run: RunRecord) -> list[tuple[int, int]]:
    """The rows in the image whose φ is shown."""
    return [(i, marker) for i, marker in rows_in_image(run) if run.trajectory.labels[i] in view.phi_rows]


def _deepest(view: View, plane: Plane, most: float) -> tuple[Array, float] | None:
    """Where a competitor is farthest outside, and how far [px]; violations by more than ``most`` are plain anyway."""
    deepest, worst = None, NEGLIGIBLE
    for run in view.compared:
        for i, marker in _phi_rows(view, run):
            clearance = _in_view(run, plane, i, marker)
            k = int(np.argmin(clearance))
            if -most < clearance[k] < 0.0 and -clearance[k] / run.length[i] > worst:
                worst = float(-clearance[k] / run.length[i])
                deepest = run.trajectory.features_px[k, marker], float(-clearance[k])
    return deepest


def _nearest(view: View, plane: Plane) -> tuple[Array, float] | None:
    """Where the first controller that acts on a row in the image comes nearest to the boundary of such a row."""
    for run in view.compared:
        acting = [(i, m) for i, m in _phi_rows(view, run) if run.trajectory.active[:, i].any()]
        if acting:
            i, marker = min(acting, key=lambda pair: float(_in_view(run, plane, *pair).min()))
            return run.trajectory.features_px[int(np.argmin(_in_view(run, plane, i, marker))), marker], 0.0
    return None


def _in_view(run: RunRecord, plane: Plane, i: int, marker: int) -> Array:
    """(N,) clearance of a row [px], infinite where its marker is not in the part of the plane that is shown."""
    seen = (np.abs(run.trajectory.features_px[:, marker]) <= plane.half).all(axis=1)
    clearance: Array = np.where(seen, run.trajectory.clearance[:, i], np.inf)
    return clearance
