"""Figure of what an arm with mass made of the commands."""

from __future__ import annotations

import numpy as np

from ..reports.figures.signals import joint_panels
from ..reports.figures.view import View
from ..reports.plots import Figure, Sheet
from ..reports.plots.style import FAINT
from .equivalent import Equivalent

LINEAR = 0.01
"""Disturbances up to this size are drawn on linear axes, larger ones on logarithmic axes."""

ABOVE = 0.42
"""Space above the panels [in]."""


def draw_disturbance(view: View) -> Sheet | None:
    """Draw the range of d_c of eq. (6) in short windows, with equal axes.

    Return None without a plant.
    """
    if view.setup is None or view.setup.dynamics is None:
        return None
    equivalents = {name: Equivalent.of(view.runs[name].trajectory) for name in view.shown}
    values = {}
    largest = LINEAR
    for name, fit in equivalents.items():
        values[name] = (fit.t, fit.disturbance)
        sizes = np.nan_to_num(np.abs(fit.disturbance))
        largest = max(largest, float(sizes.max(initial=0.0)))
    label = "d_c [rad/s²]"
    sheet, panels, _ = joint_panels(view, values, label, (LINEAR, 1.3 * largest), ABOVE)
    for ax, (name, fit) in zip(panels, equivalents.items(), strict=True):
        view.title(ax, name, above=12)
        text = f"rms {fit.rms.max():.2g} rad/s², lag {1e3 * fit.time_constant.max():.2g} ms"
        ax.text(0.0, 1.03, text, transform=ax.transAxes, fontsize=8, color=FAINT)
    return sheet


#: Figure of each scenario whose arm has a mass; drawn from a :class:`.View`.
DISTURBANCE = Figure.named("disturbance", draw_disturbance)
