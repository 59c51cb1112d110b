"""Performance profiles: in what share of the scenes a law is how near to the best one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ....comparisons.statistics import Profile
from ...plots import Figure, Sheet, line, logarithmic, looks, shortened
from ...plots.marks import widths

MOST_RATIO = 100.0
"""Ratios are drawn up to this one."""

TICKS = (1.05, 1.1, 1.2, 1.5, 2, 3, 5, 10, 20, 50, 100)


class Panel(NamedTuple):
    """One panel: its title, the laws that it shows, and their profile."""

    title: str
    laws: tuple[str, ...]
    profile: Profile


APART = 0.12
"""What ticks are apart at least, as a share of the axis."""

COLUMNS = 3


def draw_profiles(metrics: Sequence[Sequence[Panel]], laws: Sequence[str]) -> Sheet | None:
    """One panel per condition, metrics below each other, each with a horizontal axis of its own."""
    if not any(metrics):
        return None
    look, width = looks(laws), widths(laws, 2.4, 1.2)
    sheet = Sheet(left=0.62, right=0.2)
    options: dict[str, Any] = {"height": 1.75, "gap": 0.2, "above": 0.28, "same_y": True}
    labels = ("times the least of the scene", "share of scenes [%]")
    for panels in metrics:
        last = max([1.1, *(_end(panel) for panel in panels)])
        tau = np.geomspace(1.0, last, 400)
        for ax, panel in zip(sheet.panels(len(panels), COLUMNS, labels=labels, **options), panels, strict=True):
            shares = 100.0 * panel.profile.share(tau)
            for k, law in enumerate(panel.laws):
                ax.plot(tau, shares[:, k], color=look[law].colour, linestyle=look[law].line, linewidth=width[law])
            ax.set_xlim(1.0, last)
            ax.set_ylim(0.0, 102.0)
            logarithmic(ax.xaxis, _apart(last))
            ax.set_title(panel.title, loc="left", fontsize=8.5, pad=4)
    sheet.legend([line(shortened(law), look[law].colour, look[law].line) for law in laws])
    return sheet


def _apart(last: float) -> list[float]:
    """Ticks up to the last ratio that leave room for each other's labels."""
    found = [1.0]
    for tick in TICKS:
        if tick <= last and np.log(tick / found[-1]) >= APART * np.log(last):
            found.append(tick)
    return found


def _end(panel: Panel) -> float:
    """Where nearly all curves have come to their end."""
    finite = panel.profile.ratios[np.isfinite(panel.profile.ratios)]
    return min(float(np.quantile(finite, 0.99)), MOST_RATIO) if len(finite) else 1.0


PROFILES = Figure(
    "profiles",
    "performance profiles",
    "Performance profiles: in what share of the scenes a law succeeds with at most so many times the least of any law "
    "in that scene. Left, how often it is the best; right, how often it succeeds at all.",
    draw_profiles,
)
