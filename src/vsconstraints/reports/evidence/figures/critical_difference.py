"""Critical-difference diagrams: mean ranks of laws, and bars over those that are not distinguishable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ....comparisons.statistics import Ranks
from ...plots import INK, WIDTH, Figure, Sheet, looks, shortened

LINE, BAR = 0.2, 0.1
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
    height = bars + LINE * (-(-count // 2)) + 0.1
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
        _name(ax, diagram.laws[k], colours[diagram.laws[k]], float(ranks.means[k]), bars + LINE * line, left)


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
