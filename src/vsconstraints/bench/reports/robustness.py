"""Conclusions on pairs of controllers that hold in other conditions, and detectable reversals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import isfinite
from statistics import median
from typing import Any, NamedTuple

from ...reports.numbers import number, percentage
from ..statistics import detectable, simultaneous
from .dataset import SCENE, Dataset
from .findings import Finding, text_of
from .ranking import PairVerdict, PairVerdicts, finite, pairwise_verdicts

#: Outcomes: same significant order, opposite significant order, no significant difference.
OUTCOMES = ("holds", "reversed", "inconclusive")
#: Outcomes by the verdict on a conclusion's pair in the other condition.
REPEATED = {"better": "holds", "worse": "reversed"}
POWER = 0.8  #: Power with which a reversal of the reported size would have been detected.


class Measure(NamedTuple):
    """Outcome or metric by which two controllers are compared, with its names.

    ``words`` is the name in cells, ``title`` the one in headings. ``margin`` is the smallest
    reversal that would matter, as a difference or, with ``ratio``, a ratio. ``more`` is True if
    more is better.
    """

    name: str
    words: str
    title: str
    margin: float
    more: bool = False
    ratio: bool = False

    def text(self, pair: PairVerdict) -> str:
        """Format the difference for a table's cell."""
        if self.ratio:
            return f"× {number(pair.difference)}"
        return f"{percentage(pair.difference, 1)} points"


#: Measures of the conclusions. The margins are a choice: half the gap between neighbours in the
#: study of all families by success and violation, 1 % of the space, 25 % of the variation.
MEASURES = (
    Measure("success", "success", "Success", 0.1, more=True),
    Measure("violation", "violation", "Violation", 0.1),
    Measure("utilization", "space", "Utilization, where both succeed", 0.01, more=True),
    Measure(
        "acceleration_variation",
        "chattering",
        "Acceleration variation, where both succeed",
        1.25,
        ratio=True,
    ),
)


class Conclusion(NamedTuple):
    """Conclusion that one controller is better than another in the first condition.

    ``outcome`` is its outcome in another ``condition``. ``first`` and ``other`` compare the two
    controllers in these conditions.
    """

    measure: Measure
    better: str
    worse: str
    condition: str
    outcome: str
    first: PairVerdict
    other: PairVerdict

    @property
    def excluded(self) -> bool:
        """True if the interval excludes a reversal by the margin or more."""
        if self.measure.more:
            return self.other.low > -self.measure.margin
        return self.other.high < self.measure.margin

    def as_data(self) -> dict[str, Any]:
        """Return the conclusion as a dictionary for files."""
        return {
            **self._asdict(),
            "measure": self.measure.name,
            "first": finite(self.first._asdict()),
            "other": finite(self.other._asdict()),
            "reversal_excluded": self.excluded,
            "standard": "strict",
        }


class Power(NamedTuple):
    """Reversals that would have been detected by a measure in a condition.

    ``scenes`` is the number of scenes on which a pair is compared: median over the conclusions.
    ``detectable`` is the share of scenes by which the controller that was ahead must fall behind
    the other one to be detected with :data:`POWER` (:func:`.detectable`); for success and violation
    this is the difference of rates. It is infinite if no reversal would be detected.
    """

    measure: str
    condition: str
    conclusions: int
    scenes: float
    detectable: float


def conclusions(dataset: Dataset) -> list[Conclusion]:
    """Return all conclusions of the first condition with their outcome in each of the others.

    Each pair of conditions is compared on their common families.
    """
    return dataset.once("robustness", lambda: _robustness(dataset))[0]


def powers(dataset: Dataset) -> list[Power]:
    """Return the detectable reversals of each condition and measure."""
    return dataset.once("robustness", lambda: _robustness(dataset))[1]


def _robustness(dataset: Dataset) -> tuple[list[Conclusion], list[Power]]:
    first, *others = dataset.conditions or ("",)
    every = list[Conclusion]()
    powers = list[Power]()
    for condition, measure in product(others, MEASURES):
        before = _verdicts(dataset, first, condition, measure)
        after = _verdicts(dataset, condition, first, measure)
        concluded = []
        for (better, worse), verdict in before.items():
            other = after.get((better, worse))
            if verdict.verdict == "better" and other is not None:
                outcome = REPEATED.get(other.verdict, "inconclusive")
                concluded.append(
                    Conclusion(measure, better, worse, condition, outcome, verdict, other)
                )
        if concluded:
            every += concluded
            powers.append(_power(concluded, after))
    return every, powers


def _power(concluded: Sequence[Conclusion], verdicts: PairVerdicts) -> Power:
    """Return the detectable reversals of the conclusions by one measure in one condition.

    ``verdicts`` are those on all pairs in that condition.
    """
    others = [each.other for each in concluded]
    scenes = median(other.scenes for other in others)
    differing = 0.0
    if scenes:
        differing = median(other.differ / other.scenes for other in others if other.scenes)
    # each pair has a verdict in both orders
    tests = sum(verdict.verdict != "too few" for verdict in verdicts.values()) // 2
    confidence = simultaneous(0.95, tests)
    conclusion = concluded[0]
    return Power(
        conclusion.measure.name,
        conclusion.condition,
        len(concluded),
        scenes,
        detectable(int(scenes), differing, confidence, POWER),
    )


def _runs(dataset: Dataset, condition: str, other: str) -> Any:
    """Return the runs in a condition that can be compared with another one.

    They are of families that both conditions have, and of controllers that work in both.
    """
    working = set(dataset.working(condition)) & set(dataset.working(other))
    runs = dataset.among(condition, dataset.families_of(condition, other))
    return runs[runs["controller"].isin(working)]


def _verdicts(dataset: Dataset, condition: str, other: str, measure: Measure) -> PairVerdicts:
    """Return :func:`pairwise_verdicts` of the runs comparable with another condition; cached."""
    runs = _runs(dataset, condition, other)

    def compute() -> PairVerdicts:
        return pairwise_verdicts(runs, measure.name, ratio=measure.ratio)

    families = frozenset(runs["family"])
    laws = frozenset(runs["controller"])
    return dataset.once(("pairs", measure.name, condition, families, laws), compute)


def robustness_findings(dataset: Dataset) -> list[Finding]:
    """Return a finding for each further condition on its conclusions.

    It states how many hold there, and the detectable reversal of success.
    """
    several = []
    for condition in dataset.conditions[1:]:
        concluded = [each for each in conclusions(dataset) if each.condition == condition]
        if not concluded:
            continue
        runs = _runs(dataset, condition, dataset.conditions[0])
        numbers = {
            "conclusions": len(concluded),
            **_counts(concluded),
            "scenes": len(runs[SCENE].drop_duplicates()),
            "families": len(set(runs["family"])),
        }
        for power in powers(dataset):
            is_shown = power.condition == condition and power.measure == "success"
            if is_shown and isfinite(power.detectable):
                numbers["detectable"] = power.detectable
        text = text_of("holds", **numbers)
        several.append(Finding(text, "holds", condition, (), numbers))
    return several


def _counts(concluded: list[Conclusion]) -> dict[str, float]:
    """Count the conclusions with each outcome.

    ``reversal_excluded`` counts the inconclusive ones that exclude a reversal by the margin.
    """
    counts: dict[str, float] = {}
    for outcome in OUTCOMES:
        counts[outcome] = sum(each.outcome == outcome for each in concluded)
    inconclusive = [each for each in concluded if each.outcome == "inconclusive"]
    counts["reversal_excluded"] = sum(each.excluded for each in inconclusive)
    return counts


def counts(dataset: Dataset, condition: str, measure: Measure) -> dict[str, float]:
    """Count the outcomes of the conclusions by a measure in a condition."""
    concluded = [
        each
        for each in conclusions(dataset)
        if each.condition == condition and each.measure == measure
    ]
    return _counts(concluded)


def pairs(dataset: Dataset, measure: Measure) -> dict[tuple[str, str], dict[str, Conclusion]]:
    """Return the conclusions by a measure, keyed by (better, worse) and other condition."""
    found: dict[tuple[str, str], dict[str, Conclusion]] = {}
    for each in conclusions(dataset):
        if each.measure == measure:
            by_condition = found.setdefault((each.better, each.worse), {})
            by_condition[each.condition] = each
    return found
