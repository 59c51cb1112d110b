"""What a scenario challenges, and how much room each controller left there."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..comparisons.suite import BASELINE
from .best import Cell, comparable, marked
from .markdown import code, plain, tables
from .numbers import DASH, error, median, number, over_trials, percent
from .results import Line, Results
from .rows_shown import lane_rows

FINER = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/s": ("mrad/s", 1e3), "m/s": ("mm/s", 1e3)}
"""Units in which margins are printed instead of the stored ones."""


def challenges(results: Results, scenario: str) -> str:
    """Tables with one line per controller and one column per challenged row."""
    labels = results.challenged(scenario)
    if not labels:
        if not results.labels(scenario):
            return "This scenario has no constraint rows that could be scored."
        return "Tracking alone violates no row here: nothing is challenged."
    names = results.competitors
    may = comparable(results.statuses(scenario))
    header, columns = [], []
    for label in labels:
        rows = {name: results.rows(scenario, name, label) for name in results.controllers}
        unit = next((line["unit"] for own in rows.values() for line in own), "")
        shown, factor = FINER.get(unit, (plain(unit), 1.0))
        header.append(f"{code(label)} [{shown}]")
        kept = [
            ok and bool(rows[name]) and all(line["violation_depth"] == 0.0 for line in rows[name])
            for ok, name in zip(may, names, strict=True)
        ]
        judged = marked([_cell(rows[name], factor) for name in names], kept, "less")
        # tracking alone has no margin while it is outside
        alone = [_clearance(rows[BASELINE], factor) or DASH] if BASELINE in rows else []
        columns.append([*alone, *judged])
    order = [*([BASELINE] if BASELINE in results.controllers else []), *names]
    lines = [[name, *cells] for name, *cells in zip(order, *columns, strict=True)]
    return tables(["challenged rows", *header], lines)


def held_rows(results: Results, scenario: str) -> str:
    """Tables with one line per controller and one column per row that held the arm back; empty if none did."""
    labels = lane_rows(results, scenario)
    if not labels:
        return ""
    lines = [[name, *(_usage(results.rows(scenario, name, label)) for label in labels)] for name in results.competitors]
    return tables(["rows that held the arm back", *(code(label) for label in labels)], lines)


def shares_to_hold(results: Results, scenario: str) -> str:
    """Tables with one line per controller and one column per row that takes accelerations to hold; empty if none does.

    Nothing is known of scenarios without limits.
    """
    names = results.controllers
    shares = {
        label: [[line["share_to_hold"] for line in results.rows(scenario, name, label)] for name in names]
        for label in results.labels(scenario)
    }
    shares = {label: own for label, own in shares.items() if any(share > 0.0 for of_law in own for share in of_law)}
    if not shares:
        return ""
    lines = [[name, *(over_trials(own[i], percent) for own in shares.values())] for i, name in enumerate(names)]
    return tables(["what holding takes", *(code(label) for label in shares)], lines)


def _usage(lines: Sequence[Line]) -> str:
    usage, seconds = [line["usage_held"] for line in lines], median([line["held_time_s"] for line in lines])
    if not math.isfinite(median(usage)):
        return DASH
    return f"{over_trials(usage, percent)} / {number(seconds)} s"


def _clearance(lines: Sequence[Line], factor: float) -> str:
    """The least clearance; a violation between samples is in it, too."""
    return over_trials([factor * line["clearance_min"] for line in lines], error) if lines else ""


def _cell(lines: Sequence[Line], factor: float) -> Cell:
    """Least clearance, and the mean unused margin, which is judged."""
    if not lines:
        return Cell(DASH)
    margin = [factor * line["mean_unused_margin"] for line in lines]
    middle = median(margin)
    return Cell(over_trials(margin, error), middle, error(middle), f"{_clearance(lines, factor)} / ")
