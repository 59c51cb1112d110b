"""Which of several values is the best, and who may be compared at all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from .markdown import bold
from .numbers import Format, median, number, over_trials

Better = Literal["less", "more"]


@dataclass(frozen=True)
class Cell:
    """A table cell that can be the best of its column.

    Attributes
    ----------
    text
        What is printed.
    value
        What it is judged by; NaN where there is nothing to judge.
    shown
        The judged value as printed: cells that show the same digits tie.
    """

    text: str
    value: float = math.nan
    shown: str = ""

    @classmethod
    def of(cls, values: Sequence[float], show: Format = number) -> Cell:
        """A cell of one value per trial, judged by their median."""
        middle = median(values)
        return cls(over_trials(values, show), middle, show(middle))


def marked(cells: Sequence[Cell], eligible: Sequence[bool], better: Better | None) -> list[str]:
    """The cells' texts, the best one bold, and all that tie with it; nothing is bold where nobody is eligible."""
    candidates = [cell for cell, may in zip(cells, eligible, strict=True) if may and math.isfinite(cell.value)]
    if better is None or not candidates:
        return [cell.text for cell in cells]
    best = (min if better == "less" else max)(candidates, key=lambda cell: cell.value)
    return [
        bold(cell.text) if may and math.isfinite(cell.value) and cell.shown == best.shown else cell.text
        for cell, may in zip(cells, eligible, strict=True)
    ]


def comparable(statuses: Sequence[Sequence[str]]) -> list[bool]:
    """Whose values may be the best in a scenario.

    Those that converged in every trial; where nobody did, those that did not fail or abort in any. The others may
    have small values only because they did not do the task. Nobody if there is only one: it has nothing to be better
    than.

    Parameters
    ----------
    statuses
        For each controller that competes, the status of each trial; none if it is not compared.
    """
    converged = [bool(own) and all(status == "converged" for status in own) for own in statuses]
    if sum(bool(own) for own in statuses) < 2:
        return [False] * len(statuses)
    if any(converged):
        return converged
    return [bool(own) and not any(status in ("failed", "aborted") for status in own) for own in statuses]


def keeps_rows(lines: Sequence[dict[str, Any]]) -> bool:
    """Whether no row was violated in any trial."""
    return bool(lines) and all(line["violation_depth"] == 0.0 for line in lines)
