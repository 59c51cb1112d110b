"""Which conclusions on pairs of controllers hold in other conditions, and which reversals would be detected."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from statistics import median
from typing import Any, NamedTuple

from ...comparisons.statistics import detectable, simultaneous
from ...rows.readable import counted
from ..markdown import Table, bold, enumeration
from ..numbers import DASH
from .dataset import SCENE, Dataset
from .findings import Finding
from .formatting import MAX_NAMES, condition_text, percentage, scenes_text
from .ranking import MEASURES, Measure, PairVerdict, PairVerdicts, pairwise_verdicts

HOLDS, REVERSED, INCONCLUSIVE = "holds", "reversed", "inconclusive"
"""Same significant ordering in the other condition; opposite significant ordering; no significant difference."""

POWER = 0.8
"""With which a reversal of the reported size would have been detected."""


class Conclusion(NamedTuple):
    """One controller is better than another in the first condition; and the outcome in another condition.

    Attributes
    ----------
    measure
        By what.
    better, worse
        The controllers.
    condition
        The other one.
    outcome
        One of :data:`HOLDS`, :data:`REVERSED`, :data:`INCONCLUSIVE`.
    first, other
        The two compared in each of the two conditions.
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
        """Whether a reversal by the margin or more is excluded."""
        return self.measure.excludes(self.other)

    def as_data(self) -> dict[str, Any]:
        """For files."""
        return {
            "measure": self.measure.name,
            "better": self.better,
            "worse": self.worse,
            "condition": self.condition,
            "outcome": self.outcome,
            "reversal_excluded": self.excluded,
            "standard": "strict",
            "first": self.first.as_data(),
            "other": self.other.as_data(),
        }


class Power(NamedTuple):
    """Which reversals would have been detected, by a measure in a condition.

    Attributes
    ----------
    measure, condition
        By what, and where.
    conclusions
        How many there are.
    scenes
        On which a pair is compared: median over the conclusions.
    detectable
        Share of scenes by which the controller that was ahead must fall behind the other one, to be detected with
        :data:`POWER` (:func:`.detectable`); of success and violation the difference of rates. Infinite where none is.
    """

    measure: str
    condition: str
    conclusions: int
    scenes: float
    detectable: float

    def as_data(self) -> dict[str, Any]:
        """For files: what is not finite is None."""
        return {**self._asdict(), "detectable": self.detectable if isfinite(self.detectable) else None}

    @property
    def text(self) -> str:
        """The least detectable reversal, for a sentence or a cell."""
        return f"{percentage(self.detectable, 0)} points" if isfinite(self.detectable) else "none"


def conclusions(dataset: Dataset) -> tuple[Conclusion, ...]:
    """All conclusions of the first condition in each of the others, in the families that both have."""
    return dataset.once(
        "conclusions",
        lambda: tuple(
            one for other in dataset.conditions[1:] for measure in MEASURES for one in _of(dataset, measure, other)
        ),
    )


def _of(dataset: Dataset, measure: Measure, condition: str) -> list[Conclusion]:
    first = dataset.conditions[0]
    before = _verdicts(dataset, _runs(dataset, first, condition), measure)
    after = _verdicts(dataset, _runs(dataset, condition, first), measure)
    became = {"better": HOLDS, "worse": REVERSED}
    return [
        Conclusion(measure, *pair, condition, became.get(after[pair].verdict, INCONCLUSIVE), one, after[pair])
        for pair, one in before.items()
        if one.verdict == "better" and pair in after
    ]


def powers(dataset: Dataset) -> tuple[Power, ...]:
    """What each condition could have detected, measure by measure."""
    several = []
    for condition in dataset.conditions[1:]:
        for measure in MEASURES:
            own = [one.other for one in conclusions(dataset) if (one.condition, one.measure) == (condition, measure)]
            if own:
                after = _verdicts(dataset, _runs(dataset, condition, dataset.conditions[0]), measure)
                tests = sum(one.verdict != "too few" for one in after.values()) // 2
                scenes = median(one.scenes for one in own)
                differing = median(one.differ / one.scenes for one in own if one.scenes) if scenes else 0.0
                least = detectable(int(scenes), differing, simultaneous(0.95, tests), POWER)
                several.append(Power(measure.name, condition, len(own), scenes, least))
    return tuple(several)


def _runs(dataset: Dataset, condition: str, other: str) -> Any:
    """Runs in a condition of the families that are in the other one too, of controllers that work in both."""
    common = [name for name in dataset.families_of(condition) if name in dataset.families_of(other)]
    working = set(dataset.working(condition)) & set(dataset.working(other))
    runs = dataset.among(condition, common)
    return runs[runs["controller"].isin(working)]


def _verdicts(dataset: Dataset, runs: Any, measure: Measure) -> PairVerdicts:
    """As :func:`pairwise_verdicts`, once for the same runs."""
    columns = ["condition", *SCENE, "controller"]
    key = "pairs", measure.name, frozenset(runs[columns].itertuples(index=False, name=None))
    return dataset.once(key, lambda: pairwise_verdicts(runs, measure.name, ratio=measure.ratio))


def robustness_findings(dataset: Dataset) -> list[Finding]:
    """For each further condition, how many conclusions hold there, and which are reversed."""
    return [
        _finding(dataset, condition, own)
        for condition in dataset.conditions[1:]
        if (own := [one for one in conclusions(dataset) if one.condition == condition])
    ]


def _finding(dataset: Dataset, condition: str, own: Sequence[Conclusion]) -> Finding:
    outcomes = {name: [one for one in own if one.outcome == name] for name in (HOLDS, REVERSED, INCONCLUSIVE)}
    numbers: dict[str, float] = {"conclusions": len(own), **{name: len(each) for name, each in outcomes.items()}}
    excluded = sum(one.excluded for one in outcomes[INCONCLUSIVE])
    runs = _runs(dataset, condition, dataset.conditions[0])
    scenes, families = len(runs[SCENE].drop_duplicates()), len(set(runs["family"]))
    numbers |= {"reversal_excluded": excluded, "scenes": scenes, "families": families}
    text = (
        f"Robustness, {condition_text(condition, inside=True)}: of {counted(len(own), 'conclusion')} on pairs of "
        f"controllers, {len(outcomes[HOLDS])} hold, {len(outcomes[REVERSED])} are reversed and "
        f"{len(outcomes[INCONCLUSIVE])} are inconclusive, {excluded} of which exclude a reversal by the equivalence "
        f"margin ({scenes_text(scenes, families)})."
    )
    if outcomes[REVERSED]:
        named = [f"{one.better} before {one.worse} by {one.measure.words}" for one in outcomes[REVERSED]]
        more = [f"{len(named) - MAX_NAMES} more"] if len(named) > MAX_NAMES else []
        text += f" Reversed: {enumeration([*named[:MAX_NAMES], *more])}."
    power = next((one for one in powers(dataset) if (one.condition, one.measure) == (condition, "success")), None)
    if power is not None and isfinite(power.detectable):
        text += f" A reversal of success is detectable with {percentage(POWER, 0)} % power from {power.text} on."
        numbers["detectable"] = power.detectable
    elif power is not None:
        text += f" No reversal of success is detectable with {percentage(POWER, 0)} % power."
    return Finding(text, "holds", condition, (), numbers)


def power_table(dataset: Dataset) -> str:
    """One line per condition and measure: the outcomes of its conclusions, and the reversals it could detect."""
    measures = {measure.name: measure for measure in MEASURES}
    lines = []
    for power in powers(dataset):
        key, measure = (power.condition, power.measure), measures[power.measure]
        own = [one for one in conclusions(dataset) if (one.condition, one.measure.name) == key]
        counts = [sum(one.outcome == outcome for one in own) for outcome in (HOLDS, REVERSED, INCONCLUSIVE)]
        excluded = sum(one.excluded for one in own if one.outcome == INCONCLUSIVE)
        cells = [*map(str, (*counts, excluded)), measure.margin_text, f"{power.scenes:g}", power.text]
        lines.append([f"{measure.words}, {power.condition}", *cells])
    header = ["", "hold", "reversed", "inconclusive", "reversal excluded", "margin", "scenes", "detectable from"]
    return Table(header, lines) if lines else ""


def conclusion_tables(dataset: Dataset) -> dict[str, str]:
    """By the title of a measure, every conclusion and its outcome in the other conditions; empty if there is none."""
    first, *others = dataset.conditions or ("",)
    tables = {}
    for measure in MEASURES:
        own = {(one.better, one.worse, one.condition): one for one in conclusions(dataset) if one.measure == measure}
        lines = []
        for pair in dict.fromkeys((better, worse) for better, worse, _ in own):
            each = [own.get((*pair, condition)) for condition in others]
            before = next(one.first.text(measure) for one in each if one is not None)
            lines.append([*pair, before, *map(_cell, each)])
        tables[measure.title] = Table(["better", "worse", first, *others], lines, 2) if lines else ""
    return tables


def _cell(one: Conclusion | None) -> str:
    if one is None:
        return DASH
    if one.outcome == INCONCLUSIVE:
        return one.outcome
    word = bold(one.outcome) if one.outcome == REVERSED else one.outcome
    return f"{word}, {one.other.text(one.measure)}"
