"""Errors of the camera's pose, and of the markers in image tasks, over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons import RunRecord
from ...comparisons.suite import BASELINE
from ...features import ImagePoints
from ...rows import Array
from .decimate import zigzag
from .sheet import WIDTH, Sheet, controller_handles, rows_of, widths
from .view import View

BINS = 300
FLOOR = 1e-2
"""Errors are drawn down to this fraction of their tolerance."""


@dataclass(frozen=True)
class _Quantity:
    label: str
    tolerance: float
    decides: bool
    values: Callable[[RunRecord], Array]


def draw_errors(view: View, path: Path) -> None:
    """One panel for each error, logarithmic, with the tolerance where it decides whether the goal is reached."""
    quantities = [q for q in _quantities(view) if any(np.isfinite(q.values(run)).any() for run in view.runs.values())]
    names = view.shown
    top = 0.08 + 0.17 * rows_of(len(names), 3) + 0.1
    left, gap, height, foot = 0.62, 0.62, 2.0, 0.42
    width = (WIDTH - left - 0.2 - gap * (len(quantities) - 1)) / max(len(quantities), 1)
    sheet = Sheet(top + height + foot)
    sheet.legend(controller_handles(view.looks, names), left, 0.08, 3, columnspacing=1.6)
    for i, quantity in enumerate(quantities):
        ax = sheet.axes(left + i * (width + gap), top, width, height)
        _panel(ax, view, quantity)
    sheet.save(path)


def _quantities(view: View) -> list[_Quantity]:
    image = view.setup is not None and isinstance(view.setup.task.feature, ImagePoints)
    tolerances = view.setup.tolerances if view.setup is not None else None
    pose = [
        _Quantity(
            "position error [mm]",
            1e3 * tolerances.translation_m if tolerances else 1.0,
            tolerances is not None and not image,
            lambda run: 1e3 * run.trajectory.camera_error[:, 0],
        ),
        _Quantity(
            "orientation error [mrad]",
            1e3 * tolerances.rotation_rad if tolerances else 1.0,
            tolerances is not None and not image,
            lambda run: 1e3 * run.trajectory.camera_error[:, 1],
        ),
    ]
    if not image:
        return pose
    feature = tolerances.feature_px if tolerances else 1.0
    return [_Quantity("image error [px]", feature, True, lambda run: run.trajectory.feature_error_px), *pose]


def _panel(ax: Any, view: View, quantity: _Quantity) -> None:
    floor = FLOOR * quantity.tolerance
    top = 10.0 * floor
    ax.set_yscale("log")
    width = widths(view.competitors)
    for name in sorted(view.shown, key=lambda name: name != BASELINE):
        run, look = view.runs[name], view.looks[name]
        t, y = zigzag(run.trajectory.t, quantity.values(run), BINS)
        baseline = name == BASELINE
        ax.plot(
            t,
            np.maximum(y, 1e-3 * floor),
            color=look.colour,
            linestyle=look.line,
            linewidth=1.0 if baseline else width[name],
            zorder=2 if baseline else 3,
        )
        top = max(top, float(np.nanmax(y, initial=top)))
    if quantity.decides:
        ax.axhline(quantity.tolerance, color="#222222", linestyle=":", linewidth=1.0, zorder=1.6)
        ax.annotate(
            "tolerance",
            (0.0, quantity.tolerance),
            xycoords=("axes fraction", "data"),
            xytext=(4, -2),
            textcoords="offset points",
            ha="left",
            va="top",
            fontsize=8,
            color="#222222",
        )
    for time in view.goal_changes:
        ax.axvline(time, color="#222222", linestyle=(0, (4, 3)), linewidth=0.9, zorder=1.5)
    ax.set_xlim(0.0, view.end)
    ax.set_ylim(floor, 2.0 * top)
    low, high = (int(np.floor(np.log10(limit))) for limit in (floor, 2.0 * top))
    decades = [10.0**k for k in range(low + 1, high + 1)]
    ax.set_yticks(decades, [f"{decade:g}" for decade in decades])
    ax.set_yticks([], minor=True)
    ax.set_xlabel("time [s]", labelpad=2)
    ax.set_ylabel(quantity.label, labelpad=2)
