"""Which of several values is the best, and who may be compared at all."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ..comparisons.metrics import Metric
from .markdown import bold
from .numbers import Format, median, number, over_trials

Better = Literal["less", "more"]


@dataclass(frozen=True)
class Cell:
    """A table cell that can be the best of its column.

    Attributes
    ----------
    text
        What is printed, and bold where it is the best.
    value
        What it is judged by; NaN where there is nothing to judge.
    shown
        The judged value as printed: cells that show the same digits tie.
    before
        What is printed before that, and is not judged.
    """

    text: str
    value: float = math.nan
    shown: str = ""
    before: str = ""

    @classmethod
    def of(cls, values: Sequence[float], show: Format = number) -> Cell:
        """A cell of one value per trial, judged by their median."""
        middle = median(values)
        return cls(over_trials(values, show), middle, show(middle))


def marked(cells: Sequence[Cell], eligible: Sequence[bool], better: Better | None) -> list[str]:
    """The cells' texts: the best one bold and all that tie with it, those that are not compared in parentheses.

    None is bold where another one of the column is better, compared or not, nor where all are alike: what nobody
    challenges is no merit. A cell that is alone is neither: there is nothing that it could be compared with.
    """
    there = [cell for cell in cells if math.isfinite(cell.value)]
    best = ""
    if better is not None and len({cell.shown for cell in there}) > 1:
        best = (min if better == "less" else max)(there, key=lambda cell: cell.value).shown
    texts = []
    for cell, may in zip(cells, eligible, strict=True):
        text = f"{cell.before}{bold(cell.text) if may and cell.shown == best else cell.text}"
        aside = better is not None and len(cells) > 1 and not may and math.isfinite(cell.value)
        texts.append(f"({text})" if aside else text)
    return texts


def comparable(statuses: Sequence[Sequence[str]]) -> list[bool]:
    """Whose values may be compared in a scenario: those that converged in every trial.

    The others may have small values only because they did not do the task, or nothing at all. Nobody if there is only
    one: it has nothing to be better than.

    Parameters
    ----------
    statuses
        For each controller that competes, the status of each trial; none if it does not compete.
    """
    if sum(bool(own) for own in statuses) < 2:
        return [False] * len(statuses)
    return [bool(own) and all(status == "converged" for status in own) for own in statuses]


def keeps_rows(lines: Sequence[Mapping[str, Any]]) -> bool:
    """Whether no row was violated in any trial."""
    return bool(lines) and all(line["violation_depth"] == 0.0 for line in lines)


def judged_by(metric: Metric, lines: Sequence[Mapping[str, Any]]) -> bool:
    """Whether runs that converged may be compared by a metric.

    Depth and time outside tell who leaves the allowed space; everything else counts only inside it, and the φ band only
    where no sliding mode was lost.
    """
    kept = metric.judged == "any" or keeps_rows(lines)
    return kept and (metric.judged != "sliding" or all(line["sliding_lost_s"] == 0.0 for line in lines))


def shown(metric: Metric, line: Mapping[str, Any]) -> float:
    """A metric's value in a line of results.csv, in the unit in which reports show it; NaN where there is none."""
    value = float(line[metric.column])
    if metric.over:
        divisor = float(line[metric.over])
        value = value / divisor if math.isfinite(divisor) and divisor > 0.0 else math.nan
    return metric.factor * value
