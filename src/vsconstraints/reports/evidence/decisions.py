"""Which law to take: for each condition, the best by what matters first, and what cannot be told from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...comparisons.metrics import NEGLIGIBLE, TOLERANT
from ...comparisons.statistics.judged import judged_metric
from ..markdown import bold, enumeration, table
from ..numbers import DASH, of_length
from .material import Material
from .pairs import PairVerdicts, pairwise_verdicts
from .standing import Standing, standing
from .words import first_of, where

AIMS: tuple[tuple[str, str], ...] = (
    ("calmest of these", "acceleration_variation"),
    ("soonest of these", "settling_time_s"),
    ("most space of these", "utilization"),
)
"""What is asked of laws that succeed equally often, and the metric that says it."""


@dataclass(frozen=True)
class Best:
    """The best of some laws by a metric, on the scenes in which all of them succeed.

    Attributes
    ----------
    laws
        The best, and those that are not distinguishable from it.
    pairs
        Every law against every other one.
    scenes
        How many scenes there are.
    """

    laws: tuple[str, ...]
    pairs: PairVerdicts
    scenes: int


def decisions(material: Material) -> str:
    """One line per condition."""
    tolerated = f"at {of_length(TOLERANT)}"
    header = ["condition", "succeeds most often", tolerated, "violates least often", *(aim for aim, _ in AIMS)]
    lines = []
    for condition in material.conditions:
        one = standing(material, condition)
        kept = standing(material, condition, "kept").among(material.going(condition))
        if one.scenes:
            never = one.shares[one.leader].value == 0.0
            aims = [DASH if never else _told(best_by(material, condition, one.front, metric)) for _, metric in AIMS]
            tolerant = standing(material, condition, "tolerant success")
            fronts = ["none" if each.shares[each.leader].value == 0.0 else _group(each) for each in (one, tolerant)]
            lines.append([where(condition), *fronts, _group(kept), *aims])
    if not lines:
        return ""
    text = (
        f"By the strict standard ({of_length(NEGLIGIBLE)}) and, in the column that says so, by the tolerant one. Laws "
        "that stand together are not distinguishable from the first of them. *Of these* is among those that "
        "succeed most often, on the scenes in which all of these succeed: by acceleration variation, settling time and "
        "utilization."
    )
    return "\n\n".join(("## Which law to take", table(header, lines, len(header)), text))


def _group(one: Standing) -> str:
    if len(one.laws) > 1 and len(one.front) == len(one.laws):
        return "not distinguishable"
    return _names(one.front)


def _told(best: Best | None) -> str:
    if best is None:
        return DASH
    return _names(best.laws)


def _names(laws: Sequence[str]) -> str:
    """A law alone is bold; of many that are alike, the first."""
    if len(laws) == 1:
        return bold(laws[0])
    named, more = first_of(laws)
    return enumeration([*named, *more])


def best_by(material: Material, condition: str, laws: Sequence[str], metric: str, ratio: bool = False) -> Best | None:
    """The best of some laws by the median of a metric over scenes in which all succeed; None where there are none."""
    runs = material.among(condition)
    runs = runs[runs["controller"].isin(list(laws))]
    values = material.paired(condition, metric)[list(laws)].astype(float)
    clean = material.paired(condition, "success").astype(bool)[list(laws)].all(axis=1) & values.notna().all(axis=1)
    values = values[clean]
    if len(laws) < 2 or values.empty:
        return None
    scenes = set(values.index)
    chosen = runs[[key in scenes for key in zip(runs["family"], runs["scene"], strict=True)]]
    medians = values.median()
    first = str(medians.idxmin() if judged_metric(metric).better == "less" else medians.idxmax())
    pairs = pairwise_verdicts(chosen, metric, ratio=ratio)  # of all: the same scenes say which is first
    alike = (law for law in laws if law != first and pairs[first, law].verdict != "better")
    return Best((first, *alike), pairs, len(values))
