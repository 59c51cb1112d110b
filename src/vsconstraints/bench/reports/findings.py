"""Findings of the report of evidence: claims with the unrounded numbers behind them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

from ...comparisons.runs.spec import BASELINE
from ...controllers.demand import USES
from ...reports.markdown import first_names
from ...reports.page import render
from ...rows.readable import counted
from ..statistics import rate
from .dataset import Dataset
from .ranking import (
    MAX_NAMES,
    Ranking,
    Share,
    best_by,
    condition_text,
    kept_ranking,
    names_text,
    ranking,
)

#: Information that may be unavailable: as controllers declare it, and in words.
INFORMATION: tuple[tuple[str, str], ...] = ((USES["Lf"], USES["Lf"]), ("model", "a model"))
MIN_REACHED = 0.9  #: The baseline is reported if it reaches the goal less often.


@dataclass(frozen=True)
class Finding:
    """Claim of the report: its text, kind, condition and controllers.

    ``numbers`` are all that the text shows, unrounded, with shares from 0 to 1. The numbers of a
    controller carry its name, as in ``success[sliding-mode]``. ``standard`` is the standard of
    violations, ``strict`` or ``tolerant``, and empty if the claim is not about violations.
    ``condition`` is empty if the claim is about several conditions.
    """

    text: str
    about: str
    condition: str = ""
    laws: tuple[str, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
    standard: str = "strict"


def text_of(about: str, **facts: Any) -> str:
    """Render the sentence of a finding from the template."""
    template = Path(__file__).with_name("findings.md")
    return render(template, about=about, **{"ranked": None, **facts}).strip()


def findings(dataset: Dataset) -> dict[str, list[Finding]]:
    """Return the findings on each condition, in order."""
    by_condition = {}
    for condition in dataset.conditions:
        ranked = ranking(dataset, condition)
        if ranked.scenes:
            several = [
                best(ranked),
                *without_information(dataset, ranked),
                calmest(dataset, ranked),
                best(ranking(dataset, condition, "tolerant success"), "tolerant"),
                violations(dataset, condition),
                attainable(dataset, condition),
            ]
            by_condition[condition] = [finding for finding in several if finding is not None]
    return by_condition


def best(ranked: Ranking, standard: str = "strict") -> Finding:
    """Return the finding on the best controllers and the first one significantly behind."""
    about = "best"
    named = [ranked.leader]
    pair = None
    if not ranked.hopeless and len(ranked.laws) > 1:
        about = "best" if ranked.next else "alike"
        named = named_of(ranked.front)
        pair = (ranked.leader, ranked.next) if ranked.next else None
    about = about if standard == "strict" else standard
    named += pair[1:] if pair else ()
    text = text_of(about, ranked=ranked, begin=condition_text(ranked.condition))
    return Finding(
        text, about, ranked.condition, tuple(named), numbers_of(ranked, named, pair), standard
    )


def without_information(dataset: Dataset, ranked: Ranking) -> list[Finding]:
    """Return findings on the best controllers that do not need some information, such as L_fφ."""
    if ranked.hopeless or ranked.next is None:
        return []
    known = {}
    for law in ranked.laws:
        required = dataset.required[law]
        if required is not None:
            known[law] = required
    several = []
    for what, words in INFORMATION:
        spare = [law for law, required in known.items() if what not in required]
        about = f"without {what}"
        in_front = [law for law in ranked.front if law in spare]
        # It is obvious that leaders without this information need no model.
        if not spare or len(spare) == len(known) or (in_front and what != INFORMATION[0][0]):
            continue
        named = named_of(in_front)
        numbers = dict[str, float]()
        facts = dict[str, Any]()
        if not in_front:
            without = ranked.among(spare)
            leader = ranked.leader
            pair = (leader, without.leader)
            named = named_of(without.front)
            numbers = numbers_of(ranked, named, pair)
            named.append(leader)
            facts = {"ranked": without, "leader": leader, "difference": ranked.differences[pair]}
        text = text_of(about, words=words, in_front=names_text(in_front), **facts)
        several.append(Finding(text, about, ranked.condition, tuple(named), numbers))
    return several


def calmest(dataset: Dataset, ranked: Ranking) -> Finding | None:
    """Return the finding on the leader with significantly the lowest command variation, if any."""
    front = list(ranked.front)
    if len(front) < 2 or ranked.hopeless:
        return None
    best = best_by(dataset, ranked.condition, front, "acceleration_variation", ratio=True)
    if best is None or len(best[0]) > 1:
        return None
    (calm,), pairs = best
    second = max((law for law in front if law != calm), key=lambda law: pairs[calm, law].difference)
    pair = pairs[calm, second]
    scenes = counted(pair.scenes, "scene")
    text = text_of("calmest", calm=calm, second=second, pair=pair, scenes=scenes)
    numbers = {
        "ratio": pair.difference,
        "ratio_low": pair.low,
        "ratio_high": pair.high,
        "ratio_scenes": pair.scenes,
    }
    others = tuple(law for law in front if law not in (calm, second))
    return Finding(text, "calmest", ranked.condition, (calm, second, *others), numbers)


def violations(dataset: Dataset, condition: str) -> Finding:
    """Return the finding on controllers that violate a row least often, by the strict standard."""
    ranked = kept_ranking(dataset, condition)
    violated = {law: ranked.shares[law].complement for law in named_of(ranked.front)}
    numbers: dict[str, float] = {"scenes": ranked.scenes}
    for law, share in violated.items():
        numbers |= share.numbers("violation", law=law)
    text = text_of("violations", shares=violated)
    return Finding(text, "violations", condition, tuple(violated), numbers)


def attainable(dataset: Dataset, condition: str) -> Finding | None:
    """Return the finding on how often the baseline reaches the goal, None if nearly always."""
    runs = dataset.evidence.runs
    baseline = runs[(runs["controller"] == BASELINE) & (runs["condition"] == condition)]
    count = len(baseline)
    share = Share.of(rate((baseline["status"] == "converged").to_numpy(bool)))
    if not count or share.value >= MIN_REACHED:
        return None
    text = text_of("attainable", share=share, scenes=counted(count, "scene"))
    numbers: dict[str, float] = share.numbers("reached")
    numbers["scenes"] = count
    return Finding(text, "attainable", condition, (), numbers, standard="")


def reversals(dataset: Dataset) -> Iterator[Finding]:
    """Yield the finding on the greatest rank reversal of each further condition.

    It is significant in both conditions on the same families.
    """
    first, *others = dataset.conditions or ("",)
    for other in others:
        common = dataset.families_of(first, other)
        before = ranking(dataset, first, families=common)
        after = ranking(dataset, other, families=common)
        sizes = _reversal_sizes(before, after)
        if not sizes:
            continue
        a, b = max(sizes, key=sizes.__getitem__)
        shares = {first: before.differences[a, b], other: after.differences[b, a]}
        texts = {}
        numbers: dict[str, float] = {
            "scenes": before.scenes,
            "families": before.families,
            "pairs": len(sizes),
        }
        for condition, share in shares.items():
            texts[condition_text(condition, inside=True)] = share
            numbers |= share.numbers(
                f"difference[{condition}]", f"low[{condition}]", f"high[{condition}]"
            )
        text = text_of("turned", a=a, b=b, shares=texts, ranked=before, more=len(sizes) - 1)
        yield Finding(text, "turned", other, (a, b), numbers)


def _reversal_sizes(before: Ranking, after: Ranking) -> dict[tuple[str, str], float]:
    """Return the smaller difference of each pair that is significantly reversed, by pair."""
    sizes = {}
    for a, b in combinations(before.laws, 2):
        if a not in after.laws or b not in after.laws or after.differences[a, b].value >= 0.0:
            continue
        if before.significant(a, b) and after.significant(a, b):
            gap_before = before.differences[a, b].value
            gap_after = after.differences[b, a].value
            sizes[a, b] = min(gap_before, gap_after)
    return sizes


def tuning_gain(dataset: Dataset) -> Finding | None:
    """Return the finding on the gain from tuning in the first condition, for each controller."""
    ranked = ranking(dataset, dataset.conditions[0])
    pairs = {law: name for law, name in dataset.tuned.items() if {law, name} <= set(ranked.laws)}
    if not pairs:
        return None
    gains = {
        law: ranked.differences[name, law]
        for law, name in pairs.items()
        if ranked.significant(name, law)
    }
    better = {law: gain for law, gain in gains.items() if gain.value > 0.0}
    worse = {law: gain.reversed for law, gain in gains.items() if gain.value < 0.0}
    numbers = {"scenes": float(ranked.scenes)}
    for law in (*better, *worse):
        numbers |= gains[law].numbers("difference", law=law)
    changed = {"more successful": better, "less successful": worse}
    same = [law for law in pairs if law not in gains]
    condition = condition_text(ranked.condition, inside=True)
    scenes = counted(ranked.scenes, "held-out scene")
    text = text_of(
        "tuned", condition=condition, changed=changed, same=names_text(same), scenes=scenes
    )
    return Finding(text, "tuned", ranked.condition, tuple(pairs), numbers)


def always_failing(dataset: Dataset) -> list[Finding]:
    """Return findings on controllers whose runs all failed or aborted, with the main reason."""
    several = []
    for law in dataset.laws:
        runs = dataset.of_law(law)
        if runs["status"].isin(["failed", "aborted"]).all():
            reasons = runs["reason"].fillna("").astype(str)
            why = str(reasons.value_counts().index[0])
            count = counted(len(runs), "run")
            text = text_of("nowhere", law=law, runs=count, why=why)
            numbers = {"runs": len(runs)}
            several.append(Finding(text, "nowhere", "", (law,), numbers, standard=""))
    return several


def named_of(laws: Sequence[str]) -> list[str]:
    """Return the controllers that a sentence names."""
    return [law for law in first_names(laws, MAX_NAMES) if law in laws]


def numbers_of(
    ranked: Ranking, laws: Sequence[str], pair: tuple[str, str] | None = None
) -> dict[str, float]:
    """Return the numbers of a finding on these controllers and on the difference of two of them."""
    numbers: dict[str, float] = {"scenes": ranked.scenes, "families": ranked.families}
    for law in laws:
        numbers |= ranked.shares[law].numbers("success", law=law)
    if pair is not None:
        numbers |= ranked.differences[pair].numbers(
            "difference", "difference_low", "difference_high"
        )
    return numbers
