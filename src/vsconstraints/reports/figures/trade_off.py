"""How much of the allowed space is used, against how much the command chatters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from ..style import Look, darker, shortened
from .sheet import STYLE, WIDTH, Sheet, style

LEAST_UNUSED = 1e-4
"""Share of the allowed space left unused below which points are drawn at the edge."""


@dataclass(frozen=True)
class Point:
    """One run, or the mean of a controller's runs.

    Attributes
    ----------
    controller
        Whose.
    utilization, variation
        Where: share of the allowed space, and acceleration variation.
    kept
        Whether no row was violated.
    """

    controller: str
    utilization: float
    variation: float
    kept: bool


def draw_trade_off(runs: Sequence[Point], means: Sequence[Point], looks: dict[str, Look], path: Path) -> None:
    """A small marker for each run and a large, labelled one for each controller's mean."""
    with style(STYLE):
        height, foot, top, left, right = 3.6, 0.45, 0.1, 0.72, 2.25
        sheet = Sheet(top + height + foot)
        ax = sheet.axes(left, top, WIDTH - left - right, height)
        for point in runs:
            _mark(ax, point, looks[point.controller], size=5.0, alpha=0.75, order=3)
        for point in means:
            _mark(ax, point, looks[point.controller], size=12.0, alpha=0.9, order=2.5)
        _axes(ax, runs)
        sheet.legend(_legend(runs, looks), WIDTH - right + 0.15, top + 0.05, 1, labelspacing=0.85)
        sheet.save(path)


def _mark(ax: Any, point: Point, look: Look, size: float, alpha: float, order: float) -> None:
    ax.plot(
        _unused(point.utilization),
        point.variation,
        linestyle="none",
        marker=look.marker,
        markersize=size,
        markerfacecolor=look.colour if point.kept else "white",
        markeredgecolor=darker(look.colour) if point.kept else look.colour,
        markeredgewidth=0.7 if point.kept else 1.5,
        alpha=alpha,
        zorder=order,
        clip_on=False,
    )


def _unused(utilization: float) -> float:
    return max(1.0 - utilization, LEAST_UNUSED)


def _axes(ax: Any, runs: Sequence[Point]) -> None:
    ax.set_xscale("log")
    ax.set_yscale("log")
    unused = [_unused(point.utilization) for point in runs]
    # the right end is full use of the allowed space
    ax.set_xlim(1.4 * max([*unused, 0.1]), LEAST_UNUSED)
    shares = [0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 0.9999]
    shares = [share for share in shares if 1.0 - share <= ax.get_xlim()[0]]
    ax.set_xticks([1.0 - s for s in shares], [_share(s) for s in shares])
    ax.set_xticks([], minor=True)
    low, high = (int(np.floor(np.log10(limit))) for limit in ax.get_ylim())
    decades = [10.0**k for k in range(low + 1, high + 1)]
    ax.set_yticks(decades, [f"{decade:g}" for decade in decades])
    ax.set_yticks([], minor=True)
    ax.set_xlabel("utilization where rows hold the arm back [%], more is better → (logarithm of what is left)")
    ax.set_ylabel("← less is better, acceleration variation [rad/s³]")


def _share(share: float) -> str:
    return "≥ 99.99" if share == 0.9999 else f"{100.0 * share:g}"


def _legend(runs: Sequence[Point], looks: dict[str, Look]) -> list[Any]:
    present = list(dict.fromkeys(point.controller for point in runs))
    handles = [
        Line2D(
            [],
            [],
            linestyle="none",
            marker=looks[name].marker,
            color=looks[name].colour,
            markersize=8,
            label=shortened(name),
        )
        for name in present
    ]
    grey: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": "#666666"}
    return [
        *handles,
        Line2D([], [], **grey, markersize=12, label="mean of a controller's runs"),
        Line2D([], [], **grey, markersize=5, label="one run"),
        Line2D(
            [],
            [],
            **grey,
            markersize=7,
            markerfacecolor="white",
            markeredgewidth=1.5,
            label="hollow: a row was violated",
        ),
    ]
