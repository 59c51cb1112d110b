"""The first screen: the question, the answers, one figure and one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..markdown import bold, bullets, plain, table
from ..numbers import DASH, median, number
from .answers import answers
from .drawing import shown
from .figures.success import SUCCESS
from .material import Material
from .sentence import Sentence
from .standing import Standing, standing
from .turning import gained, nowhere, turned
from .words import count, of_scenes, where

MOST_COLUMNS = 7


@dataclass(frozen=True)
class Opening:
    """The first screen, and the sentences that it makes.

    Attributes
    ----------
    text
        Markdown.
    sentences
        All claims, in their order.
    """

    text: str
    sentences: tuple[Sentence, ...]


def opening(material: Material) -> Opening:
    """Title, question, answers, figure and table."""
    title = plain(str(material.configuration.get("title") or "Evidence"))
    question = plain(str(material.configuration.get("question") or ""))
    parts = [f"# {title}", *([f"**{question}**"] if question else []), _what(material)]
    by_condition = answers(material)
    if not by_condition:
        parts.append("There is nothing to compare: no law but tracking alone has a run.")
        return Opening("\n\n".join(parts), ())
    gain = gained(material)
    others = [*turned(material), *([gain] if gain else []), *nowhere(material)]
    lines = [" ".join(one.text for one in own) for own in by_condition.values()]
    parts.append(bullets([*lines, *(one.text for one in others)]))
    standings = [standing(material, condition) for condition in by_condition]
    parts.append(shown(material, SUCCESS, standings, material.laws))
    parts.append(overview(material, standings))
    every = [one for own in by_condition.values() for one in own] + others
    return Opening("\n\n".join(part for part in parts if part), tuple(every))


def _what(material: Material) -> str:
    scenes = material.evidence.scenes
    found = int(scenes["found"].sum())
    kinds = f"{count(len(material.laws), 'law')}, {count(len(material.conditions), 'condition')}"
    return (
        f"{of_scenes(found, len(material.families))} {'was' if found == 1 else 'were'} drawn at random, with rows that "
        f"tracking alone would leave, and run with every law ({kinds}): the same robot, camera, task, rows and "
        "disturbances for all. In parentheses are 95 % intervals; laws are told apart only where a test on "
        "the same scenes does. [What words mean](#what-words-mean), [limitations](#known-limitations) and where each "
        "law [fails](#where-each-law-fails) are below."
    )


def overview(material: Material, standings: Sequence[Standing]) -> str:
    """One line per law, those in front in the first condition on top; seven columns at most."""
    first = standings[0].laws
    laws = [*first, *(law for law in material.laws if law not in first)]
    header, cells = ["law"], [[law] for law in laws]
    room = MOST_COLUMNS - 2 - len(standings)
    columns: list[tuple[str, list[str]]] = []
    if room >= 1:
        columns.append(("uses", [_uses(material, law) for law in laws]))
    for one in standings[: MOST_COLUMNS - 2]:
        columns.append((f"{where(one.condition).lower()} [%]", success_cells(one, laws)))
    if room >= 2:
        columns.append(("variation [rad/s³]", [_variation(material, law) for law in laws]))
    columns.append(("call [µs]", [_call(material, law) for law in laws]))
    for name, texts in columns:
        header.append(name)
        for line, text in zip(cells, texts, strict=True):
            line.append(text)
    return "\n\n".join((table(header, cells, 2 if room >= 1 else 1), _legend(room)))


def success_cells(one: Standing, laws: Sequence[str]) -> list[str]:
    """How often each law succeeds: bold if it is the best alone, ≈ if it is not distinguishable from the best."""
    return [_marked(one, law, one.shares[law].cell) if law in one.laws else DASH for law in laws]


def _marked(one: Standing, law: str, text: str) -> str:
    if len(one.laws) < 2 or law not in one.front or one.shares[one.leader].value == 0.0:
        return text
    return bold(text) if len(one.front) == 1 else f"≈ {text}"


def _legend(room: int) -> str:
    text = (
        "Success: all rows kept and the goal reached, in per cent of the scenes. **Bold**: the best, and "
        "distinguishable from all others; ≈: the best, or not distinguishable from it."
    )
    if room >= 2:
        text += " *Variation*: median of Σ‖Δq̈‖ per second over successes of the first condition."
    return f"{text} *Call*: median time of the law itself."


def _uses(material: Material, law: str) -> str:
    used = material.uses[law]
    return "said by its code" if used is None else plain(", ".join(used)) or "no more"


def _variation(material: Material, law: str) -> str:
    runs = material.among(material.conditions[0])
    own = runs[(runs["controller"] == law) & runs["success"]]
    return number(median(own["acceleration_variation"].astype(float).tolist()))


def _call(material: Material, law: str) -> str:
    own = material.runs[material.runs["controller"] == law]
    return number(median(own["step_time_median_us"].astype(float).tolist()))
