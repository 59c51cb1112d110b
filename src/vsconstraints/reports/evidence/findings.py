"""The findings of the report of evidence: each a claim with the unrounded numbers it rests on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from ...comparisons.metrics import NEGLIGIBLE, TOLERANT
from ...comparisons.runs.spec import BASELINE
from ...comparisons.statistics import rate
from ...controllers.demand import USES
from ...rows.readable import counted
from ..markdown import bold, enumeration, plain
from ..numbers import number, of_length
from .dataset import Dataset
from .formatting import Share, condition_text, first_names, names_text, percentage, scenes_text
from .ranking import Ranking, best_by, ranking

INFORMATION: tuple[tuple[str, str], ...] = ((USES["Lf"], USES["Lf"]), ("model", "a model"))
"""What may not be available: as controllers state it, and in words."""

MIN_REACHED = 0.9
"""Where tracking alone reaches the goal less often than this, it is reported."""


@dataclass(frozen=True)
class Finding:
    """A claim of the report.

    Attributes
    ----------
    text
        As it stands in the report.
    about
        What kind of claim it is.
    condition
        In which condition; empty where it is about several.
    laws
        The controllers it is about, those it names first and in its order.
    numbers
        Every number that the text shows, unrounded, shares as such and not in per cent. Those of a controller carry
        its name, as in ``success[sliding-mode]``.
    standard
        By which standard rows are violated in it, ``strict`` or ``tolerant``; empty where it is not about violations.
    """

    text: str
    about: str
    condition: str = ""
    laws: tuple[str, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
    standard: str = "strict"

    def as_data(self) -> dict[str, Any]:
        """For files."""
        return asdict(self)


def findings(dataset: Dataset) -> dict[str, list[Finding]]:
    """The findings on each condition, in their order."""
    by_condition = {}
    for condition in dataset.conditions:
        ranked = ranking(dataset, condition)
        if ranked.scenes:
            several = [
                best(ranked),
                *without_information(dataset, ranked),
                calmest(dataset, ranked),
                tolerant(dataset, ranked),
                violations(dataset, condition),
                attainable(dataset, condition),
            ]
            by_condition[condition] = [finding for finding in several if finding is not None]
    return by_condition


def best(ranked: Ranking, begin: str = "") -> Finding:
    """Which controllers succeed most often in a condition, and the best that does significantly less often."""
    begin = begin or condition_text(ranked.condition)
    scenes, leader, follower = scenes_text(ranked.scenes, ranked.families), ranked.leader, ranked.next
    share = ranked.shares[leader]
    if share.value == 0.0:
        most = percentage(share.high, share.digits)
        text = f"{begin}: no controller succeeds in any of {scenes} (with 95 % confidence, in at most {most} % each)."
        return Finding(text, "best", ranked.condition, (leader,), numbers_of(ranked, [leader]))
    if len(ranked.laws) == 1:
        text = f"{begin}: {bold(leader)} succeeds in {share.text}; {scenes}."
        return Finding(text, "best", ranked.condition, (leader,), numbers_of(ranked, [leader]))
    named, front = _front(ranked)
    if follower is None:
        what = "too few scenes to rank controllers" if ranked.too_few else "no significant difference to the best"
        text = f"{begin}: {what} ({scenes}): {front}."
        return Finding(text, "alike", ranked.condition, tuple(named), numbers_of(ranked, named))
    difference = ranked.pair(leader, follower).difference.text
    lead = "most successful" if len(ranked.front) == 1 else "most successful, without significant difference"
    text = (
        f"{begin}: {lead}: {front}; next: {follower} {ranked.shares[follower].text}, {difference} less than {leader} "
        f"({scenes})."
    )
    numbers = numbers_of(ranked, [*named, follower], (leader, follower))
    return Finding(text, "best", ranked.condition, (*named, follower), numbers)


def tolerant(dataset: Dataset, strict: Ranking) -> Finding:
    """The same as :func:`best` by the tolerant standard, and whether other controllers are in front by it."""
    ranked = ranking(dataset, strict.condition, "tolerant success")
    same = set(ranked.front) == set(strict.front)
    begin = f"With {of_length(TOLERANT)} tolerated{'' if same else ', others are best'}"
    return replace(best(ranked, begin), about="tolerant", standard="tolerant")


def without_information(dataset: Dataset, ranked: Ranking) -> list[Finding]:
    """The best of the controllers that do without some information, such as L_fφ."""
    if ranked.shares[ranked.leader].value == 0.0 or ranked.next is None:
        return []
    known = {law: required for law in ranked.laws if (required := dataset.required[law]) is not None}
    several = []
    for what, words in INFORMATION:
        spare = [law for law, required in known.items() if what not in required]
        # that those in front need no model goes without saying
        relevant = what == INFORMATION[0][0] or not any(law in spare for law in ranked.front)
        if spare and len(spare) < len(known) and relevant:
            several.append(_best_without(ranked, spare, f"without {what}", words))
    return several


def _best_without(ranked: Ranking, spare: Sequence[str], about: str, words: str) -> Finding:
    in_front = [law for law in ranked.front if law in spare]
    if in_front:
        text = f"Of these, {words} is not required by {names_text(in_front)}."
        return Finding(text, about, ranked.condition, tuple(first_names(in_front)[0]))
    own = ranked.among(spare)
    named, front = _front(own)
    difference = ranked.pair(ranked.leader, own.leader).difference.text
    tied = "" if len(own.front) == 1 else ", without significant difference"
    text = f"Best without {words}{tied}: {front}; {own.leader} {difference} less than {ranked.leader}."
    numbers = numbers_of(ranked, named, (ranked.leader, own.leader))
    return Finding(text, about, ranked.condition, (*named, ranked.leader), numbers)


def calmest(dataset: Dataset, ranked: Ranking) -> Finding | None:
    """Of several controllers in front, the one with significantly the lowest command variation."""
    front = list(ranked.front)
    if len(front) < 2 or ranked.shares[ranked.leader].value == 0.0:
        return None
    best = best_by(dataset, ranked.condition, front, "acceleration_variation", ratio=True)
    if best is None or len(best.laws) > 1:
        return None
    (calm,) = best.laws
    second = max((law for law in front if law != calm), key=lambda law: best.pairs[calm, law].difference)
    pair = best.pairs[calm, second]
    text = (
        f"Lowest command variation of these: {bold(calm)}, {number(pair.difference)} times "
        f"({number(pair.low)}–{number(pair.high)}) that of {second}, the next (median over "
        f"{counted(pair.scenes, 'scene')} in which all of these succeed)."
    )
    numbers = {"ratio": pair.difference, "ratio_low": pair.low, "ratio_high": pair.high, "ratio_scenes": pair.scenes}
    others = tuple(law for law in front if law not in (calm, second))
    return Finding(text, "calmest", ranked.condition, (calm, second, *others), numbers)


def violations(dataset: Dataset, condition: str) -> Finding:
    """Which controllers violate a row least often, by the strict standard, and whether so by the tolerant one."""
    ranked = ranking(dataset, condition, "kept").among(dataset.working(condition))
    violated = {law: share.complement for law, share in ranked.shares.items()}
    named, more = first_names(ranked.front)
    front = enumeration([*(f"{bold(law)} {violated[law].text}" for law in named), *more])
    numbers: dict[str, float] = {"scenes": ranked.scenes}
    for law in named:
        numbers |= violated[law].numbers("violation", law=law)
    tied = len(ranked.laws) > 1 and ranked.next is None
    text = f"Violations by more than {of_length(NEGLIGIBLE)} {'do not differ significantly' if tied else 'are rarest'}"
    text = f"{text}: {front}."
    other = ranking(dataset, condition, "tolerant kept").among(ranked.laws)
    if set(other.front) != set(ranked.front):
        text += f" By more than {of_length(TOLERANT)}: {names_text(other.front)}."
    return Finding(text, "violations", condition, tuple(named), numbers)


def attainable(dataset: Dataset, condition: str) -> Finding | None:
    """How often tracking alone reaches the goal, where that is not nearly always."""
    runs = dataset.evidence.runs
    own = runs[(runs["controller"] == BASELINE) & (runs["condition"] == condition)]
    share = Share.of(rate((own["status"] == "converged").to_numpy(bool)))
    if not len(own) or share.value >= MIN_REACHED:
        return None
    text = (
        f"Unconstrained tracking reaches the goal in only {share.text} of {counted(len(own), 'scene')}: elsewhere no "
        "constraint is the obstacle, and violations say more than success."
    )
    return Finding(text, "attainable", condition, (), {**share.numbers("reached"), "scenes": len(own)}, "")


def reversals(dataset: Dataset) -> list[Finding]:
    """For each further condition the greatest rank reversal, significant in both conditions on the same families."""
    first, *others = dataset.conditions or ("",)
    return [finding for other in others if (finding := _reversal(dataset, first, other)) is not None]


def _reversal(dataset: Dataset, first: str, other: str) -> Finding | None:
    common = [name for name in dataset.families_of(first) if name in dataset.families_of(other)]
    before, after = (ranking(dataset, condition, families=common) for condition in (first, other))
    sizes = {
        (a, b): min(pair.difference.value, -after.pair(a, b).difference.value)
        for (a, b), pair in before.pairs.items()
        if pair.distinguishable and {a, b} <= set(after.laws) and _behind(after, a, b)
    }
    if not sizes:
        return None
    a, b = max(sizes, key=lambda names: sizes[names])
    ahead, then = before.pair(a, b).difference, after.pair(b, a).difference
    more = f"; {counted(len(sizes) - 1, 'more pair')}" if len(sizes) > 1 else ""
    text = (
        f"Rank reversal: {condition_text(first, inside=True)}, {a} succeeds more often than {b} by {ahead.text}; "
        f"{condition_text(other, inside=True)}, {b} more often than {a} by {then.text} "
        f"({scenes_text(before.scenes, before.families)}){more}."
    )
    numbers: dict[str, float] = {"scenes": before.scenes, "families": before.families, "pairs": len(sizes)}
    for condition, share in ((first, ahead), (other, then)):
        numbers |= share.numbers(f"difference[{condition}]", f"low[{condition}]", f"high[{condition}]")
    return Finding(text, "turned", other, (a, b), numbers)


def _behind(after: Ranking, a: str, b: str) -> bool:
    pair = after.pair(a, b)
    return pair.distinguishable and pair.difference.value < 0.0


def tuning_gain(dataset: Dataset) -> Finding | None:
    """What tuning is worth in the first condition, controller by controller."""
    if not dataset.tuned:
        return None
    condition = dataset.conditions[0]
    ranked = ranking(dataset, condition)
    pairs = {law: ranked.pair(name, law) for law, name in dataset.tuned.items() if {law, name} <= set(ranked.laws)}
    significant = {law: pair for law, pair in pairs.items() if pair.distinguishable}
    if not pairs:
        return None
    better = {law: pair.difference for law, pair in significant.items() if pair.difference.value > 0.0}
    worse = {law: pair.reversed().difference for law, pair in significant.items() if pair.difference.value < 0.0}
    parts, numbers = [], {"scenes": float(ranked.scenes)}
    for how, laws in (("more successful", better), ("less successful", worse)):
        if laws:
            parts.append(f"{how}: {enumeration([f'{law} by {share.text}' for law, share in laws.items()])}")
        for law in laws:
            numbers |= significant[law].difference.numbers("difference", law=law)
    unchanged = [law for law in pairs if law not in significant]
    if unchanged:
        parts.append(f"no significant difference: {names_text(unchanged)}")
    held_out = counted(ranked.scenes, "held-out scene")
    text = f"Tuning, {condition_text(condition, inside=True)}: {'; '.join(parts)} ({held_out})."
    return Finding(text, "tuned", condition, tuple(pairs), numbers)


def always_failing(dataset: Dataset) -> list[Finding]:
    """Controllers all of whose runs failed or were aborted, with the most frequent reason."""
    several = []
    for law in dataset.laws:
        runs = dataset.runs[dataset.runs["controller"] == law]
        if runs["status"].isin(["failed", "aborted"]).all():
            reasons = runs["reason"].fillna("").astype(str).value_counts()
            why = f", most often: {plain(str(reasons.index[0]))}" if reasons.index[0] else ""
            text = f"{bold(law)} failed or was aborted in each of its {counted(len(runs), 'run')}{why}."
            several.append(Finding(text, "nowhere", "", (law,), {"runs": len(runs)}, ""))
    return several


def _front(ranked: Ranking) -> tuple[list[str], str]:
    """Controllers in front that a sentence names, and how."""
    named, more = first_names(ranked.front)
    return named, enumeration([*(f"{bold(law)} {ranked.shares[law].text}" for law in named), *more])


def numbers_of(ranked: Ranking, laws: Sequence[str], pair: tuple[str, str] | None = None) -> dict[str, float]:
    """The numbers of a finding on these controllers, and on the difference of two of them."""
    numbers: dict[str, float] = {"scenes": ranked.scenes, "families": ranked.families}
    for law in laws:
        numbers |= ranked.shares[law].numbers("success", law=law)
    if pair is not None:
        numbers |= ranked.pair(*pair).difference.numbers("difference", "difference_low", "difference_high")
    return numbers
