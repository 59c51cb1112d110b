"""The overview figure: utilization against chattering."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from .numbers import mean
from .results import Results
from .style import looks

FILE = "trade-off.png"


@dataclass(frozen=True)
class Overview:
    """The figure's part of the report, and its file's name; empty where there is nothing to draw."""

    text: str = ""
    file: str = ""


def trade_off(results: Results, folder: Path) -> Overview:
    """Draw the figure into ``folder`` and say what it shows."""
    from .figures.trade_off import Point, draw_trade_off

    runs: list[Point] = []
    means: list[Point] = []
    left_out = 0
    for name in results.competitors:
        lines = results.all_runs(name)
        own = [
            Point(name, line["utilization"], line["acceleration_variation"], line["violation_depth"] == 0.0)
            for line in lines
            if math.isfinite(line["utilization"]) and line["acceleration_variation"] > 0.0
        ]
        left_out += len(lines) - len(own)
        runs += own
        if len(own) > 1:
            means.append(
                Point(
                    name,
                    mean([point.utilization for point in own]),
                    mean([point.variation for point in own]),
                    all(point.kept for point in own),
                )
            )
    if not runs:
        return Overview()
    try:
        draw_trade_off(runs, means, looks(results.controllers), folder / FILE)
    except Exception as error:  # a figure must not cost the report
        return Overview(f"The overview figure could not be drawn: {type(error).__name__}: {error}")
    text = (
        f"![Utilization against acceleration variation](figures/{FILE})\n\n"
        "*Each small marker is one run that converged: how much of the allowed space it used where rows held it back, "
        "and how much its command chattered. The lower right corner is best. Large markers are the means. Hollow: a "
        "row was violated in the run, or for a mean in at least one of its runs."
    )
    if left_out:
        text += f" Left out are runs that did not converge, or that no row held back: {left_out}."
    return Overview(text + "*", FILE)
