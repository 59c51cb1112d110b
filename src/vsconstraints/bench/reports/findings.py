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
        if not ranked.scenes:
            continue
        tolerant = ranking(dataset, condition, "tolerant success")
        several = [
            best(ranked),
            *without_information(dataset, ranked),
            calmest(dataset, ranked),
            best(tolerant, "tolerant"),
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
        named = named_of(ranked.front)
        if ranked.next is None:
            about = "alike"
        else:
            pair = (ranked.leader, ranked.next)
            named.append(ranked.next)
    if standard != "strict":
        about = standard
    text = text_of(about, ranked=ranked, begin=condition_text(ranked.condition))
    numbers = numbers_of(ranked, named, pair)
    return Finding(text, about, ranked.condition, tuple(named), numbers, standard)


def without_information(dataset: Dataset, ranked: Ranking) -> list[Finding]:
    """Return findings on the best controllers that do not need some information, such as L_fφ."""
    if ranked.hopeless or ranked.next is None:
        return []
    known = {}
    for law in ranked.laws:
        uses = dataset.uses_of_laws[law]
        if uses is not None:
            known[law] = uses
    several = []
    for information, words in INFORMATION:
        without = [law for law, uses in known.items() if information not in uses]
        if not without or len(without) == len(known):
            continue
        in_front = [law for law in ranked.front if law in without]
        # It is obvious that leaders without this information need no model.
        if in_front and information != INFORMATION[0][0]:
            continue
        named = named_of(in_front)
        numbers = dict[str, float]()
        facts = dict[str, Any]()
        if not in_front:
            best_without = ranked.among(without)
            leader = ranked.leader
            pair = (leader, best_without.leader)
            named = named_of(best_without.front)
            numbers = numbers_of(ranked, named, pair)
            named.append(leader)
            facts["ranked"] = best_without
            facts["leader"] = leader
            facts["difference"] = ranked.differences[pair]
        about = f"without {information}"
        text = text_of(about, words=words, in_front=names_text(in_front), **facts)
        several.append(Finding(text, about, ranked.condition, tuple(named), numbers))
    return several


def calmest(dataset: Dataset, ranked: Ranking) -> Finding | None:
    """Return the finding on the leader with significantly the lowest command variation, if any."""
    front = list(ranked.front)
    if len(front) < 2 or ranked.hopeless:
        return None
    best = best_by(dataset, ranked.condition, front, "acceleration_variation", ratio=True)
    if best is None:
        return None
    (calm, *equally_calm), pairs = best
    if equally_calm:
        return None
    others = [law for law in front if law != calm]
    second = max(others, key=lambda law: pairs[calm, law].difference)
    others.remove(second)
    pair = pairs[calm, second]
    scenes = counted(pair.scenes, "scene")
    text = text_of("calmest", calm=calm, second=second, pair=pair, scenes=scenes)
    numbers = {
        "ratio": pair.difference,
        "ratio_low": pair.low,
        "ratio_high": pair.high,
        "ratio_scenes": pair.scenes,
    }
    return Finding(text, "calmest", ranked.condition, (calm, second, *others), numbers)


def violations(dataset: Dataset, condition: str) -> Finding:
    """Return the finding on controllers that violate a row least often, by the strict standard."""
    ranked = kept_ranking(dataset, condition)
    violated = {}
    numbers: dict[str, float] = {"scenes": ranked.scenes}
    for law in named_of(ranked.front):
        share = ranked.shares[law].complement
        violated[law] = share
        numbers |= share.numbers("violation", law=law)
    text = text_of("violations", shares=violated)
    return Finding(text, "violations", condition, tuple(violated), numbers)


def attainable(dataset: Dataset, condition: str) -> Finding | None:
    """Return the finding on how often the baseline reaches the goal, None if nearly always."""
    runs = dataset.evidence.runs
    is_baseline = (runs["controller"] == BASELINE) & (runs["condition"] == condition)
    reached = (runs.loc[is_baseline, "status"] == "converged").to_numpy(bool)
    count = len(reached)
    share = Share.of(rate(reached))
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
        differences = {first: before.differences[a, b], other: after.differences[b, a]}
        shares = {}
        numbers: dict[str, float] = {
            "scenes": before.scenes,
            "families": before.families,
            "pairs": len(sizes),
        }
        for condition, difference in differences.items():
            shares[condition_text(condition, inside=True)] = difference
            numbers |= difference.numbers("difference", law=condition)
        text = text_of("turned", a=a, b=b, shares=shares, ranked=before, more=len(sizes) - 1)
        yield Finding(text, "turned", other, (a, b), numbers)


def _reversal_sizes(before: Ranking, after: Ranking) -> dict[tuple[str, str], float]:
    """Return the smaller difference of each pair that is significantly reversed, by pair."""
    sizes = {}
    in_both = [law for law in before.laws if law in after.laws]
    for a, b in combinations(in_both, 2):
        if not before.significant(a, b) or not after.significant(a, b):
            continue
        gap_before = before.differences[a, b].value
        gap_after = after.differences[b, a].value
        if gap_after > 0.0:
            sizes[a, b] = min(gap_before, gap_after)
    return sizes


def tuning_gain(dataset: Dataset) -> Finding | None:
    """Return the finding on the gain from tuning in the first condition, for each controller."""
    ranked = ranking(dataset, dataset.conditions[0])
    compared = []
    same = []
    better = {}
    worse = {}
    for law, tuned in dataset.tuned.items():
        if law not in ranked.laws or tuned not in ranked.laws:
            continue
        compared.append(law)
        gain = ranked.differences[tuned, law]
        if not ranked.significant(tuned, law):
            same.append(law)
        elif gain.value > 0.0:
            better[law] = gain
        else:
            worse[law] = gain.reversed
    if not compared:
        return None
    numbers = {"scenes": float(ranked.scenes)}
    for law in (*better, *worse):
        gain = ranked.differences[dataset.tuned[law], law]
        numbers |= gain.numbers("difference", law=law)
    text = text_of(
        "tuned",
        condition=condition_text(ranked.condition, inside=True),
        changed={"more successful": better, "less successful": worse},
        same=names_text(same),
        scenes=counted(ranked.scenes, "held-out scene"),
    )
    return Finding(text, "tuned", ranked.condition, tuple(compared), numbers)


def always_failing(dataset: Dataset) -> list[Finding]:
    """Return findings on controllers whose runs all failed or aborted, with the main reason."""
    several = []
    for law in dataset.laws:
        runs = dataset.of_law(law)
        has_failed = runs["status"].isin(["failed", "aborted"])
        if not has_failed.all():
            continue
        reasons = runs["reason"].fillna("").astype(str)
        most_frequent = str(reasons.value_counts().index[0])
        count = counted(len(runs), "run")
        text = text_of("nowhere", law=law, runs=count, why=most_frequent)
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
