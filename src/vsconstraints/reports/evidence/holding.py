"""Which conclusions about pairs of laws hold in other conditions: worked out of the runs, and said."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from statistics import median
from typing import Any, NamedTuple

from ...comparisons.statistics import detectable, simultaneous
from ...rows.readable import counted
from ..markdown import bold, bullets, enumeration, table
from ..numbers import DASH
from .material import SCENE, Material
from .pairs import MEASURES, Measure, PairVerdict, PairVerdicts, pairwise_verdicts
from .sentence import Sentence
from .words import of_scenes, percentage, where, within

HOLDS, REVERSED, INCONCLUSIVE = "holds", "reversed", "inconclusive"
"""What becomes of a conclusion in another condition: the same law is better, the other one is, or neither is."""

POWER = 0.8
"""Chance with which a reversal of the size that is reported would have been found."""

MOST_NAMED = 4
"""So many reversed conclusions a sentence names."""


class Conclusion(NamedTuple):
    """That one law is better than another in the first condition, and what becomes of it in another one.

    Attributes
    ----------
    measure
        By what.
    better, worse
        The laws.
    condition
        The other one.
    outcome
        One of :data:`HOLDS`, :data:`REVERSED`, :data:`INCONCLUSIVE`.
    first, other
        The laws compared in the two conditions.
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
    """Which reversals would have been found, by a measure in a condition.

    Attributes
    ----------
    measure, condition
        By what, and where.
    conclusions
        How many there are.
    scenes
        On which a pair is compared: median over the conclusions.
    detectable
        Share of scenes by which the law that was ahead must fall behind the other one, to be found with a chance of
        :data:`POWER` (:func:`.detectable`); of success and violation the difference of rates.
        Infinite where nothing would be.
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
        """From which reversal on, for a sentence or a cell."""
        return f"{percentage(self.detectable, 0)} points" if isfinite(self.detectable) else "none"


def conclusions(material: Material) -> tuple[Conclusion, ...]:
    """All conclusions of the first condition in each of the others, in the families that both have."""
    return material.once(
        "conclusions",
        lambda: tuple(
            one for other in material.conditions[1:] for measure in MEASURES for one in _of(material, measure, other)
        ),
    )


def _of(material: Material, measure: Measure, condition: str) -> list[Conclusion]:
    first = material.conditions[0]
    before = _verdicts(material, _runs(material, first, condition), measure)
    after = _verdicts(material, _runs(material, condition, first), measure)
    became = {"better": HOLDS, "worse": REVERSED}
    return [
        Conclusion(measure, *pair, condition, became.get(after[pair].verdict, INCONCLUSIVE), one, after[pair])
        for pair, one in before.items()
        if one.verdict == "better" and pair in after
    ]


def powers(material: Material) -> tuple[Power, ...]:
    """What each condition could have found, measure by measure."""
    found = []
    for condition in material.conditions[1:]:
        for measure in MEASURES:
            own = [one.other for one in conclusions(material) if (one.condition, one.measure) == (condition, measure)]
            if own:
                after = _verdicts(material, _runs(material, condition, material.conditions[0]), measure)
                tests = sum(one.verdict != "too few" for one in after.values()) // 2
                scenes = median(one.scenes for one in own)
                differing = median(one.differ / one.scenes for one in own if one.scenes) if scenes else 0.0
                least = detectable(int(scenes), differing, simultaneous(0.95, tests), POWER)
                found.append(Power(measure.name, condition, len(own), scenes, least))
    return tuple(found)


def _runs(material: Material, condition: str, other: str) -> Any:
    """Runs in a condition of the families that are in the other one too, of laws that come to anything in both."""
    common = [name for name in material.families_of(condition) if name in material.families_of(other)]
    going = set(material.going(condition)) & set(material.going(other))
    runs = material.among(condition, common)
    return runs[runs["controller"].isin(going)]


def _verdicts(material: Material, runs: Any, measure: Measure) -> PairVerdicts:
    """As :func:`pairwise_verdicts`, once for the same runs."""
    columns = ["condition", *SCENE, "controller"]
    key = "pairs", measure.name, frozenset(runs[columns].itertuples(index=False, name=None))
    return material.once(key, lambda: pairwise_verdicts(runs, measure.name, ratio=measure.ratio))


def held(material: Material) -> list[Sentence]:
    """A sentence for each further condition: how many conclusions hold there, and which are reversed."""
    return [
        _sentence(material, condition, own)
        for condition in material.conditions[1:]
        if (own := [one for one in conclusions(material) if one.condition == condition])
    ]


def _sentence(material: Material, condition: str, own: Sequence[Conclusion]) -> Sentence:
    endings = {name: [one for one in own if one.outcome == name] for name in (HOLDS, REVERSED, INCONCLUSIVE)}
    numbers: dict[str, float] = {"conclusions": len(own), **{name: len(each) for name, each in endings.items()}}
    excluded = sum(one.excluded for one in endings[INCONCLUSIVE])
    runs = _runs(material, condition, material.conditions[0])
    scenes, families = len(runs[SCENE].drop_duplicates()), len(set(runs["family"]))
    numbers |= {"reversal_excluded": excluded, "scenes": scenes, "families": families}
    turned = endings[REVERSED]
    text = (
        f"By the strict standard, of {counted(len(own), 'conclusion')} on pairs of laws "
        f"{within(material.conditions[0])}, {within(condition)} "
        f"{_verb('hold', len(endings[HOLDS]))}, {_verb('are', len(turned))} reversed and "
        f"{_verb('are', len(endings[INCONCLUSIVE]))} inconclusive"
    )
    if endings[INCONCLUSIVE]:
        text += f", of which {_verb('exclude', excluded)} a reversal by the equivalence margin"
    text += f" ({of_scenes(scenes, families)})."
    if turned:
        more = [f"{len(turned) - MOST_NAMED} more"] if len(turned) > MOST_NAMED else []
        named = [f"{one.better} before {one.worse} by {one.measure.words}" for one in turned[:MOST_NAMED]]
        text += f" Reversed: {enumeration([*named, *more])}."
    power = next((one for one in powers(material) if (one.condition, one.measure) == (condition, "success")), None)
    if power is not None and isfinite(power.detectable):
        text += f" A reversal of success is found with {percentage(POWER, 0)} % power from {power.text} on."
        numbers["detectable"] = power.detectable
    elif power is not None:
        text += " No reversal of success, however great, is found with 80 % power."
    return Sentence(text, "holds", condition, (), numbers)


def _verb(plural: str, number_of: int) -> str:
    singular = {"hold": "holds", "are": "is", "exclude": "excludes"}[plural]
    return f"{number_of or 'none'} {singular if number_of == 1 else plural}"


def holding(material: Material) -> str:
    """Every conclusion of the first condition, and what becomes of it in the others."""
    every = conclusions(material)
    if not every:
        return ""
    first, *others = material.conditions
    parts = [
        "## Which conclusions hold",
        f"A conclusion: {within(first)}, one law is significantly better than another. In another condition it "
        "**holds** where the same law is, is **reversed** where the other one is, and is *inconclusive* where neither "
        "is. Inconclusive is not equal: the last columns say which reversals would have been found. The number in the "
        "tables is the difference of rates or the median of differences where laws differ, of chattering of ratios; of "
        "the law against the one after it, on the scenes of that condition.",
        bullets([one.text for one in held(material)]),
        _powers(material),
    ]
    for measure in MEASURES:
        own = [one for one in every if one.measure == measure]
        if own:
            parts += [f"### {measure.title}", _table(own, first, others)]
        else:
            parts += [f"### {measure.title}", f"{where(first)}, no two laws differ significantly."]
    return "\n\n".join(parts)


def _powers(material: Material) -> str:
    """One line per condition and measure: what becomes of its conclusions, and what could have been found."""
    measures = {measure.name: measure for measure in MEASURES}
    lines = []
    for power in powers(material):
        key, measure = (power.condition, power.measure), measures[power.measure]
        own = [one for one in conclusions(material) if (one.condition, one.measure.name) == key]
        counts = [sum(one.outcome == outcome for one in own) for outcome in (HOLDS, REVERSED, INCONCLUSIVE)]
        excluded = sum(one.excluded for one in own if one.outcome == INCONCLUSIVE)
        cells = [*map(str, (*counts, excluded)), measure.margin_text, f"{power.scenes:g}", power.text]
        lines.append([f"{measure.words}, {power.condition}", *cells])
    header = ["", "hold", "reversed", "inconclusive", "reversal excluded", "margin", "scenes", "found from"]
    text = (
        "*Reversal excluded*: of the inconclusive ones, those whose interval excludes that the order is reversed by "
        "the equivalence *margin* or more. *Scenes*: on which two laws are compared, median. *Found from*: the "
        "reversal that a comparison on so many scenes, corrected for all pairs, finds with 80 % power if laws differ "
        "in as many scenes as here; in points of the rate, of space and chattering of the share of scenes in which "
        "a law is better."
    )
    return f"{table(header, lines)}\n\n{text}"


def _table(own: Sequence[Conclusion], first: str, others: Sequence[str]) -> str:
    found = {(one.better, one.worse, one.condition): one for one in own}
    pairs = dict.fromkeys((one.better, one.worse) for one in own)
    lines = []
    for pair in pairs:
        each = [found.get((*pair, condition)) for condition in others]
        before = next(one.first.text(one.measure) for one in each if one is not None)
        lines.append([*pair, before, *(_cell(one) for one in each)])
    return table(["law", "before", first, *others], lines, 2)


def _cell(one: Conclusion | None) -> str:
    if one is None:
        return DASH
    if one.outcome == INCONCLUSIVE:
        return one.outcome
    word = bold(one.outcome) if one.outcome == REVERSED else one.outcome
    return f"{word}, {one.other.text(one.measure)}"
