"""The commanded joint acceleration over time, one panel per controller."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..plots import Sheet, area, decades, extremes, line, logarithmic, window_means
from .view import View

RANGE_BINS, MEAN_BINS = 300, 100
LINEAR = 1.0
"""The axis is linear between ± this value and logarithmic beyond [rad/s²]."""


def draw_acceleration(view: View) -> Sheet:
    """Mean and range of q̈_c in short windows, all joints, with the same axis for every controller."""
    from matplotlib import colormaps

    n = max(run.trajectory.qdd_command.shape[1] for run in view.runs.values())
    colours = [colormaps["viridis"](0.92 * k / max(n - 1, 1)) for k in range(n)]
    limit = _limit(view)
    sheet = Sheet(left=0.62, right=0.2)
    sheet.legend([line(f"joint {k + 1}", colour) for k, colour in enumerate(colours)], min(n, 8))
    labels = ("time [s]", "q̈ [rad/s²]")
    panels = sheet.panels(len(view.shown), 3, height=1.25, gap=0.3, above=0.26, labels=labels, same_y=True)
    for ax, name in zip(panels, view.shown, strict=True):
        _panel(ax, view, name, colours)
        ax.set_ylim(-limit, limit)
        logarithmic(ax.yaxis, decades(-limit, limit, LINEAR), LINEAR, 0.7)
        view.title(ax, name)
    return sheet


def _limit(view: View) -> float:
    """Greatest |q̈_c| of all controllers, without the largest 0.05 % of the samples of each."""
    limit = LINEAR
    for run in view.runs.values():
        size = np.abs(run.trajectory.qdd_command)
        size = size[np.isfinite(size)]
        if len(size):
            limit = max(limit, float(np.quantile(size, 0.9995)))
    return 1.3 * limit


def _panel(ax: Any, view: View, name: str, colours: list[Any]) -> None:
    trajectory = view.runs[name].trajectory
    t, least, greatest = extremes(trajectory.t, trajectory.qdd_command, RANGE_BINS)
    middle, mean = window_means(trajectory.t, trajectory.qdd_command, MEAN_BINS)
    # joints whose command varies most lie below the others
    order = np.argsort(-np.nan_to_num(greatest - least).mean(axis=0), kind="stable")
    for rank, k in enumerate(order):
        place: dict[str, Any] = {"linewidth": 0.0, "zorder": 2 + 0.01 * rank}
        area(ax, t, least[:, k], greatest[:, k], color=colours[k], alpha=0.3, **place)
        ax.plot(middle, mean[:, k], color=colours[k], linewidth=1.1, zorder=3)
    view.time_axis(ax)
    # few and short labels: those of neighbouring panels must not meet
    ax.locator_params(axis="x", nbins=5, steps=[1, 2, 5, 10])
