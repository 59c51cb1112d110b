"""What tuning found: the settings of each law that no other one of it is better than."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...plots import WIDTH, Figure, Sheet, darker, looks, shortened
from ...plots.image import symbol

X, Y = ("unused", "unused space"), ("log_variation", "log₁₀ of acceleration variation")
"""Columns of the objectives that are shown, and what they are called; less of either is better."""

RIGHT, HEIGHT = 2.3, 3.4


def draw_fronts(evaluations: Any, laws: Sequence[str]) -> Sheet | None:
    """All feasible settings small, those on the fronts large, default and chosen ones marked.

    Fronts are of three objectives: seen in two of them, a setting on a front may seem worse than another one.
    """
    if not {X[0], Y[0]} <= set(evaluations.columns) or evaluations.empty:
        return None
    look = looks(laws)
    sheet = Sheet(left=0.62, right=RIGHT)
    (ax,) = sheet.panels(1, height=HEIGHT, above=0.05)
    for law in laws:
        own = evaluations[evaluations["law"] == law]
        colour = look[law].colour
        feasible, front, chosen = (own[own[name].astype(bool)] for name in ("feasible", "on_front", "chosen"))
        ax.plot(feasible[X[0]], feasible[Y[0]], **symbol("o", colour, "none", 2.6), alpha=0.3, zorder=2)
        ax.plot(front[X[0]], front[Y[0]], **symbol(look[law].marker, colour, darker(colour), 5.5), zorder=3)
        default = own[own["number"] == 0].head(1)
        ax.plot(default[X[0]], default[Y[0]], **symbol(look[law].marker, "white", colour, 8.5), zorder=4)
        ax.plot(chosen[X[0]], chosen[Y[0]], **symbol("*", colour, "black", 9.0), zorder=5)
    ax.set_xlabel(f"{X[1]}, less is better")
    ax.set_ylabel(f"{Y[1]}, less is better")
    grey = "#666666"
    entries = [symbol(look[law].marker, look[law].colour, look[law].colour, 6.5, label=shortened(law)) for law in laws]
    entries += [
        symbol("o", grey, "none", 2.6, label="feasible setting"),
        symbol("o", grey, grey, 5.5, label="on a law's front"),
        symbol("o", "white", grey, 8.5, label="as the law comes"),
        symbol("*", grey, "black", 9.0, label="taken over"),
    ]
    sheet.legend(entries, 1, (WIDTH - RIGHT + 0.15, 0.15), labelspacing=0.8)
    return sheet


FRONTS = Figure(
    "fronts",
    "fronts of tuning",
    "What tuning found on training scenes, in two of its three objectives: what seems worse on a front may be better "
    "in the third, settling time.",
    draw_fronts,
)
