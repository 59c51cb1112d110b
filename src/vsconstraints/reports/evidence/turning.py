"""Sentences on several conditions: where the order turns over, what tuning is worth, who never gets anywhere."""

from __future__ import annotations

from ...rows.readable import counted
from ..markdown import bold, enumeration, plain
from .material import Material
from .sentence import Sentence
from .standing import Standing, standing
from .words import first_of, of_scenes, within


def turned(material: Material) -> list[Sentence]:
    """Where a condition turns the order of two laws over, sure on both sides and in the same families."""
    found = []
    for other in material.conditions[1:]:
        sentence = _turned(material, material.conditions[0], other)
        if sentence is not None:
            found.append(sentence)
    return found


def _turned(material: Material, first: str, other: str) -> Sentence | None:
    common = [name for name in material.families_of(first) if name in material.families_of(other)]
    before, after = (standing(material, condition, families=common) for condition in (first, other))
    turns = {
        (a, b): min(pair.difference.value, -after.pair(a, b).difference.value)
        for (a, b), pair in before.pairs.items()
        if pair.distinguishable and {a, b} <= set(after.laws) and _behind(after, a, b)
    }
    if not turns:
        return None
    a, b = max(turns, key=lambda names: turns[names])
    ahead, then = before.pair(a, b).difference, after.pair(b, a).difference
    more = f"; so does that of {counted(len(turns) - 1, 'more pair')}" if len(turns) > 1 else ""
    text = (
        f"By the strict standard, the order turns over: {within(first)}, {a} succeeds more often than {b} by "
        f"{ahead.text()}; {within(other)}, {b} more often than {a} by {then.text()} "
        f"({of_scenes(before.scenes, before.families)}){more}."
    )
    numbers: dict[str, float] = {"scenes": before.scenes, "families": before.families, "pairs": len(turns)}
    for condition, share in ((first, ahead), (other, then)):
        numbers |= share.numbers(f"difference[{condition}]", f"low[{condition}]", f"high[{condition}]")
    return Sentence(text, "turned", other, (a, b), numbers)


def _behind(after: Standing, a: str, b: str) -> bool:
    pair = after.pair(a, b)
    return pair.distinguishable and pair.difference.value < 0.0


def gained(material: Material) -> Sentence | None:
    """What tuning is worth in the first condition, law by law."""
    if not material.tuned:
        return None
    condition = material.conditions[0]
    one = standing(material, condition)
    pairs = {law: one.pair(name, law) for law, name in material.tuned.items() if {law, name} <= set(one.laws)}
    told = {law: pair for law, pair in pairs.items() if pair.distinguishable}
    better = {law: pair.difference for law, pair in told.items() if pair.difference.value > 0.0}
    worse = {law: pair.reversed().difference for law, pair in told.items() if pair.difference.value < 0.0}
    alike = [law for law in pairs if law not in told]
    parts, numbers = [], {"scenes": float(one.scenes)}
    for does, laws in (("succeed more often", better), ("succeed less often", worse)):
        if laws:
            of = [f"{law} by {share.text()}" for law, share in laws.items()]
            parts.append(f"{does}: {enumeration(of)}")
        for law in laws:
            numbers |= told[law].difference.numbers("difference", law=law)
    if alike:
        named, more = first_of(alike)
        parts.append(f"not distinguishable from the settings it comes with: {enumeration([*named, *more])}")
    if not parts:
        return None
    text = (
        f"Tuned on training scenes, {within(condition)} and by the strict standard, {'; '.join(parts)} "
        f"({counted(one.scenes, 'held-out scene')})."
    )
    return Sentence(text, "tuned", condition, tuple(pairs), numbers)


def nowhere(material: Material) -> list[Sentence]:
    """Laws all of whose runs failed or were aborted, with the commonest reason."""
    found = []
    for law in material.laws:
        runs = material.runs[material.runs["controller"] == law]
        if runs["status"].isin(["failed", "aborted"]).all():
            reasons = runs["reason"].fillna("").astype(str).value_counts()
            why = f", most often: {plain(str(reasons.index[0]))}" if reasons.index[0] else ""
            text = f"{bold(law)} gets nowhere: each of its {counted(len(runs), 'run')} failed or was aborted{why}."
            found.append(Sentence(text, "nowhere", "", (law,), {"runs": len(runs)}, ""))
    return found
