"""φ of the rows that matter over time, and when each row acts."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...comparisons.suite import BASELINE
from ...simulation import intervals
from ..plots import Sheet, area, band, decades, extremes, logarithmic, zero_line
from ..plots.style import FAINT
from .view import View

PANEL = 1.0
LANE, ROW_GAP = 0.075, 0.09
BINS = 300
CLIP = 1e3
"""φ is drawn up to this many times its bound."""


def draw_phi(view: View) -> Sheet | None:
    """One panel of φ / (T_s u⁺) for each row, and bars that show when each row holds the arm back."""
    if not view.phi_rows and not view.lane_rows:
        return None
    sheet = Sheet(left=1.85, right=0.2)
    sheet.legend(view.entries(bars_only=not view.phi_rows))
    lane = len(view.competitors) * LANE + ROW_GAP
    heights = [PANEL] * len(view.phi_rows) + [lane * len(view.lane_rows)] * bool(view.lane_rows)
    panels = sheet.panels(len(heights), height=heights, labels=("time [s]", ""))
    for ax, label in zip(panels, view.phi_rows, strict=False):
        _panel(ax, view, label)
        sheet.name(ax, _two_lines(label))
    if view.lane_rows:
        _lanes(panels[-1], view, lane)
        for i, label in enumerate(view.lane_rows):
            sheet.name(panels[-1], label, 1.0 - (i + 0.5) / len(view.lane_rows), fontsize=8)
    for ax in panels:
        view.time_axis(ax)
    return sheet


def _panel(ax: Any, view: View, label: str) -> None:
    band(ax, -1.0, 1.0)
    zero_line(ax)
    low, high = -3.0, 3.0
    relative = {}
    for name, run in view.runs.items():
        if label in run.trajectory.labels:
            i = run.trajectory.labels.index(label)
            values = relative[name] = run.trajectory.phi[:, i] / (run.Ts * run.switching_gain[i])
            low = min(low, float(np.nanmin(values, initial=low)))
            high = high if name == BASELINE else max(high, float(np.nanmax(values, initial=high)))
    for name, run, look in view.lines():
        if name in relative:
            t, least, greatest = extremes(run.trajectory.t, relative[name], BINS)
            ax.plot(t, greatest, **look)
            if name != BASELINE:
                area(ax, t, least, greatest, color=look["color"], alpha=0.15, linewidth=0.0, zorder=3)
    low, high = 1.3 * max(low, -CLIP), 1.5 * min(high, CLIP)
    ax.set_ylim(low, high)
    logarithmic(ax.yaxis, decades(low, high), 2.0, 1.2)
    ax.set_ylabel("φ / (Tₛ u⁺)", labelpad=1)


def _lanes(ax: Any, view: View, height: float) -> None:
    """One thin bar lane per controller in each row's band."""
    ax.set_title("when each row holds the arm back", loc="left", fontsize=8, color=FAINT, pad=2)
    ax.set_ylim(height * len(view.lane_rows), 0.0)
    ax.set_yticks([])
    ax.grid(False)
    for i, label in enumerate(view.lane_rows):
        if i % 2 == 0:
            band(ax, i * height, (i + 1) * height, "#F6F6F6", zorder=0.2)
        for k, name in enumerate(view.competitors):
            run = view.runs[name]
            if label not in run.trajectory.labels:
                continue
            active = run.trajectory.active[:, run.trajectory.labels.index(label)]
            spans = intervals(run.trajectory.t, active, max(10.0 * run.Ts, view.end / 200.0))
            bars = [(a, max(b - a, view.end / 500.0)) for a, b in spans]
            place = (i * height + 0.5 * ROW_GAP + k * LANE, 0.8 * LANE)
            ax.broken_barh(bars, place, color=view.looks[name].colour, linewidth=0.0, zorder=2)


def _two_lines(label: str) -> str:
    """``occlusion[bowl, marker 1]`` with its bracket on a second line, so that it fits beside a panel."""
    head, bracket, rest = label.partition("[")
    return f"{head}\n{bracket}{rest}" if len(label) > 14 else label
