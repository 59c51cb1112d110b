"""What a metric says of itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from .measured import Measured


@dataclass(frozen=True)
class Metric:
    """A column of results.csv or constraints.csv, and of the tables of reports.

    Attributes
    ----------
    column
        Its name.
    value
        Its value for a run or, in constraints.csv, for each row of it; None for the ratio of two other columns.
    header
        What the tables of a scenario call it, with the unit in which they show it; empty if they do not.
    better
        Which values are better; None where none is: a fact, or noise.
    definition
        What it means; empty where the name says it.
    kind
        What a cell holds; a ``time`` is a number that differs from run to run on the same machine.
    group
        Which table of a scenario shows it.
    judged
        Whose values are compared, of the runs that converged: ``any``, those ``inside`` that violated no row, or of
        those the ones still ``sliding`` that never lost a sliding mode.
    factor, style
        From the stored to the shown number. Styles: three digits; the same, but not less than a thousandth; two
        decimals; whole.
    over
        Column that it is divided by; empty if by none.
    overall, condensed
        What the tables over all scenarios call it, if it is there; and what stands for several runs: the ``median`` of
        those that converged, of a time of all, or the
        ``worst`` of all. No mean: one run that diverges would be all of it.
    finding
        Sentence of the findings that tells who has the best value, and its unit; empty for none.
    added
        Columns stand in the order in which they were added: a new one has a greater number than the others.
    """

    column: str
    value: Callable[[Measured], Any] | None
    header: str = ""
    better: Literal["less", "more"] | None = "less"
    definition: str = ""
    kind: Literal["number", "time", "text", "flag"] = "number"
    group: Literal["outcome", "task", "chattering", "time"] = "chattering"
    judged: Literal["any", "inside", "sliding"] = "inside"
    factor: float = 1.0
    style: Literal["number", "error", "percent", "count"] = "number"
    over: str = ""
    overall: str = ""
    condensed: Literal["median", "worst"] = "median"
    finding: tuple[str, str] = ("", "")
    added: int = 0
