"""The first screen: the question, the answers, one figure and one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...comparisons.metrics import NEGLIGIBLE
from ...rows.readable import counted
from ..markdown import bold, bullets, plain, table
from ..numbers import DASH, median, number, of_length
from .answers import answers
from .drawing import shown
from .figures import SUCCESS
from .holding import held
from .material import Material
from .sentence import Sentence
from .standing import Standing, standing
from .turning import gained, nowhere, turned
from .words import of_scenes, within

MOST_COLUMNS = 7


@dataclass(frozen=True)
class Opening:
    """The first screen, and the numbers in it.

    Attributes
    ----------
    text
        Markdown.
    sentences
        All claims, in their order.
    table
        The numbers of the table's lines, unrounded.
    """

    text: str
    sentences: tuple[Sentence, ...] = ()
    table: tuple[dict[str, Any], ...] = ()

    def as_data(self) -> dict[str, Any]:
        """For files: what is no number is None."""
        lines = [{name: None if value != value else value for name, value in line.items()} for line in self.table]
        return {"sentences": [one.as_data() for one in self.sentences], "table": lines}


def opening(material: Material) -> Opening:
    """Title, question, answers, figure and table."""
    title = plain(str(material.configuration.get("title") or "Evidence"))
    question = plain(str(material.configuration.get("question") or ""))
    parts = [f"# {title}", *([f"**{question}**"] if question else [])]
    by_condition = answers(material)
    parts.append(_what(material, whole=bool(by_condition)))
    if not by_condition:
        parts.append("There is nothing to compare: no law but tracking alone has a run.")
        return Opening("\n\n".join(parts))
    gain = gained(material)
    others = [*turned(material), *held(material), *([gain] if gain else []), *nowhere(material)]
    lines = [" ".join(one.text for one in own) for own in by_condition.values()]
    parts.append(bullets([*lines, *(one.text for one in others)]))
    standings = [standing(material, condition) for condition in by_condition]
    laws = [*standings[0].laws, *(law for law in material.laws if law not in standings[0].laws)]
    numbers = [_numbers(material, standings, law) for law in laws]
    parts += [shown(material, SUCCESS, standings, material.laws), _table(material, standings, numbers)]
    every = [one for own in by_condition.values() for one in own] + others
    return Opening("\n\n".join(part for part in parts if part), tuple(every), tuple(numbers))


def _what(material: Material, whole: bool) -> str:
    scenes = material.evidence.scenes
    found = int(scenes["found"].sum())
    kinds = f"{counted(len(material.laws), 'law')}, {counted(len(material.conditions), 'condition')}"
    where_laws_fail = "[Where each law fails](#where-each-law-fails) is below; " if whole else ""
    return (
        f"{of_scenes(found, len(material.families))} {'was' if found == 1 else 'were'} drawn at random, with rows that "
        f"tracking alone would leave, and run with every law ({kinds}): the same robot, camera, task, rows and "
        "disturbances for all. In parentheses are 95 % intervals; laws are told apart only where a test on "
        f"the same scenes does. {where_laws_fail}[what words mean](#what-words-mean) and "
        "[limitations](#known-limitations) are at the end."
    )


def _numbers(material: Material, standings: Sequence[Standing], law: str) -> dict[str, Any]:
    """What the table says of a law."""
    runs = material.runs[material.runs["controller"] == law]
    clean = runs[(runs["condition"] == material.conditions[0]) & runs["success"]]
    return {
        "law": law,
        **{one.condition: one.shares[law].value for one in standings if law in one.laws},
        "variation": median(clean["acceleration_variation"].astype(float).tolist()),
        "call": median(runs["step_time_median_us"].astype(float).tolist()),
    }


def _table(material: Material, standings: Sequence[Standing], numbers: Sequence[dict[str, Any]]) -> str:
    """One line per law, those in front in the first condition on top; seven columns at most."""
    laws = [str(line["law"]) for line in numbers]
    conditions = standings[: MOST_COLUMNS - 2]
    room = MOST_COLUMNS - 2 - len(conditions)
    columns = {"law": laws}
    if room >= 1:
        columns["uses"] = [told_uses(material, law) for law in laws]
    for one in conditions:
        columns[f"{within(one.condition)} [%]"] = success_cells(one, laws)
    if room >= 2:
        columns["variation [rad/s³]"] = [number(line["variation"]) for line in numbers]
    columns["call [µs]"] = [number(line["call"]) for line in numbers]
    lines = [list(line) for line in zip(*columns.values(), strict=True)]
    return "\n\n".join((table(list(columns), lines, 2 if room >= 1 else 1), _legend(room)))


def told_uses(material: Material, law: str) -> str:
    """What a law uses, for a table's cell."""
    used = material.uses[law]
    return "said by its code" if used is None else plain(", ".join(used)) or "rows and task"


def success_cells(one: Standing, laws: Sequence[str]) -> list[str]:
    """How often each law succeeds: bold if it is the best alone, ≈ if it is not distinguishable from the best."""
    return [_marked(one, law, one.shares[law].cell) if law in one.laws else DASH for law in laws]


def _marked(one: Standing, law: str, text: str) -> str:
    if len(one.laws) < 2 or law not in one.front or one.shares[one.leader].value == 0.0:
        return text
    return bold(text) if len(one.front) == 1 else f"≈ {text}"


def _legend(room: int) -> str:
    text = (
        f"Success: no row violated by more than {of_length(NEGLIGIBLE)} and the goal reached, in per cent of the "
        "scenes. **Bold**: the best, and distinguishable from all others; ≈: the best, or not distinguishable from it."
    )
    if room >= 2:
        text += " *Variation*: median of Σ‖Δq̈‖ per second over successes of the first condition."
    return f"{text} *Call*: median time of the law itself."
