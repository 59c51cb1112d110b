"""φ of the rows that matter over time, and when each row acts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons.suite import BASELINE
from ...simulation import intervals
from .decimate import extremes
from .sheet import WIDTH, Sheet, controller_handles, rows_of, widths
from .view import View

LEFT, RIGHT = 1.85, 0.2
PANEL, GAP = 1.0, 0.12
LANE, ROW_GAP = 0.075, 0.09
BINS = 300
CLIP = 1e3
"""φ is drawn up to this many times its bound."""


def draw_phi(view: View, path: Path) -> None:
    """One panel of φ / (T_s u⁺) for each row, and bars that show when each row holds the arm back."""
    names = view.shown
    legend_rows = rows_of(len(names), 3)
    top = 0.08 + 0.17 * legend_rows + 0.08
    lanes = len(view.competitors) * LANE + ROW_GAP
    bars = lanes * len(view.lane_rows) + (0.3 if view.lane_rows else 0.0)
    sheet = Sheet(top + len(view.phi_rows) * (PANEL + GAP) + bars + 0.42)
    sheet.legend(controller_handles(view.looks, names), LEFT, 0.08, 3, columnspacing=1.6)
    width = WIDTH - LEFT - RIGHT
    axes = []
    for i, label in enumerate(view.phi_rows):
        ax = sheet.axes(LEFT, top + i * (PANEL + GAP), width, PANEL)
        _panel(ax, view, label)
        middle = top + i * (PANEL + GAP) + 0.5 * PANEL
        sheet.text(0.08, middle, _two_lines(label), va="center", ha="left", fontsize=8.5)
        axes.append(ax)
    if view.lane_rows:
        above = top + len(view.phi_rows) * (PANEL + GAP) + 0.2
        ax = sheet.axes(LEFT, above, width, lanes * len(view.lane_rows))
        _lanes(ax, view, lanes)
        for i, label in enumerate(view.lane_rows):
            sheet.text(0.08, above + (i + 0.5) * lanes, label, va="center", ha="left", fontsize=8)
        sheet.text(
            LEFT, above - 0.03, "when each row holds the arm back", va="bottom", ha="left", fontsize=8, color="#444444"
        )
        axes.append(ax)
    for ax in axes:
        ax.set_xlim(0.0, view.end)
        ax.tick_params(labelbottom=ax is axes[-1])
        for time in view.goal_changes:
            ax.axvline(time, color="#222222", linestyle=(0, (4, 3)), linewidth=0.9, zorder=1.5)
    axes[-1].set_xlabel("time [s]", labelpad=2)
    sheet.save(path)


def _panel(ax: Any, view: View, label: str) -> None:
    ax.set_yscale("symlog", linthresh=2.0, linscale=1.2)
    ax.axhspan(-1.0, 1.0, color="#F1E9C9", linewidth=0.0, zorder=0.5)
    ax.axhline(0.0, color="#222222", linewidth=0.9, zorder=1.6)
    low, high = -3.0, 3.0
    width = widths(view.competitors)
    for name in sorted(view.shown, key=lambda name: name != BASELINE):
        run, look = view.runs[name], view.looks[name]
        if label not in run.trajectory.labels:
            continue
        i = run.trajectory.labels.index(label)
        relative = run.trajectory.phi[:, i] / (run.Ts * run.switching_gain[i])
        t, least, greatest = extremes(run.trajectory.t, relative, BINS)
        if name == BASELINE:
            ax.plot(t, greatest, color=look.colour, linewidth=1.0, zorder=2)
        else:
            ax.fill_between(t, least, greatest, color=look.colour, alpha=0.15, linewidth=0.0, zorder=3)
            ax.plot(t, greatest, color=look.colour, linestyle=look.line, linewidth=width[name], zorder=4)
            high = max(high, float(np.nanmax(greatest, initial=high)))
        low = min(low, float(np.nanmin(least, initial=low)))
    ax.set_ylim(1.3 * max(low, -CLIP), 1.5 * min(high, CLIP))
    decades = [10.0**k for k in range(4)]
    ticks = [0.0, *decades, *(-d for d in decades)]
    bottom, above = ax.get_ylim()
    ticks = [tick for tick in ticks if bottom <= tick <= above]
    ax.set_yticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks])
    ax.set_yticks([], minor=True)
    ax.set_ylabel("φ / (Tₛ u⁺)", labelpad=1)


def _lanes(ax: Any, view: View, height: float) -> None:
    """One thin bar lane per controller in each row's band."""
    ax.set_ylim(height * len(view.lane_rows), 0.0)
    ax.set_yticks([])
    ax.grid(False)
    for i, label in enumerate(view.lane_rows):
        if i % 2 == 0:
            ax.axhspan(i * height, (i + 1) * height, color="#F6F6F6", linewidth=0.0, zorder=0.2)
        for k, name in enumerate(view.competitors):
            run = view.runs[name]
            if label not in run.trajectory.labels:
                continue
            t = run.trajectory.t
            active = run.trajectory.active[:, run.trajectory.labels.index(label)]
            spans = intervals(t, active, max(10.0 * run.Ts, view.end / 200.0))
            bars = [(a, max(b - a, view.end / 500.0)) for a, b in spans]
            ax.broken_barh(
                bars,
                (i * height + 0.5 * ROW_GAP + k * LANE, 0.8 * LANE),
                color=view.looks[name].colour,
                linewidth=0.0,
                zorder=2,
            )


def _two_lines(label: str) -> str:
    """``occlusion[bowl, marker 1]`` with its bracket on a second line, so that it fits beside a panel."""
    head, bracket, rest = label.partition("[")
    return f"{head}\n{bracket}{rest}" if len(label) > 14 else label
