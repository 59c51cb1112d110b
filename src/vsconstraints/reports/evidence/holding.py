"""Which conclusions about pairs of laws hold in other conditions: worked out of the runs, and said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import inf, isfinite
from typing import Any, NamedTuple

from ...readable import counted
from ...statistics import compare_laws
from ..markdown import bold, bullets, enumeration, table
from ..numbers import DASH, number
from .material import SCENE, Material
from .sentence import Sentence
from .words import of_scenes, percentage, where, within


class Measure(NamedTuple):
    """What two laws are held against each other by.

    Attributes
    ----------
    name
        Of an outcome or a metric of :mod:`vsconstraints.statistics`.
    words, title
        What sentences and headings call it.
    ratio
        Whether values are held together by their ratio, and not by their difference, in per cent.
    """

    name: str
    words: str
    title: str
    ratio: bool = False


MEASURES = (
    Measure("success", "success", "Success: all rows kept, strictly, and the goal reached"),
    Measure("violation", "violation", "Violation: a row is violated, strictly"),
    Measure("utilization", "space", "Space: utilization, where both laws succeed"),
    Measure("acceleration_variation", "chattering", "Chattering: acceleration variation, where both succeed", True),
)
"""What conclusions are about."""

HOLDS, REVERSED, LOST, TOO_FEW = "holds", "reversed", "not told", "too few"
"""What becomes of a conclusion: the same is told, the contrary is, nothing is; or nothing is, and neither is it in the
first condition on the same scenes."""

MOST_NAMED = 4
"""So many reversed conclusions a sentence names."""


class Held(NamedTuple):
    """One law against another by a measure, as one condition tells it.

    Attributes
    ----------
    difference, low, high
        Of the rates, or median over scenes of the difference or ratio of values: the better law's against the other's.
    p
        Corrected for all pairs of laws.
    scenes
        How many are compared.
    verdict
        ``better``, ``worse``, ``not distinguishable`` or ``too few``.
    """

    difference: float
    low: float
    high: float
    p: float
    scenes: int
    verdict: str

    def as_data(self) -> dict[str, Any]:
        """For files: what is not finite is None."""
        return {name: None if isinstance(v, float) and not isfinite(v) else v for name, v in self._asdict().items()}

    def text(self, measure: Measure) -> str:
        """The difference, for a table's cell."""
        return f"× {number(self.difference)}" if measure.ratio else f"{percentage(self.difference, 1)} %"


class Conclusion(NamedTuple):
    """That one law is better than another, which the first condition tells, and what becomes of it in another one.

    Attributes
    ----------
    measure
        By what.
    better, worse
        The laws.
    condition
        The other one.
    outcome
        One of :data:`HOLDS`, :data:`REVERSED`, :data:`LOST`, :data:`TOO_FEW`.
    first, other
        How the two conditions tell it.
    """

    measure: Measure
    better: str
    worse: str
    condition: str
    outcome: str
    first: Held
    other: Held

    def as_data(self) -> dict[str, Any]:
        """For files."""
        told = {"measure": self.measure.name, "better": self.better, "worse": self.worse}
        return {
            **told,
            "condition": self.condition,
            "outcome": self.outcome,
            "standard": "strict",
            "first": self.first.as_data(),
            "other": self.other.as_data(),
        }


Told = dict[tuple[str, str], Held]
"""Every law against every other one."""


def conclusions(material: Material) -> tuple[Conclusion, ...]:
    """All conclusions of the first condition in each of the others, in the families that both have."""
    return material.once(
        "conclusions",
        lambda: tuple(
            one for other in material.conditions[1:] for measure in MEASURES for one in _of(material, measure, other)
        ),
    )


def _of(material: Material, measure: Measure, condition: str) -> list[Conclusion]:
    first, other = (_runs(material, name, condition) for name in (material.conditions[0], condition))
    before, after = _told(material, first, measure), _told(material, other, measure)
    on_same_scenes = _told(material, first.merge(other[SCENE].drop_duplicates(), on=SCENE), measure)
    found = []
    for pair, held in before.items():
        if held.verdict == "better" and pair in after:
            same = on_same_scenes[pair].verdict if pair in on_same_scenes else "too few"
            found.append(Conclusion(measure, *pair, condition, became(after[pair].verdict, same), held, after[pair]))
    return found


def _runs(material: Material, condition: str, other: str) -> Any:
    """Runs in a condition of the families that are in the other one too, of laws that come to anything in both."""
    common = [name for name in material.families_of(other) if name in material.families_of(material.conditions[0])]
    going = set(material.going(material.conditions[0])) & set(material.going(other))
    runs = material.among(condition, common)
    return runs[runs["controller"].isin(going)]


def _told(material: Material, runs: Any, measure: Measure) -> Told:
    """As :func:`told`, once for the same runs."""
    columns = ["condition", *SCENE, "controller"]
    key = "told", measure.name, frozenset(runs[columns].itertuples(index=False, name=None))
    return material.once(key, lambda: told(runs, measure))


def told(runs: Any, measure: Measure) -> Told:
    """Every law against every other one on the same scenes."""
    found: Told = {}
    for line in compare_laws(runs, measure.name, by=()).itertuples():
        ends = (
            (line.ratio, line.ratio_low, line.ratio_high) if measure.ratio else (line.difference, line.low, line.high)
        )
        swapped = [1.0 / end if end else inf for end in ends] if measure.ratio else [-end for end in ends]
        against = {"better": "worse", "worse": "better"}.get(line.verdict, line.verdict)
        found[line.a, line.b] = Held(*ends, line.p_corrected, line.paired, line.verdict)
        found[line.b, line.a] = Held(swapped[0], swapped[2], swapped[1], line.p_corrected, line.paired, against)
    return found


def became(verdict: str, on_same_scenes: str) -> str:
    """What becomes of "better" where another condition gives a verdict.

    Parameters
    ----------
    verdict
        Of the other condition.
    on_same_scenes
        Of the first condition on the scenes of the other one, which may be fewer.
    """
    if verdict in ("better", "worse"):
        return HOLDS if verdict == "better" else REVERSED
    return LOST if on_same_scenes == "better" else TOO_FEW


def held(material: Material) -> list[Sentence]:
    """A sentence for each further condition: how many conclusions hold there, and which are reversed."""
    return [
        _sentence(material, condition, own)
        for condition in material.conditions[1:]
        if (own := [one for one in conclusions(material) if one.condition == condition])
    ]


def _sentence(material: Material, condition: str, own: Sequence[Conclusion]) -> Sentence:
    endings = Counter(one.outcome for one in own)
    runs = _runs(material, condition, condition)
    scenes, families = len(runs[SCENE].drop_duplicates()), len(set(runs["family"]))
    unknown = endings[LOST] + endings[TOO_FEW]
    few = f", {endings[TOO_FEW]} of these since there are too few scenes" if endings[TOO_FEW] else ""
    text = (
        f"By the strict standard, of {counted(len(own), 'conclusion')} on pairs of laws that hold "
        f"{within(material.conditions[0])}, "
        f"{endings[HOLDS]} {_verb('hold', endings[HOLDS])} {within(condition)}, {endings[REVERSED]} "
        f"{_verb('are', endings[REVERSED])} reversed, and of {unknown} it cannot be told{few} "
        f"({of_scenes(scenes, families)})."
    )
    turned = [one for one in own if one.outcome == REVERSED]
    if turned:
        more = [f"{len(turned) - MOST_NAMED} more"] if len(turned) > MOST_NAMED else []
        named = [f"{one.better} before {one.worse} by {one.measure.words}" for one in turned[:MOST_NAMED]]
        text = f"{text} Reversed: {enumeration([*named, *more])}."
    numbers = {"conclusions": len(own), **{name: endings[name] for name in (HOLDS, REVERSED, LOST, TOO_FEW)}}
    return Sentence(text, "holds", condition, (), {**numbers, "scenes": scenes, "families": families})


def _verb(plural: str, number_of: int) -> str:
    return {"hold": "holds", "are": "is"}[plural] if number_of == 1 else plural


def holding(material: Material) -> str:
    """Every conclusion of the first condition, and what becomes of it in the others."""
    every = conclusions(material)
    if not every:
        return ""
    first, *others = material.conditions
    parts = [
        "## Which conclusions hold",
        f"A conclusion: {within(first)}, the evidence tells one law (*before*) from another one. In another condition "
        f"it **holds** where the same is told there, is **reversed** where the contrary is, and is *{LOST}* where "
        f"nothing is; *{TOO_FEW}*: nor is anything told {within(first)} on the scenes that the condition has. The "
        "number is the difference of rates or of medians, of chattering the ratio; of the law before against the "
        "other one, on the scenes of that condition.",
        bullets([one.text for one in held(material)]),
    ]
    for measure in MEASURES:
        own = [one for one in every if one.measure == measure]
        if own:
            parts += [f"### {measure.title}", _table(own, first, others)]
        else:
            parts += [f"### {measure.title}", f"{where(first)}, no law is told from another one."]
    return "\n\n".join(parts)


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
    if one.outcome in (LOST, TOO_FEW):
        return one.outcome
    word = bold(one.outcome) if one.outcome == REVERSED else one.outcome
    return f"{word}, {one.other.text(one.measure)}"
