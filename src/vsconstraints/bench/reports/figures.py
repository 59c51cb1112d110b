"""Figures of the report of evidence: success over tolerated depth, profiles, ranks, budgets."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from ...comparisons.metrics import NEGLIGIBLE, TOLERANT
from ...reports.plots import (
    INK,
    REFERENCE,
    WIDTH,
    Figure,
    Sheet,
    line,
    logarithmic,
    looks,
    mark_of,
    markers,
    shortened,
    widths,
)
from ...rows import Array
from ..families.family import NOMINAL
from ..statistics import Profile, Ranks
from .dataset import Factorial
from .ranking import Ranking

COLUMNS = 3
DEEPEST = 0.1  #: Greatest tolerated depth in its figure [L].
#: Greatest ratio drawn in profiles; least gap between ticks, as a share of the axis.
MAX_RATIO = 100.0
TICK_GAP = 0.12
TICKS = (1.05, 1.1, 1.2, 1.5, 2, 3, 5, 10, 20, 50, 100)
#: Gap between marks of two laws at one level, and largest width of all, relative to a level.
DODGE = 0.05
SPREAD = 0.6
#: Height of a name's line and of a bar in a rank diagram [in], and size of its names [pt].
NAME_LINE = 0.2
BAR = 0.1
NAME_SIZE = 8.5
POINTS_PER_INCH = 72.0
#: Title of a panel; and the least tolerated depth by scene, one column per law.
Depths = tuple[str, Any]
#: Title, shown laws and their profile.
Panel = tuple[str, tuple[str, ...], Profile]
Diagram = tuple[str, tuple[str, ...], Ranks]  #: Title, laws and their ranks.


def _panels(
    sheet: Sheet, titles: Sequence[str], columns: int = COLUMNS, **options: Any
) -> list[Any]:
    """Add panels with a common vertical axis and a title each."""
    made = sheet.panels(len(titles), columns, **{"above": 0.28, "same_y": True, **options})
    for ax, title in zip(made, titles, strict=True):
        ax.set_title(title, loc="left", fontsize=8.5, pad=4)
    return made


def _curves(ax: Any, x: Array, shares: Array, shown: Sequence[str], laws: Sequence[str]) -> None:
    """Draw the shares (laws, N) of the shown laws over x (N,), each in its usual style."""
    look = looks(laws)
    width = widths(laws, 2.4, 1.2)
    for law, share in zip(shown, shares, strict=True):
        style = {"color": look[law].colour, "linestyle": look[law].line, "linewidth": width[law]}
        ax.plot(x, 100.0 * share, **style, **markers(law, laws, len(x)))
    ax.set(xlim=(x[0], x[-1]), ylim=(0.0, 102.0))


def _legend(sheet: Sheet, laws: Sequence[str]) -> None:
    entries = []
    for law, look in looks(laws).items():
        entries.append(line(shortened(law), look.colour, look.line, **mark_of(look)))
    sheet.legend(entries)


def draw_tolerance(panels: Sequence[Depths], laws: Sequence[str]) -> Sheet | None:
    """Draw success over tolerated depth, one panel per condition."""
    if not panels:
        return None
    sheet = Sheet(left=0.62, right=0.2)
    depth = np.geomspace(NEGLIGIBLE, DEEPEST, 400)
    labels = "tolerated depth [% of L]", "success [% of scenes]"
    every = _panels(sheet, [title for title, _ in panels], height=2.0, gap=0.4, labels=labels)
    for ax, (_, least) in zip(every, panels, strict=True):
        success = (least.to_numpy()[:, None] <= depth[:, None]).mean(axis=0)
        _curves(ax, 100.0 * depth, success.T, least.columns, laws)
        ax.axvline(100.0 * TOLERANT, **REFERENCE | {"linewidth": 0.8})
        logarithmic(ax.xaxis, [0.01, 0.1, 1.0, 10.0])
    _legend(sheet, laws)
    return sheet


def draw_profiles(metrics: Sequence[Sequence[Panel]], laws: Sequence[str]) -> Sheet | None:
    """Draw performance profiles, one panel per condition and one line of panels per metric.

    Each metric has a separate horizontal axis.
    """
    if not any(metrics):
        return None
    sheet = Sheet(left=0.62, right=0.2)
    labels = ("times the least of the scene", "share of scenes [%]")
    for panels in metrics:
        # Where nearly all curves have reached their end.
        last = 1.1
        for _, _, profile in panels:
            finite = profile.ratios[np.isfinite(profile.ratios)]
            if len(finite):
                last = max(last, min(float(np.quantile(finite, 0.99)), MAX_RATIO))
        tau = np.geomspace(1.0, last, 400)
        ticks = [1.0]
        for tick in TICKS:
            if tick <= last and np.log(tick / ticks[-1]) >= TICK_GAP * np.log(last):
                ticks.append(tick)
        every = _panels(
            sheet, [title for title, _, _ in panels], height=1.75, gap=0.2, labels=labels
        )
        for ax, (_, shown, profile) in zip(every, panels, strict=True):
            _curves(ax, tau, profile.share(tau).T, shown, laws)
            logarithmic(ax.xaxis, ticks)
    _legend(sheet, laws)
    return sheet


def draw_levels(
    factorial: Factorial, rankings: Mapping[str, Ranking], laws: Sequence[str]
) -> Sheet | None:
    """Draw success over the levels of the first factor, by combination of the other factors.

    ``rankings`` are keyed by condition.
    """
    first, *others = factorial.factors
    # The second factor varies along a row of panels.
    panels: list[tuple[str, ...]] = []
    titles = []
    for *rest, column in product(*others[1:], _columns(others)):
        panel = (*column, *map(str, rest))
        panels.append(panel)
        changed = [level for level in panel if level != NOMINAL]
        titles.append(", ".join(changed) or NOMINAL)
    sheet = Sheet(left=0.62, right=0.2)
    look = looks(laws)
    labels = ("", "success [% of scenes]")
    step = min(DODGE, SPREAD / max(len(laws) - 1, 1))
    count = len(_columns(others))
    axes = _panels(sheet, titles, count, height=1.9, gap=0.2, above=0.3, labels=labels)
    for ax, panel in zip(axes, panels, strict=True):
        for i, (law, law_look) in enumerate(look.items()):
            places = []
            shares = []
            for k, level in enumerate(first):
                condition = factorial.conditions.get((level, *panel), "")
                if condition in rankings and law in rankings[condition].shares:
                    places.append(k + step * (i - 0.5 * (len(laws) - 1)))
                    shares.append(rankings[condition].shares[law])
            middle, low, high = 100.0 * np.reshape(shares, (-1, 3)).T
            ax.errorbar(
                places,
                middle,
                np.maximum([middle - low, high - middle], 0.0),
                color=law_look.colour,
                linestyle=law_look.line,
                marker=law_look.marker,
                markersize=3.0,
                linewidth=1.2,
                elinewidth=0.7,
            )
        ax.set(
            xlim=(-0.5, len(first) - 0.5),
            ylim=(-3.0, 103.0),
            xticks=range(len(first)),
            xticklabels=first,
        )
    small = {"markersize": 4.0, "linewidth": 1.2}
    entries = []
    for law, law_look in look.items():
        entry = line(shortened(law), law_look.colour, law_look.line, marker=law_look.marker)
        entries.append(entry | small)
    sheet.legend(entries)
    return sheet


def _columns(factors: Sequence[Sequence[str]]) -> list[tuple[str, ...]]:
    """Return the levels of the first of these factors, one empty combination without factors."""
    return [(level,) for level in factors[0]] if factors else [()]


def draw_critical_difference(diagrams: Sequence[Diagram], laws: Sequence[str]) -> Sheet | None:
    """Draw one critical-difference diagram per condition, as by Demšar: best on the left."""
    look = looks(laws)
    shown = [diagram for diagram in diagrams if len(diagram[1]) > 1]
    margin = _room_for_names([law for _, ranked_laws, _ in shown for law in ranked_laws])
    sheet = Sheet(left=margin, right=margin)
    for title, ranked_laws, ranks in shown:
        count = len(ranked_laws)
        half = math.ceil(count / 2)
        bars = BAR * len(ranks.groups) + 0.08
        height = bars + NAME_LINE * half + 0.1
        sheet.text(0.1, sheet.bottom + 0.1, title, fontsize=9.0, va="center", color=INK)
        ax = sheet.axes(margin, sheet.bottom + 0.5, WIDTH - 2.0 * margin, height)
        sheet.bottom += 0.12
        ax.set(
            xlim=(0.9, count + 0.1),
            ylim=(height, 0.0),
            xticks=range(1, count + 1, -(-count // 15)),
            yticks=[],
        )
        ax.xaxis.tick_top()
        ax.grid(False)
        ax.spines[["left", "right", "bottom"]].set_visible(False)
        for i, group in enumerate(ranks.groups):
            ends = [float(ranks.means[k]) for k in group]
            y = 0.08 + BAR * i
            bar = [min(ends) - 0.03, max(ends) + 0.03]
            ax.plot(bar, [y, y], color=INK, linewidth=3.0, solid_capstyle="butt")
        order = np.argsort(ranks.means, kind="stable")
        for place, k in enumerate(order):
            # A line from the rank down to the law's name beside the diagram.
            law = ranked_laws[k]
            rank = float(ranks.means[k])
            left = place < half
            y = bars + NAME_LINE * (place if left else count - 1 - place)
            end = ax.get_xlim()[not left]
            colour = look[law].colour
            ax.plot([rank, rank, end], [0.0, y, y], color=colour, linewidth=1.3, clip_on=False)
            name = shortened(law)
            ax.annotate(
                f"{name}  {rank:.2f}" if left else f"{rank:.2f}  {name}",
                (end, y),
                (-5 if left else 5, 0),
                textcoords="offset points",
                ha="right" if left else "left",
                va="center_baseline",
                fontsize=NAME_SIZE,
                color=INK,
                annotation_clip=False,
            )
    return sheet if shown else None


def _room_for_names(laws: Iterable[str]) -> float:
    """Return the width of the longest name with its mean rank, and of the space around it [in]."""
    from matplotlib.textpath import TextPath

    widest = 0.0
    for law in laws:
        text = TextPath((0.0, 0.0), f"{shortened(law)}  00.00", size=NAME_SIZE)
        widest = max(widest, text.get_extents().width)
    return widest / POINTS_PER_INCH + 0.2


def draw_budgets(evaluations: Any, laws: Sequence[str]) -> Sheet | None:
    """Draw a curve per law over evaluations, the median over tuner seeds.

    A band from the least to the greatest value is drawn where they differ.
    """
    width = widths(laws, 2.4, 1.2)
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=3.2, above=0.05)
    for law, look in looks(laws).items():
        tried = evaluations[evaluations["law"] == law].sort_values("number")
        tried = tried.assign(share=100.0 * tried["successes"] / tried["runs"])
        best = tried.pivot_table(index="number", columns="seed", values="share").cummax()
        number = best.index + 1
        style = {"color": look.colour, "linestyle": look.line, "linewidth": width[law]}
        ax.plot(number, best.median(axis=1), **style, **markers(law, laws, len(number)))
        ax.fill_between(
            number, best.min(axis=1), best.max(axis=1), color=look.colour, alpha=0.12, linewidth=0
        )
    ax.set(
        xlabel="evaluations of each law, the default first", ylabel="success on training scenes [%]"
    )
    _legend(sheet, laws)
    return sheet


TOLERANCE = Figure.named("tolerance", draw_tolerance)
PROFILES = Figure.named("profiles", draw_profiles)
LEVELS = Figure.named("levels", draw_levels)
CRITICAL_DIFFERENCE = Figure.named("ranks", draw_critical_difference)
BUDGETS = Figure.named("budgets", draw_budgets)
