"""The answers of the first screen: sentences that are computed from the evidence, and none that it does not bear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...comparisons.metrics import NEGLIGIBLE, TOLERANT
from ...comparisons.runs.spec import BASELINE
from ...comparisons.statistics import rate
from ...controllers.demands import USES
from ...rows.readable import counted
from ..markdown import bold, enumeration
from ..numbers import number, of_length
from .decisions import best_by
from .material import Material
from .sentence import Sentence
from .standing import Standing, standing
from .words import Share, first_of, of_scenes, percentage, where

DOES = f"keeps all rows to {of_length(NEGLIGIBLE)} and reaches the goal"
DO = DOES.replace("keeps", "keep").replace("reaches", "reach")

SPARED: tuple[tuple[str, str], ...] = ((USES["Lf"], USES["Lf"]), ("model", "a model"))
"""What a reader may not have: as laws say it, and in words."""

ATTAINABLE = 0.9
"""Where tracking alone reaches the goal less often than this, it is said."""


def answers(material: Material) -> dict[str, list[Sentence]]:
    """The sentences on each condition, in their order."""
    found = {}
    for condition in material.conditions:
        one = standing(material, condition)
        if one.scenes:
            several = [
                best(one),
                *sparing(material, one),
                calmest(material, one),
                tolerant(material, one),
                violations(material, condition),
                attainable(material, condition),
            ]
            found[condition] = [sentence for sentence in several if sentence is not None]
    return found


def tolerant(material: Material, strict: Standing) -> Sentence:
    """The same as :func:`best` by the tolerant standard, and whether other laws are in front by it."""
    one = standing(material, strict.condition, "tolerant success")
    same = set(one.front) == set(strict.front)
    begin = f"With {of_length(TOLERANT)} tolerated"
    begin = begin if same else f"The standards disagree on the best: {begin[0].lower()}{begin[1:]}"
    return replace(best(one, begin, "succeeds", "succeed"), about="tolerant", standard="tolerant")


def best(one: Standing, begin: str = "", does: str = DOES, do: str = DO) -> Sentence:
    """Which law succeeds most often in a condition, and which cannot be told from it."""
    begin = begin or where(one.condition)
    scenes, leader, follower = of_scenes(one.scenes, one.families), one.leader, one.next
    share = one.shares[leader]
    if share.value == 0.0:
        whoever = "no law" if len(one.laws) > 1 else bold(leader)
        how = f"{does} in none of {scenes}" if len(one.laws) == 1 else f"{does} in any of {scenes}"
        most = percentage(share.high, share.digits)
        each = "each" if len(one.laws) > 1 else "it"
        text = f"{begin}, {whoever} {how}: with 95 % confidence {each} would in at most {most} %."
        return Sentence(text, "best", one.condition, (leader,), numbers_of(one, [leader]))
    if len(one.laws) == 1:
        text = f"{begin}, {bold(leader)} {does} in {share.text(scenes)}."
        return Sentence(text, "best", one.condition, (leader,), numbers_of(one, [leader]))
    named, told = _in_front(one)
    if follower is None:
        alike = "are too few to tell laws apart" if one.too_few else "tell no law from the best"
        text = f"{begin}, {scenes} {alike}: {told} {do}."
        return Sentence(text, "alike", one.condition, tuple(named), numbers_of(one, named))
    next_one, difference = one.shares[follower].text(), one.pair(leader, follower).difference.text()
    if len(one.front) == 1:
        text = f"{bold(leader)} {does} in {share.text(scenes)}; the next, {follower}, in {next_one}"
        text = f"{begin}, {text}; the difference is {difference}."
    else:
        text = f"{told} {do} most often and are not distinguishable ({scenes}); the next, {follower}, does so in"
        text = f"{begin}, {text} {next_one}, {difference} less than {leader}."
    numbers = numbers_of(one, [*named, follower], (leader, follower))
    return Sentence(text, "best", one.condition, (*named, follower), numbers)


def sparing(material: Material, one: Standing) -> list[Sentence]:
    """What is to be had without something that not everybody has, such as L_fφ."""
    if one.shares[one.leader].value == 0.0 or one.next is None:
        return []
    found = []
    known = {law: used for law in one.laws if (used := material.uses[law]) is not None}
    for what, words in SPARED:
        spare = [law for law, used in known.items() if what not in used]
        # that laws in front need no model goes without saying
        worth_saying = what == SPARED[0][0] or not any(law in spare for law in one.front)
        if spare and len(spare) < len(known) and worth_saying:
            found.append(_without(one, spare, f"without {what}", words))
    return found


def _without(one: Standing, spare: Sequence[str], about: str, words: str) -> Sentence:
    """The best of the laws that do without something: in front of all, or by how much behind."""
    in_front = [law for law in one.front if law in spare]
    if in_front:
        named, more = first_of(in_front)
        which = f"Of these, {enumeration([*named, *more])} {'does' if len(in_front) == 1 else 'do'} not use"
        which = "None of these uses" if len(in_front) == len(one.front) else which
        which = "It does not use" if len(one.front) == 1 else which
        return Sentence(f"{which} {words}.", about, one.condition, tuple(named))
    own = one.among(spare)
    named, told = _in_front(own)
    difference = one.pair(one.leader, own.leader).difference.text()
    if len(own.front) == 1:
        text = f"Of the laws that do not use {words}, {told} does so most often, {difference} less than {one.leader}."
    else:
        text = f"Of the laws that do not use {words}, {told} do so most often and are not distinguishable"
        text = f"{text}; {own.leader} does in {difference} less than {one.leader}."
    numbers = numbers_of(one, named, (one.leader, own.leader))
    return Sentence(text, about, one.condition, (*named, one.leader), numbers)


def calmest(material: Material, one: Standing) -> Sentence | None:
    """Of several laws in front, the one whose command varies least, where that is sure."""
    front = list(one.front)
    if len(front) < 2 or one.shares[one.leader].value == 0.0:
        return None
    best = best_by(material, one.condition, front, "acceleration_variation", ratio=True)
    if best is None or len(best.laws) > 1:
        return None
    (calm,) = best.laws
    second = max((law for law in front if law != calm), key=lambda law: best.pairs[calm, law].difference)
    pair = best.pairs[calm, second]
    text = (
        f"Of these, {bold(calm)} has the calmest command: its acceleration varies {number(pair.difference)} times "
        f"({number(pair.low)}–{number(pair.high)}) as much as that of {second}, the next (median of "
        f"{counted(pair.scenes, 'scene')} in which all of them succeed)."
    )
    numbers = {"ratio": pair.difference, "ratio_low": pair.low, "ratio_high": pair.high, "ratio_scenes": pair.scenes}
    others = tuple(law for law in front if law not in (calm, second))
    return Sentence(text, "calmest", one.condition, (calm, second, *others), numbers)


def violations(material: Material, condition: str) -> Sentence:
    """Which law violates a row least often in a condition, by the strict standard, and whether so by the tolerant."""
    one = standing(material, condition, "kept").among(material.going(condition))
    left = {law: share.complement for law, share in one.shares.items()}
    named, more = first_of(one.front)
    told = enumeration([*(f"{bold(law)} ({left[law].percent} %, {left[law].interval} %)" for law in named), *more])
    numbers: dict[str, float] = {"scenes": one.scenes}
    for law in named:
        numbers |= left[law].numbers("violation", law=law)
    if len(one.laws) == 1:
        text = f"It violates a row by more than {of_length(NEGLIGIBLE)} in {left[one.leader].text()}."
    elif one.next is None:
        text = f"How often a row is violated by more than {of_length(NEGLIGIBLE)} tells no law from the best: {told}."
    else:
        alike = ", which are not distinguishable" if len(one.front) > 1 else ""
        text = f"A row is violated by more than {of_length(NEGLIGIBLE)} least often by {told}{alike}."
    other = standing(material, condition, "tolerant kept").among(one.laws)
    if set(other.front) != set(one.front):
        named_there, more_there = first_of(other.front)
        text += f" By more than {of_length(TOLERANT)} it is so by {enumeration([*named_there, *more_there])}."
    return Sentence(text, "violations", condition, tuple(named), numbers)


def attainable(material: Material, condition: str) -> Sentence | None:
    """How often tracking alone reaches the goal, where that is not nearly always: then it is not rows that hinder."""
    runs = material.evidence.runs
    own = runs[(runs["controller"] == BASELINE) & (runs["condition"] == condition)]
    share = Share.of(rate((own["status"] == "converged").to_numpy(bool)))
    if not len(own) or share.value >= ATTAINABLE:
        return None
    text = (
        f"Tracking alone, which knows no rows, reaches the goal in {share.text(counted(len(own), 'scene'))}: where it "
        "does not, it is no row that keeps a law from the goal, and violations say more than success."
    )
    return Sentence(text, "attainable", condition, (), {**share.numbers("reached"), "scenes": len(own)}, "")


def _in_front(one: Standing) -> tuple[list[str], str]:
    """Laws in front that a sentence names, and how it does."""
    named, more = first_of(one.front)
    shares = [f"{bold(law)} ({one.shares[law].percent} %, {one.shares[law].interval} %)" for law in named]
    return named, enumeration([*shares, *more])


def numbers_of(one: Standing, laws: Sequence[str], pair: tuple[str, str] | None = None) -> dict[str, float]:
    """What a sentence on these laws shows, and on the difference of two of them."""
    numbers: dict[str, float] = {"scenes": one.scenes, "families": one.families}
    for law in laws:
        numbers |= one.shares[law].numbers("success", law=law)
    if pair is not None:
        numbers |= one.pair(*pair).difference.numbers("difference", "difference_low", "difference_high")
    return numbers
