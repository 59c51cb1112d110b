"""Every two laws compared on the same scenes, by what reports draw conclusions about."""

from __future__ import annotations

from math import inf, isfinite
from typing import Any, NamedTuple

from ...comparisons.statistics import compare_laws
from ...rows.readable import counted
from ..numbers import number
from .words import percentage


class Measure(NamedTuple):
    """What two laws are compared by.

    Attributes
    ----------
    name
        Of an outcome or a metric of :mod:`vsconstraints.comparisons.statistics`.
    words, title
        What sentences and headings call it.
    margin
        Equivalence margin: the smallest reversal that would matter, as a difference or a ratio.
    more
        Whether more is better.
    ratio
        Whether values are compared by their ratio, and not by their difference, in per cent.
    """

    name: str
    words: str
    title: str
    margin: float
    more: bool = False
    ratio: bool = False

    def excludes(self, pair: PairVerdict) -> bool:
        """Whether an interval excludes that the first law is worse by the margin or more."""
        return pair.low > -self.margin if self.more else pair.high < self.margin

    @property
    def margin_text(self) -> str:
        """The margin, for a table's cell."""
        return f"× {number(self.margin)}" if self.ratio else counted(round(100.0 * self.margin), "point")


MEASURES = (
    Measure("success", "success", "Success: all rows kept, strictly, and the goal reached", 0.1, more=True),
    Measure("violation", "violation", "Violation: a row is violated, strictly", 0.1),
    Measure("utilization", "space", "Space: utilization, where both laws succeed", 0.01, more=True),
    Measure(
        "acceleration_variation", "chattering", "Chattering: acceleration variation, where both succeed", 1.25,
        ratio=True,
    ),
)  # fmt: skip
"""What conclusions are about. The margins are a choice: half of what separates neighbours in the study of all families
by success and violation, a hundredth of the space, a quarter of the variation."""


class PairVerdict(NamedTuple):
    """One law against another by a measure, in one condition.

    Attributes
    ----------
    difference, low, high
        Of the rates, or the median of the difference or ratio of values over the scenes in which they differ: the first
        law's against the other's. The interval is simultaneous for all pairs of laws.
    p
        Corrected for all pairs of laws.
    scenes, differ
        How many are compared, and in how many of them the laws differ.
    verdict
        ``better``, ``worse``, ``not distinguishable`` or ``too few``.
    """

    difference: float
    low: float
    high: float
    p: float
    scenes: int
    differ: int
    verdict: str

    def as_data(self) -> dict[str, Any]:
        """For files: what is not finite is None."""
        return {name: None if isinstance(v, float) and not isfinite(v) else v for name, v in self._asdict().items()}

    def text(self, measure: Measure) -> str:
        """The difference, for a table's cell."""
        return f"× {number(self.difference)}" if measure.ratio else f"{percentage(self.difference, 1)} %"


PairVerdicts = dict[tuple[str, str], PairVerdict]
"""Every law against every other one."""


def pairwise_verdicts(runs: Any, metric: str, *, ratio: bool = False) -> PairVerdicts:
    """Every law against every other one on the same scenes, by the ratio or the difference of a metric or outcome."""
    found: PairVerdicts = {}
    for line in compare_laws(runs, metric, by=()).itertuples():
        ends = (line.ratio, line.ratio_low, line.ratio_high) if ratio else (line.difference, line.low, line.high)
        swapped = [1.0 / end if end else inf for end in ends] if ratio else [-end for end in ends]
        against = {"better": "worse", "worse": "better"}.get(line.verdict, line.verdict)
        same = line.p_corrected, line.paired, line.differ
        found[line.a, line.b] = PairVerdict(*ends, *same, line.verdict)
        found[line.b, line.a] = PairVerdict(swapped[0], swapped[2], swapped[1], *same, against)
    return found
