"""Figures of the report of evidence: profiles, mean ranks, fronts of tuning, and the worst runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...comparisons import RunRecord
from ...comparisons.statistics import Profile, Ranks
from ...simulation import Setup
from ..figures import View
from ..figures.tracks import LAST, VIOLATED, draw_run
from ..plots import FAINT, INK, WIDTH, Figure, Sheet, darker, line, logarithmic, looks, shortened, symbol, widths
from ..plots.image import START, Plane
from ..plots.style import LOOKS

GREY, COLUMNS = "#666666", 3
TRACKING = LOOKS["tracking"].colour

# --- performance profiles ---

MAX_RATIO = 100.0
"""Ratios are drawn up to this one."""

TICKS = (1.05, 1.1, 1.2, 1.5, 2, 3, 5, 10, 20, 50, 100)


class Panel(NamedTuple):
    """One panel: its title, the laws that it shows, and their profile."""

    title: str
    laws: tuple[str, ...]
    profile: Profile


TICK_GAP = 0.12
"""Between ticks at least, as a share of the axis."""


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
            logarithmic(ax.xaxis, _ticks(last))
            ax.set_title(panel.title, loc="left", fontsize=8.5, pad=4)
    sheet.legend([line(shortened(law), look[law].colour, look[law].line) for law in laws])
    return sheet


def _ticks(last: float) -> list[float]:
    """Ticks up to the last ratio that leave room for each other's labels."""
    ticks = [1.0]
    for tick in TICKS:
        if tick <= last and np.log(tick / ticks[-1]) >= TICK_GAP * np.log(last):
            ticks.append(tick)
    return ticks


def _end(panel: Panel) -> float:
    """Where nearly all curves have come to their end."""
    finite = panel.profile.ratios[np.isfinite(panel.profile.ratios)]
    return min(float(np.quantile(finite, 0.99)), MAX_RATIO) if len(finite) else 1.0


PROFILES = Figure(
    "profiles",
    "performance profiles",
    "Performance profiles: in what share of the scenes a law succeeds with at most so many times the least of any law "
    "in that scene. Left, how often it is the best; right, how often it succeeds at all.",
    draw_profiles,
)


# --- mean ranks ---

NAME_LINE, BAR = 0.2, 0.1
"""Height of a name's line, and of a bar [in]."""

MARGIN = 2.0
"""Room for names on either side [in]."""


class Diagram(NamedTuple):
    """One diagram: its title, the laws, and their ranks."""

    title: str
    laws: tuple[str, ...]
    ranks: Ranks


def draw_critical_difference(diagrams: Sequence[Diagram], laws: Sequence[str]) -> Sheet | None:
    """One diagram per condition, as Demšar draws them: best left."""
    shown = [diagram for diagram in diagrams if len(diagram.laws) > 1]
    if not shown:
        return None
    look = looks(laws)
    sheet = Sheet(left=MARGIN, right=MARGIN)
    for diagram in shown:
        _draw(sheet, diagram, {law: look[law].colour for law in diagram.laws})
    return sheet


def _draw(sheet: Sheet, diagram: Diagram, colours: dict[str, str]) -> None:
    count, ranks = len(diagram.laws), diagram.ranks
    bars = BAR * len(ranks.groups) + 0.08
    height = bars + NAME_LINE * (-(-count // 2)) + 0.1
    sheet.text(0.1, sheet.at + 0.1, diagram.title, fontsize=9.0, va="center", color=INK)
    ax = sheet.axes(MARGIN, sheet.at + 0.5, WIDTH - 2.0 * MARGIN, height)
    sheet.at += 0.12
    ax.set_xlim(0.9, count + 0.1)
    ax.set_ylim(height, 0.0)
    ax.xaxis.tick_top()
    ax.set_xticks(range(1, count + 1))
    ax.set_yticks([])
    ax.grid(False)
    for side in ("left", "right", "bottom"):
        ax.spines[side].set_visible(False)
    order = sorted(range(count), key=lambda i: float(ranks.means[i]))
    for i, group in enumerate(ranks.groups):
        ends = [float(ranks.means[k]) for k in group]
        at = 0.08 + BAR * i
        ax.plot([min(ends) - 0.03, max(ends) + 0.03], [at, at], color=INK, linewidth=3.0, solid_capstyle="butt")
    half = -(-count // 2)
    for place, k in enumerate(order):
        left = place < half
        line = place if left else count - 1 - place
        _name(ax, diagram.laws[k], colours[diagram.laws[k]], float(ranks.means[k]), bars + NAME_LINE * line, left)


def _name(ax: Any, law: str, colour: str, rank: float, at: float, left: bool) -> None:
    """A line from a rank down to its law's name beside the diagram."""
    low, high = ax.get_xlim()
    end = low if left else high
    ax.plot([rank, rank, end], [0.0, at, at], color=colour, linewidth=1.3, clip_on=False)
    text = f"{shortened(law)}  {rank:.2f}" if left else f"{rank:.2f}  {shortened(law)}"
    look: dict[str, Any] = {"fontsize": 8.5, "color": INK, "va": "center_baseline", "annotation_clip": False}
    away = (-5, 0) if left else (5, 0)
    ax.annotate(text, (end, at), xytext=away, textcoords="offset points", ha="right" if left else "left", **look)


CRITICAL_DIFFERENCE = Figure(
    "ranks",
    "mean ranks of laws",
    "Mean ranks over all scenes by acceleration variation, scenes without success ranked last together: 1 is a law "
    "that is always the best. Bars join laws that are not distinguishable (Friedman and Nemenyi, 95 %).",
    draw_critical_difference,
)


# --- tuning ---

ROUND_NUMBERS = [factor * 10.0**k for k in range(-6, 7) for factor in (1.0, 2.0, 5.0)]
FRONT_COLUMNS = {"law", "feasible", "on_front", "chosen", "number", "unused", "log_variation"}


def draw_fronts(evaluations: Any, laws: Sequence[str]) -> Sheet | None:
    """All feasible settings small, those on the fronts large, default and chosen ones marked.

    Fronts are of three objectives: seen in two of them, a setting on a front may seem worse than another one.
    """
    if not set(evaluations.columns) >= FRONT_COLUMNS or evaluations.empty:
        return None
    look = looks(laws)
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=3.6, above=0.05)

    def plot(settings: Any, marker: dict[str, Any], zorder: float) -> None:
        ax.plot(100.0 * settings["unused"].clip(lower=1e-6), 10.0 ** settings["log_variation"], **marker, zorder=zorder)

    for law in laws:
        own, (colour, shape) = evaluations[evaluations["law"] == law], (look[law].colour, look[law].marker)
        feasible, front, chosen = (own[own[name].astype(bool)] for name in ("feasible", "on_front", "chosen"))
        plot(feasible, symbol("o", colour, "none", 3.0, alpha=0.35), 2)
        plot(front, symbol(shape, colour, darker(colour), 6.0), 3)
        plot(own[own["number"] == 0].head(1), symbol(shape, "white", colour, 9.0), 4)
        plot(chosen, symbol("*", colour, INK, 10.0), 5)
    for axis in (ax.xaxis, ax.yaxis):
        logarithmic(axis)
        low, high = axis.get_view_interval()
        logarithmic(axis, [tick for tick in ROUND_NUMBERS if low <= tick <= high])
    ax.set_xlabel("← less is better, unused share of the allowed space [%]")
    ax.set_ylabel("← less is better, acceleration variation [rad/s³]")
    entries = [
        symbol(look[law].marker, look[law].colour, darker(look[law].colour), 7.0, label=shortened(law)) for law in laws
    ]
    entries += [
        symbol("o", GREY, "none", 3.0, label="feasible setting"),
        symbol("o", GREY, GREY, 6.0, label="on a law's front"),
        symbol("o", "white", GREY, 9.0, label="default setting"),
        symbol("*", GREY, INK, 10.0, label="chosen setting"),
    ]
    sheet.at += 0.08
    sheet.legend(entries, 4)
    return sheet


FRONTS = Figure(
    "fronts",
    "fronts of tuning",
    "What tuning found on training scenes, in two of its three objectives: what seems worse on a front may be better "
    "in the third, settling time.",
    draw_fronts,
)


# --- worst runs ---

LEFT, GAP, TITLE = 0.45, 0.5, 0.42


@dataclass(frozen=True)
class Shown:
    """A run that is shown.

    Attributes
    ----------
    controller
        Of the law.
    where
        Which scene, for the title.
    setup
        What was simulated.
    run, baseline
        Of the law, and of tracking alone.
    """

    controller: str
    where: str
    setup: Setup
    run: RunRecord
    baseline: RunRecord


def draw_worst(shown: Sequence[Shown], laws: Sequence[str]) -> Sheet | None:
    """One panel per law."""
    shown = [one for one in shown if one.run.trajectory.features_px.size]
    if not shown:
        return None
    width = (WIDTH - LEFT - 0.1 - GAP * (COLUMNS - 1)) / COLUMNS
    planes = [Plane.of(one.setup) for one in shown]
    sheet = Sheet(left=LEFT)
    for row in range(-(-len(shown) // COLUMNS)):
        some = slice(row * COLUMNS, (row + 1) * COLUMNS)
        left, top = LEFT, sheet.at + TITLE
        height = width * max(plane.size[1] / plane.size[0] for plane in planes[some])
        for one, plane in zip(shown[some], planes[some], strict=True):
            ax = sheet.axes(left, top, width, height)
            _panel(ax, one, plane)
            left += width + GAP
        sheet.at = top + height + 0.2
    entries = [
        START | {"label": "start of marker 1, 2, …"},
        LAST | {"label": "goal"},
        line("tracking alone", TRACKING) | {"linewidth": 0.9},
        line("row in the image violated", **VIOLATED),
        *Plane(planes[0].size, tuple(c for plane in planes for c in plane.constraints)).entries(),
    ]
    sheet.at += 0.1
    sheet.legend(entries)
    return sheet


def _panel(ax: Any, one: Shown, plane: Plane) -> None:
    plane.draw(ax, labels=False)
    ax.set_aspect("equal", adjustable="box", anchor="N")
    view = View(one.setup, {"tracking": one.baseline, one.controller: one.run}, ("tracking", one.controller))
    draw_run(ax, view, one.controller)
    ax.set_title(f"{shortened(one.controller)}\n", loc="left", fontsize=9.0, pad=2)
    ax.text(0.0, 1.02, one.where, transform=ax.transAxes, fontsize=8, color=FAINT, va="bottom")
    ax.set_title(f"{one.run.trajectory.status}\n", loc="right", fontsize=8, color=FAINT, pad=2)


WORST = Figure(
    "worst",
    "the worst run of each law",
    "Tracks of the markers in the worst run of each law, made again. Lengths are pixels from the image's centre.",
    draw_worst,
)
