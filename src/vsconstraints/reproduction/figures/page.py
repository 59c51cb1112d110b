"""A figure as the paper lays them out: images on top, signals over time below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator

from ...reports.figures.decimate import zigzag
from ...reports.figures.outlines import FORBIDDEN, HATCH, Outlines
from ...reports.figures.sheet import STYLE as COMMON
from ...reports.figures.sheet import WIDTH, Sheet
from ...rows import Array
from ..runs import Run

STYLE = {
    **COMMON,
    "text.parse_math": True,  # labels are written here, none comes from a user
    "mathtext.fontset": "dejavusans",
    "axes.labelsize": 9.0,
    "legend.handlelength": 2.4,
}

BLUE, MAGENTA, RED = "#1447C4", "#C2188F", "#D42A2A"
CYAN, GREEN, DARK = "#00A0C6", "#2E8B3D", "#1A1A1A"
START = "#86DC6A"
"""The paper's light green of starting positions."""

AXES = ((BLUE, "-"), (MAGENTA, "--"), (RED, ":"))
"""The paper's lines for the x, y and z parts of an error."""

JOINTS = ("#1447C4", "#C2188F", "#2E8B3D", "#E07B00", "#7A4FBF", "#1A1A1A")
"""One colour for each of up to six joints."""

SYMBOLS = ("o", "^", "s", "*")
"""The paper's symbols of the four markers in the case study: circle, triangle, square, star."""

BINS = 500
LEFT, RIGHT, FOOT, COLUMN_GAP = 0.72, 0.15, 0.44, 0.9


class Page:
    """A sheet with square views on top and a grid of panels over time below.

    Parameters
    ----------
    views
        Size (width, height) of each view [in], from left to right; a legend finds room right of them.
    panels
        Number of panels over time.
    columns
        In how many columns they stand.
    panel_height, row_gap, views_top, view_gap, left
        [in].
    """

    def __init__(
        self,
        views: Sequence[tuple[float, float]],
        panels: int,
        columns: int = 2,
        panel_height: float = 1.45,
        row_gap: float = 0.16,
        views_top: float = 0.12,
        view_gap: float = 0.62,
        left: float = LEFT,
    ) -> None:
        rows = -(-panels // columns)
        top = views_top + max((height for _, height in views), default=0.0) + (0.58 if views else 0.0)
        step = panel_height + row_gap
        self.sheet = Sheet(top + rows * step - row_gap * (panels > 0) + (FOOT if panels else 0.0))
        self.views, at = [], left
        for width, height in views:
            self.views.append(self.sheet.axes(at, views_top, width, height))
            at += width + view_gap
        self.beside = at - view_gap + 0.3
        width = (WIDTH - left - RIGHT - (columns - 1) * COLUMN_GAP) / columns
        self.panels = [
            self.sheet.axes(
                left + (i % columns) * (width + COLUMN_GAP), top + (i // columns) * step, width, panel_height
            )
            for i in range(panels)
        ]
        for i, ax in enumerate(self.panels):
            last = i + columns >= panels
            ax.tick_params(labelbottom=last)
            if last:
                ax.set_xlabel("time [s]", labelpad=2)

    def legend(self, handles: Sequence[Any], top: float = 0.14, left: float | None = None, **options: Any) -> None:
        """A legend right of the views."""
        self.sheet.legend(handles, self.beside if left is None else left, top, 1, labelspacing=0.75, **options)


def signal(ax: Any, run: Run, values: Array, **look: Any) -> None:
    """One signal over time: every peak is kept, however many samples there are."""
    t, y = zigzag(run.t, values, BINS)
    ax.plot(t, y, **{"linewidth": 1.5, **look})


def time_axis(ax: Any, run: Run, label: str) -> None:
    """Limits, label and changes of the goal."""
    ax.set_xlim(0.0, float(run.t[-1]))
    ax.set_ylabel(label, labelpad=3)
    ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    for goal in run.setup.task.goals[1:]:
        ax.axvline(goal.from_time, color=DARK, linestyle=(0, (5, 3)), linewidth=1.8, zorder=1.6)


def zero_line(ax: Any) -> None:
    """Where φ = 0."""
    ax.axhline(0.0, color=DARK, linewidth=0.8, zorder=1.5)


def inside_legend(ax: Any, columns: int = 1, **options: Any) -> None:
    """A legend within a panel, on a white ground so that lines do not cross it."""
    legend = ax.legend(
        **{
            "loc": "best",
            "ncols": columns,
            "fontsize": 8.0,
            "frameon": True,
            "framealpha": 0.92,
            "edgecolor": "none",
            "borderpad": 0.35,
            "borderaxespad": 0.4,
            "labelspacing": 0.3,
            "columnspacing": 1.2,
            **options,
        }
    )
    legend.get_frame().set_facecolor("white")


def image_plane(
    ax: Any, run: Run, around: float = 1.12, centre: Array | None = None, half: float = 0.0, upwards: bool = False
) -> None:
    """The image's frame and the boundaries in it, everywhere or within ``half`` of a centre [px].

    ``v`` points down, as in an image, or upwards, as the paper draws its first example.
    """
    width, height = run.setup.scene.camera.size
    outlines = Outlines.of(run.setup, (width, height))
    if centre is None:
        ax.set_xlim(-0.5 * around * width, 0.5 * around * width)
        ax.set_ylim(0.5 * around * height, -0.5 * around * height)
        outlines.draw(ax)
    else:
        ax.set_xlim(centre[0] - half, centre[0] + half)
        ax.set_ylim(centre[1] + half, centre[1] - half)
        outlines.draw(ax, centre, half)
    ax.add_patch(
        Rectangle(
            (-0.5 * width, -0.5 * height), width, height, fill=False, edgecolor="#555555", linewidth=1.8, zorder=2.5
        )
    )
    ax.grid(False)
    ax.set_aspect("equal")
    ax.set_xlabel("u [px]", labelpad=1)
    ax.set_ylabel(f"v [px], {'upwards' if upwards else 'downwards'}", labelpad=1)
    if upwards:
        ax.invert_yaxis()
    ax.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))


def track(ax: Any, run: Run, marker: int, **look: Any) -> None:
    """The path of a marker (counted from 0) in the image."""
    ax.plot(*run.trajectory.features_px[:, marker].T, **{"linewidth": 2.0, "zorder": 4, **look})


def end_symbol(ax: Any, at: Array, symbol: str, face: str, edge: str = DARK, order: float = 6.0) -> None:
    """A symbol at one place of the image."""
    size = {"*": 13.0, "o": 8.5, "s": 8.0, "^": 9.0, "x": 8.0}.get(symbol, 8.5)
    width = 2.0 if symbol == "x" else 0.9
    ax.plot(
        *at, marker=symbol, markersize=size, markerfacecolor=face, markeredgecolor=edge, markeredgewidth=width,
        linestyle="none", zorder=order,
    )  # fmt: skip


def symbol_handle(symbol: str, face: str, label: str, edge: str = DARK) -> Any:
    """Legend entry of a symbol."""
    size = {"*": 12.0, "x": 8.0}.get(symbol, 8.0)
    return Line2D(
        [], [], linestyle="none", marker=symbol, markersize=size, markerfacecolor=face, markeredgecolor=edge,
        markeredgewidth=2.0 if symbol == "x" else 0.9, label=label,
    )  # fmt: skip


def line_handle(colour: str, line: Any, label: str, width: float = 2.0) -> Any:
    """Legend entry of a line."""
    return Line2D([], [], color=colour, linestyle=line, linewidth=width, label=label)


def image_handles(boundary: str) -> list[Any]:
    """Legend entries of the image's frame and of what is forbidden."""
    return [
        Patch(facecolor="none", edgecolor="#555555", linewidth=1.8, label="image"),
        Line2D([], [], color="#222222", linewidth=0.9, label=boundary),
        Patch(facecolor=FORBIDDEN, edgecolor=HATCH, hatch="/////", linewidth=0.0, label="forbidden"),
    ]


def limits_around(ax: Any, low: float, high: float, share: float = 0.06) -> None:
    """Vertical limits with a little room."""
    room = share * (high - low)
    ax.set_ylim(low - room, high + room)


def clipped(values: Array, low: float, high: float) -> Array:
    """Values outside the panel moved just outside it, so that lines leave it steeply and nothing overflows."""
    span = high - low
    result: Array = np.clip(values, low - span, high + span)
    return result
