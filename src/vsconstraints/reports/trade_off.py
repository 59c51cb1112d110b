"""The overview figure: utilization against chattering."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from .numbers import mean
from .results import CARRIED_THROUGH, Results
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
        lines = [
            line
            for line in results.all_runs(name)
            if math.isfinite(line["utilization"]) and line["acceleration_variation"] > 0.0
        ]
        through = [line for line in lines if line["status"] in CARRIED_THROUGH]
        left_out += len(lines) - len(through)
        own = [
            Point(name, line["utilization"], line["acceleration_variation"], line["violation_depth"] == 0.0)
            for line in through
        ]
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
        "*Each small marker is one run: how much of the allowed space at the challenged rows it used, and how much its "
        "command chattered. The lower right corner is best. Large markers are the means. Hollow: a row was violated "
        "in the run, or for a mean in at least one of its runs; a violated row counts as fully used."
    )
    if left_out:
        text += (
            f" Left out: {left_out} runs that failed or were aborted."
            if left_out > 1
            else (" Left out: one run that failed or was aborted.")
        )
    return Overview(text + "*", FILE)
