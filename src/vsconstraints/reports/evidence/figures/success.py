"""How often each law succeeds in each condition, with intervals: the figure of the first screen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...plots import Figure, Sheet, darker, line, looks, shortened
from ...plots.image import symbol
from ..standing import Standing
from ..words import of_scenes, where

LINE = 0.25
"""Height of a law's line [in]."""

LETTER = 0.068
"""Width of a letter of the smallest type, at most [in]."""


def draw_success(standings: Sequence[Standing], laws: Sequence[str]) -> Sheet | None:
    """One panel per condition, one line per law, those that succeed most often in the first condition on top."""
    if not standings:
        return None
    first = standings[0].laws
    order = [*first, *(law for law in laws if law not in first and any(law in one.laws for one in standings))]
    look = looks(laws)
    names = [shortened(law) for law in order]
    sheet = Sheet(left=LETTER * max(len(name) for name in names) + 0.2, right=0.25)
    columns = min(len(standings), 3)
    options: dict[str, Any] = {"gap": 0.22, "above": 0.42, "same_y": True, "labels": ("success [%]", "")}
    panels = sheet.panels(len(standings), columns, height=LINE * len(order) + 0.1, **options)
    for ax, one in zip(panels, standings, strict=True):
        for i, law in enumerate(order):
            if law in one.laws:
                share, colour = one.shares[law], look[law].colour
                low, high = 100.0 * share.low, 100.0 * share.high
                ax.plot([low, high], [i, i], color=colour, linewidth=1.6, solid_capstyle="butt", zorder=3)
                face = colour if law in one.front else "white"
                mark = symbol(look[law].marker, face, darker(colour), 5.5)
                ax.plot([100.0 * share.value], [i], **mark, clip_on=False, zorder=4)
        ax.set_yticks(range(len(order)), names)
        ax.set_ylim(len(order) - 0.5, -0.5)
        ax.set_xlim(0.0, 100.0)
        ax.set_title(f"{where(one.condition)}\n{of_scenes(one.scenes, one.families)}", loc="left", fontsize=8.5, pad=4)
    grey = "#666666"
    filled = symbol("o", grey, grey, 5.5, label="not distinguishable from the best")
    hollow = symbol("o", "white", grey, 5.5, label="distinguishable from it")
    sheet.legend([filled, hollow, line("95 % interval", grey) | {"linewidth": 1.6}], 3, (0.6, sheet.at))
    sheet.at += 0.22
    return sheet


SUCCESS = Figure(
    "success",
    "how often each law succeeds",
    "How often each law keeps all rows and reaches the goal, with exact 95 % intervals.",
    draw_success,
)
