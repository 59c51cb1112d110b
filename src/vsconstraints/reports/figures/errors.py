"""Errors of the camera's pose, and of the markers in image tasks, over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...comparisons import RunRecord
from ...rows import Array
from ...vision.features import ImagePoints
from ..plots import INK, Sheet, decades, logarithmic, zigzag
from ..plots.marks import note
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


def draw_errors(view: View) -> Sheet:
    """One panel for each error, logarithmic, with the tolerance where it decides whether the goal is reached."""
    quantities = [q for q in _quantities(view) if any(np.isfinite(q.values(run)).any() for run in view.runs.values())]
    sheet = Sheet(left=0.62, right=0.2)
    sheet.legend(view.entries())
    panels = sheet.panels(len(quantities), 3, height=2.0, gap=0.62, above=0.04, labels=("time [s]", ""))
    for ax, quantity in zip(panels, quantities, strict=True):
        _panel(ax, view, quantity)
    return sheet


def _quantities(view: View) -> list[_Quantity]:
    setup = view.setup
    image = setup is not None and isinstance(setup.task.feature, ImagePoints)
    far, turned, apart = (1e-3, 1e-3, 1.0)
    if setup is not None:
        accepted = setup.tolerances
        far, turned, apart = accepted.translation_m, accepted.rotation_rad, accepted.feature_px
    pose = setup is not None and not image
    quantities = [
        _Quantity("position error [mm]", 1e3 * far, pose, lambda run: 1e3 * run.trajectory.camera_error[:, 0]),
        _Quantity("orientation error [mrad]", 1e3 * turned, pose, lambda run: 1e3 * run.trajectory.camera_error[:, 1]),
    ]
    if image:
        quantities.insert(0, _Quantity("image error [px]", apart, True, lambda run: run.trajectory.feature_error_px))
    return quantities


def _panel(ax: Any, view: View, quantity: _Quantity) -> None:
    floor = FLOOR * quantity.tolerance
    top = max(10.0 * floor, *(float(np.nanmax(quantity.values(run), initial=0.0)) for run in view.runs.values()))
    for _, run, look in view.lines():
        t, y = zigzag(run.trajectory.t, quantity.values(run), BINS)
        ax.plot(t, np.maximum(y, 1e-3 * floor), **look)
    if quantity.decides:
        ax.axhline(quantity.tolerance, color=INK, linestyle=":", linewidth=1.0, zorder=1.6)
        note(ax, "tolerance", quantity.tolerance, above=False)
    view.time_axis(ax)
    ax.set_ylim(floor, 2.0 * top)
    logarithmic(ax.yaxis, decades(floor, 2.0 * top))
    ax.set_ylabel(quantity.label, labelpad=2)
