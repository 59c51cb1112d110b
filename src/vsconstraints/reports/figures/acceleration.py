"""The commanded joint acceleration over time, one panel per controller."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..style import darker, shortened
from .decimate import extremes, window_means
from .sheet import WIDTH, Sheet, rows_of
from .view import View

RANGE_BINS, MEAN_BINS = 300, 100
COLUMNS = 3
LINEAR = 1.0
"""The axis is linear between ± this value and logarithmic beyond [rad/s²]."""


def draw_acceleration(view: View, path: Path) -> None:
    """Mean and range of q̈_c in short windows, all joints, with the same axis for every controller."""
    names = view.shown
    columns = min(COLUMNS, len(names))
    rows = rows_of(len(names), columns)
    left, gap, title, height, foot, legend = 0.62, 0.2, 0.26, 1.25, 0.4, 0.3
    width = (WIDTH - left - 0.2 - gap * (columns - 1)) / columns
    sheet = Sheet(legend + rows * (height + title) + foot)
    n = max(run.trajectory.qdd_command.shape[1] for run in view.runs.values())
    colours = [colormaps["viridis"](0.92 * k / max(n - 1, 1)) for k in range(n)]
    limit = _limit(view)
    for i, name in enumerate(names):
        row, column = divmod(i, columns)
        ax = sheet.axes(left + column * (width + gap), legend + title + row * (height + title), width, height)
        _panel(ax, view, name, colours, limit)
        below = i + columns >= len(names)
        ax.tick_params(labelbottom=below, labelleft=column == 0)
        if below:
            ax.set_xlabel("time [s]", labelpad=2)
        if column == 0:
            ax.set_ylabel("q̈ [rad/s²]", labelpad=1)
    handles = [Line2D([], [], color=colours[k], linewidth=2.0, label=f"joint {k + 1}") for k in range(n)]
    sheet.legend(handles, left, 0.08, min(n, 8), columnspacing=1.4)
    sheet.save(path)


def _limit(view: View) -> float:
    """Greatest |q̈_c| of all controllers, without the largest 0.05 % of the samples of each."""
    limit = LINEAR
    for run in view.runs.values():
        size = np.abs(run.trajectory.qdd_command)
        size = size[np.isfinite(size)]
        if len(size):
            limit = max(limit, float(np.quantile(size, 0.9995)))
    return 1.3 * limit


def _panel(ax: Any, view: View, name: str, colours: list[Any], limit: float) -> None:
    trajectory, look = view.runs[name].trajectory, view.looks[name]
    ax.set_yscale("symlog", linthresh=LINEAR, linscale=0.7)
    t, least, greatest = extremes(trajectory.t, trajectory.qdd_command, RANGE_BINS)
    middle, mean = window_means(trajectory.t, trajectory.qdd_command, MEAN_BINS)
    # joints whose command varies most lie below the others
    order = np.argsort(-np.nan_to_num(greatest - least).mean(axis=0), kind="stable")
    for rank, k in enumerate(order):
        ax.fill_between(
            t, least[:, k], greatest[:, k], color=colours[k], alpha=0.3, linewidth=0.0, zorder=2 + 0.01 * rank
        )
    for k in range(mean.shape[1]):
        ax.plot(middle, mean[:, k], color=colours[k], linewidth=1.1, zorder=3)
    for time in view.goal_changes:
        ax.axvline(time, color="#222222", linestyle=(0, (4, 3)), linewidth=0.9, zorder=1.5)
    ax.set_xlim(0.0, view.end)
    # few and short labels: those of neighbouring panels must not meet
    ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    ax.set_ylim(-limit, limit)
    decades = [10.0**k for k in range(int(np.log10(limit)) + 1)]
    ticks = [*(-d for d in reversed(decades)), 0.0, *decades]
    ax.set_yticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks])
    ax.set_yticks([], minor=True)
    ax.set_title(shortened(name), loc="left", color=darker(look.colour), fontweight="bold", pad=3)
