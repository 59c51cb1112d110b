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
    Style,
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
    options = {"above": 0.28, "same_y": True, **options}
    axes = sheet.panels(len(titles), columns, **options)
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title, loc="left", fontsize=8.5, pad=4)
    return axes


def _curves(ax: Any, x: Array, shares: Array, shown: Sequence[str], laws: Sequence[str]) -> None:
    """Draw the shares (laws, N) of the shown laws over x (N,), each in its usual style."""
    style = _line_styles(laws)
    for law, share in zip(shown, shares, strict=True):
        marks = markers(law, laws, len(x))
        ax.plot(x, 100.0 * share, **style[law], **marks)
    ax.set(xlim=(x[0], x[-1]), ylim=(0.0, 102.0))


def _line_styles(laws: Sequence[str]) -> dict[str, Style]:
    """Return colour, dashes and width of the curve of each law."""
    width = widths(laws, 2.4, 1.2)
    styles = {}
    for law, look in looks(laws).items():
        styles[law] = {"color": look.colour, "linestyle": look.line, "linewidth": width[law]}
    return styles


def _legend(sheet: Sheet, laws: Sequence[str]) -> None:
    entries = []
    for law, look in looks(laws).items():
        mark = mark_of(look)
        entries.append(line(shortened(law), look.colour, look.line, **mark))
    sheet.legend(entries)


def draw_tolerance(panels: Sequence[Depths], laws: Sequence[str]) -> Sheet | None:
    """Draw success over tolerated depth, one panel per condition."""
    if not panels:
        return None
    sheet = Sheet(left=0.62, right=0.2)
    depth = np.geomspace(NEGLIGIBLE, DEEPEST, 400)
    titles = [title for title, _ in panels]
    axes = _panels(
        sheet,
        titles,
        height=2.0,
        gap=0.4,
        labels=("tolerated depth [% of L]", "success [% of scenes]"),
    )
    for ax, (_, least) in zip(axes, panels, strict=True):
        # (scenes, depths, laws)
        is_success = least.to_numpy()[:, None] <= depth[:, None]
        success = is_success.mean(axis=0)
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
        last = _last_ratio([profile for _, _, profile in panels])
        titles = [title for title, _, _ in panels]
        axes = _panels(sheet, titles, height=1.75, gap=0.2, labels=labels)
        tau = np.geomspace(1.0, last, 400)
        for ax, (_, shown, profile) in zip(axes, panels, strict=True):
            shares = profile.share(tau)
            _curves(ax, tau, shares.T, shown, laws)
            logarithmic(ax.xaxis, _ratio_ticks(last))
    _legend(sheet, laws)
    return sheet


def _ratio_ticks(last: float) -> list[float]:
    """Return the ticks of ratios from 1 to the last one that are not too close to each other."""
    ticks = [1.0]
    least_gap = TICK_GAP * np.log(last)
    for tick in TICKS:
        gap = np.log(tick / ticks[-1])
        if tick <= last and gap >= least_gap:
            ticks.append(tick)
    return ticks


def _last_ratio(profiles: Sequence[Profile]) -> float:
    """Return the ratio at which nearly all curves have reached their end."""
    last = 1.1
    for profile in profiles:
        finite = profile.ratios[np.isfinite(profile.ratios)]
        if len(finite):
            end = float(np.quantile(finite, 0.99))
            last = max(last, min(end, MAX_RATIO))
    return last


def draw_levels(
    factorial: Factorial, rankings: Mapping[str, Ranking], laws: Sequence[str]
) -> Sheet | None:
    """Draw success over the levels of the first factor, by combination of the other factors.

    ``rankings`` are keyed by condition.
    """
    first, *others = factorial.factors
    panels = _combinations(others)
    titles = []
    for panel in panels:
        changed = [level for level in panel if level != NOMINAL]
        titles.append(", ".join(changed) or NOMINAL)
    sheet = Sheet(left=0.62, right=0.2)
    look = looks(laws)
    labels = ("", "success [% of scenes]")
    columns = len(others[0]) if others else 1
    axes = _panels(sheet, titles, columns, height=1.9, gap=0.2, above=0.3, labels=labels)
    # Marks of laws at one level are beside each other, around the tick of the level.
    step = min(DODGE, SPREAD / max(len(laws) - 1, 1))
    first_offset = -0.5 * step * (len(laws) - 1)
    for ax, panel in zip(axes, panels, strict=True):
        for i, (law, law_look) in enumerate(look.items()):
            places = []
            shares = []
            for tick, level in enumerate(first):
                condition = factorial.conditions.get((level, *panel), "")
                if condition in rankings and law in rankings[condition].shares:
                    places.append(tick + first_offset + i * step)
                    shares.append(rankings[condition].shares[law])
            per_cent = 100.0 * np.reshape(shares, (-1, 3))
            middle, low, high = per_cent.T
            error = np.maximum([middle - low, high - middle], 0.0)
            ax.errorbar(
                places,
                middle,
                error,
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


def _combinations(factors: Sequence[Sequence[str]]) -> list[tuple[str, ...]]:
    """Return all combinations of levels; the level of the first factor changes first.

    It varies along a row of panels. Without factors, there is one empty combination.
    """
    return [tuple(reversed(levels)) for levels in product(*reversed(factors))]


def draw_critical_difference(diagrams: Sequence[Diagram], laws: Sequence[str]) -> Sheet | None:
    """Draw one critical-difference diagram per condition, as by Demšar: best on the left."""
    shown = [diagram for diagram in diagrams if len(diagram[1]) > 1]
    if not shown:
        return None
    look = looks(laws)
    names: list[str] = []
    for _, ranked_laws, _ in shown:
        names += ranked_laws
    margin = _room_for_names(names)
    sheet = Sheet(left=margin, right=margin)
    for title, ranked_laws, ranks in shown:
        count = len(ranked_laws)
        lines_of_names = math.ceil(count / 2)
        bars = BAR * len(ranks.groups) + 0.08
        height = bars + NAME_LINE * lines_of_names + 0.1
        sheet.text(0.1, sheet.bottom + 0.1, title, fontsize=9.0, va="center", color=INK)
        ax = sheet.axes(margin, sheet.bottom + 0.5, WIDTH - 2.0 * margin, height)
        sheet.bottom += 0.12
        ax.set(
            xlim=(0.9, count + 0.1),
            ylim=(height, 0.0),
            xticks=range(1, count + 1, math.ceil(count / 15)),
            yticks=[],
        )
        ax.xaxis.tick_top()
        ax.grid(False)
        ax.spines[["left", "right", "bottom"]].set_visible(False)
        _draw_groups(ax, ranks)
        order = np.argsort(ranks.means, kind="stable")
        for place, k in enumerate(order):
            law = ranked_laws[k]
            on_left = place < lines_of_names
            line_of_name = place if on_left else count - 1 - place
            y = bars + NAME_LINE * line_of_name
            _name_rank(ax, law, ranks.means[k], y, look[law].colour, on_left)
    return sheet


def _draw_groups(ax: Any, ranks: Ranks) -> None:
    """Draw a thick bar over the ranks of each group of laws without significant differences."""
    for i, group in enumerate(ranks.groups):
        y = 0.08 + BAR * i
        means = ranks.means[list(group)]
        left = means.min() - 0.03
        right = means.max() + 0.03
        ax.plot([left, right], [y, y], color=INK, linewidth=3.0, solid_capstyle="butt")


def _name_rank(ax: Any, law: str, rank: float, y: float, colour: str, on_left: bool) -> None:
    """Draw a line from a rank down to a law's name beside the diagram, at height ``y``."""
    left_end, right_end = ax.get_xlim()
    name = shortened(law)
    if on_left:
        end = left_end
        text = f"{name}  {rank:.2f}"
        offset = -5
        alignment = "right"
    else:
        end = right_end
        text = f"{rank:.2f}  {name}"
        offset = 5
        alignment = "left"
    across = [rank, rank, end]
    down = [0.0, y, y]
    ax.plot(across, down, color=colour, linewidth=1.3, clip_on=False)
    ax.annotate(
        text,
        (end, y),
        (offset, 0),
        textcoords="offset points",
        ha=alignment,
        va="center_baseline",
        fontsize=NAME_SIZE,
        color=INK,
        annotation_clip=False,
    )


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
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=3.2, above=0.05)
    success = 100.0 * evaluations["successes"] / evaluations["runs"]
    evaluations = evaluations.assign(success=success)
    for law, style in _line_styles(laws).items():
        tried = evaluations[evaluations["law"] == law]
        by_seed = tried.pivot_table(index="number", columns="seed", values="success")
        best = by_seed.cummax()
        count = best.index + 1
        marks = markers(law, laws, len(count))
        ax.plot(count, best.median(axis=1), **style, **marks)
        ax.fill_between(
            count,
            best.min(axis=1),
            best.max(axis=1),
            color=style["color"],
            alpha=0.12,
            linewidth=0,
        )
    ax.set_xlabel("evaluations of each law, the default first")
    ax.set_ylabel("success on training scenes [%]")
    _legend(sheet, laws)
    return sheet


TOLERANCE = Figure.named("tolerance", draw_tolerance)
PROFILES = Figure.named("profiles", draw_profiles)
LEVELS = Figure.named("levels", draw_levels)
CRITICAL_DIFFERENCE = Figure.named("ranks", draw_critical_difference)
BUDGETS = Figure.named("budgets", draw_budgets)
