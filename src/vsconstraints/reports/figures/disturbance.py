"""What an arm with mass made of its commands: d_c of eq. (6) over time, one panel per controller."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...simulation.dynamics.equivalent import Equivalent
from ..plots import Sheet, area, decades, extremes, line, logarithmic
from ..plots.style import FAINT
from .view import View

BINS = 300
LINEAR = 0.01
"""The axis is linear between ± this value and logarithmic beyond [rad/s²]."""


def draw_disturbance(view: View) -> Sheet | None:
    """Range of d_c in short windows, all joints, with the same axis for every controller; nothing without a plant."""
    if view.setup is None or view.setup.dynamics is None:
        return None
    from matplotlib import colormaps

    found = {name: Equivalent.of(view.runs[name].trajectory) for name in view.shown}
    n = max(one.disturbance.shape[1] for one in found.values())
    colours = [colormaps["viridis"](0.92 * k / max(n - 1, 1)) for k in range(n)]
    limit = 1.3 * max(
        LINEAR, *(float(np.nan_to_num(np.abs(one.disturbance)).max(initial=0.0)) for one in found.values())
    )
    sheet = Sheet(left=0.62, right=0.2)
    sheet.legend([line(f"joint {k + 1}", colour) for k, colour in enumerate(colours)], min(n, 8))
    labels = ("time [s]", "d_c [rad/s²]")
    panels = sheet.panels(len(found), 3, height=1.25, gap=0.3, above=0.42, labels=labels, same_y=True)
    for ax, (name, one) in zip(panels, found.items(), strict=True):
        _panel(ax, one, colours)
        view.time_axis(ax)
        ax.set_ylim(-limit, limit)
        logarithmic(ax.yaxis, decades(-limit, limit, LINEAR), LINEAR, 0.7)
        view.title(ax, name, above=12)
        told = f"rms {one.rms.max():.2g} rad/s², lag {1e3 * one.time_constant.max():.2g} ms"
        ax.text(0.0, 1.03, told, transform=ax.transAxes, fontsize=8, color=FAINT)
    return sheet


def _panel(ax: Any, one: Equivalent, colours: list[Any]) -> None:
    t, least, greatest = extremes(one.t, one.disturbance, BINS)
    order = np.argsort(-np.nan_to_num(greatest - least).mean(axis=0), kind="stable")
    for rank, k in enumerate(order):
        area(ax, t, least[:, k], greatest[:, k], color=colours[k], alpha=0.7, linewidth=0.5, zorder=2 + 0.01 * rank)
