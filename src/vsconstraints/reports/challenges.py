"""What a scenario challenges, and how much room each controller left there."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .best import Cell, comparable, marked
from .groups import by_controller
from .markdown import code
from .numbers import DASH, error, median, number, over_trials, percent
from .results import Line, Results
from .rows_shown import lane_rows

FINER = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/s": ("mrad/s", 1e3), "m/s": ("mm/s", 1e3)}
"""Units in which margins are printed instead of the stored ones."""


def challenges(results: Results, scenario: str) -> str:
    """A table with one line per challenged row and one column per controller."""
    labels = results.challenged(scenario)
    if not labels:
        if not results.labels(scenario):
            return "This scenario has no constraint rows that could be scored."
        return "Tracking alone violates no row here: nothing is challenged."
    names = results.controllers
    may = comparable(results.statuses(scenario))
    lines = []
    for label in labels:
        rows = {name: results.rows(scenario, name, label) for name in names}
        unit = next((line["unit"] for own in rows.values() for line in own), "")
        shown, factor = FINER.get(unit, (unit, 1.0))
        kept = [
            ok and bool(own) and all(line["violation_depth"] == 0.0 for line in own)
            for ok, own in zip(may, rows.values(), strict=True)
        ]
        cells = [_cell(own, factor) for own in rows.values()]
        lines.append(([code(label), shown], dict(zip(names, marked(cells, kept, "less"), strict=True))))
    return by_controller(results.groups, ["challenged row", "unit"], lines)


def held_rows(results: Results, scenario: str) -> str:
    """A table with one line per row that held the arm back, and one column per controller; empty if none did."""
    labels = lane_rows(results, scenario)
    if not labels:
        return ""
    lines = [
        ([code(label)], {name: _usage(results.rows(scenario, name, label)) for name in results.controllers})
        for label in labels
    ]
    return by_controller(results.groups, ["row that held the arm back"], lines)


def _usage(lines: Sequence[Line]) -> str:
    usage, seconds = [line["usage_held"] for line in lines], median([line["held_time_s"] for line in lines])
    if not math.isfinite(median(usage)):
        return DASH
    return f"{over_trials(usage, percent)} / {number(seconds)} s"


def _cell(lines: Sequence[Line], factor: float) -> Cell:
    if not lines:
        return Cell(DASH)
    # a violation between samples is in the least clearance, too
    clearance = [factor * line["clearance_min"] for line in lines]
    margin = [factor * line["mean_unused_margin"] for line in lines]
    middle = median(margin)
    text = f"{over_trials(clearance, error)} / {over_trials(margin, error)}"
    return Cell(text, middle, error(middle)) if math.isfinite(middle) else Cell(text)
