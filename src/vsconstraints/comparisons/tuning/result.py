"""What a tuning found of each law."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..runs.files import replaced, storing
from .objectives import OBJECTIVES, Judged, choose, front, hypervolume
from .problem import Problem
from .search import Options, Searched


@dataclass(frozen=True)
class Asked:
    """An evaluation as it is asked for.

    Attributes
    ----------
    law
        Whose.
    seed, number
        Of the tuner, and the how manieth it is there; 0 is the default.
    options
        The setting.
    """

    law: Searched
    seed: int
    number: int
    options: Options


@dataclass(frozen=True)
class Evaluation:
    """What was asked for and what it is worth.

    Attributes
    ----------
    asked, judged
        The one and the other.
    feasible
        Whether it violates no more than is allowed.
    on_front
        Whether no feasible evaluation of this law is better, of all tuner seeds.
    """

    asked: Asked
    judged: Judged
    feasible: bool
    on_front: bool = False


@dataclass(frozen=True)
class Tuned:
    """A law with all its evaluations.

    Attributes
    ----------
    law
        As the campaign gives it.
    evaluations
        Of all tuner seeds, one after the other; the first is the default.
    hypervolumes
        Of each tuner seed's feasible evaluations, to :data:`vsconstraints.comparisons.tuning.objectives.REFERENCE`.
    chosen
        The setting that is taken over: of the feasible ones by :func:`.choose`, and where
        there is none, of those that violate least (Deb 2000). None if nothing is searched.
    """

    law: Searched
    evaluations: tuple[Evaluation, ...]
    hypervolumes: tuple[float, ...]
    chosen: Evaluation | None

    @property
    def default(self) -> Evaluation:
        """The law as the campaign gives it."""
        return self.evaluations[0]

    @classmethod
    def of(cls, law: Searched, found: Iterable[tuple[Asked, Judged]], allowed: float) -> Tuned:
        """A law's evaluations, judged by the share of violations that is allowed."""
        ordered = sorted(found, key=lambda one: (one[0].seed, one[0].number))
        feasible = [(asked, judged) for asked, judged in ordered if judged.violations <= allowed]
        not_beaten = front([judged.point for _, judged in feasible])
        on_front = {(feasible[i][0].seed, feasible[i][0].number) for i in not_beaten}
        evaluations = tuple(
            Evaluation(asked, judged, judged.violations <= allowed, (asked.seed, asked.number) in on_front)
            for asked, judged in ordered
        )
        kept = [one for one in evaluations if one.feasible]
        least = min(one.judged.violations for one in evaluations)
        best = kept or [one for one in evaluations if one.judged.violations == least]
        return cls(
            law,
            evaluations,
            tuple(
                hypervolume([one.judged.point for one in kept if one.asked.seed == seed])
                for seed in dict.fromkeys(asked.seed for asked, _ in ordered)
            ),
            best[choose([one.judged.point for one in best])] if law.ranges else None,
        )


@dataclass(frozen=True)
class Tuning:
    """All laws of a campaign, each with what was found.

    Attributes
    ----------
    problem
        What was tuned.
    laws
        In the campaign's order.
    """

    problem: Problem
    laws: tuple[Tuned, ...]

    @classmethod
    def of(cls, problem: Problem, found: Iterable[tuple[Asked, Judged]]) -> Tuning:
        """What was found, in whatever order."""
        by_law: dict[str, list[tuple[Asked, Judged]]] = {law.law.name: [] for law in problem.laws}
        for asked, judged in found:
            by_law[asked.law.law.name].append((asked, judged))
        allowed = problem.budget.violations
        return cls(problem, tuple(Tuned.of(law, by_law[law.law.name], allowed) for law in problem.laws))


EVALUATIONS, HYPERVOLUMES = "evaluations.parquet", "hypervolumes.parquet"
TUNED = "tuned.toml"


def write(tuning: Tuning, folder: Path) -> None:
    """Write all files, each whole or not at all; raises StorageError."""
    import pandas

    tables = {EVALUATIONS: evaluation_lines(tuning), HYPERVOLUMES: hypervolume_lines(tuning)}
    with storing("results", folder):
        for name, lines in tables.items():
            with replaced(folder / name) as part:
                pandas.DataFrame(lines).to_parquet(part, index=False)
        with replaced(folder / TUNED) as part:
            part.write_text(tuned_toml(tuning), encoding="utf-8")


def evaluation_lines(tuning: Tuning) -> list[dict[str, Any]]:
    """One line for each evaluation of each law and tuner seed."""
    return [
        {
            "law": law.law.law.name,
            "seed": one.asked.seed,
            "number": one.asked.number,
            "options": json.dumps(one.asked.options, sort_keys=True),
            **dict(zip([objective.column for objective in OBJECTIVES], one.judged.point, strict=True)),
            "violations": one.judged.violations,
            "runs": one.judged.runs,
            "converged": one.judged.converged,
            "feasible": one.feasible,
            "on_front": one.on_front,
            "chosen": one is law.chosen,
        }
        for law in tuning.laws
        for one in law.evaluations
    ]


def hypervolume_lines(tuning: Tuning) -> list[dict[str, Any]]:
    """One line for each law and tuner seed."""
    return [
        {"law": law.law.law.name, "seed": seed, "hypervolume": volume}
        for law in tuning.laws
        for seed, volume in enumerate(law.hypervolumes)
    ]


def tuned_toml(tuning: Tuning) -> str:
    """Chosen settings as tables of controllers, which a campaign can take over."""
    campaign = tuning.problem.campaign
    lines = [f"# Laws of the campaign {campaign.name}, tuned on training scenes of {_families(tuning)}."]
    for law in tuning.laws:
        lines += ["", *_table(law)]
    return "\n".join(lines) + "\n"


def _families(tuning: Tuning) -> str:
    return ", ".join(family.name for family in tuning.problem.campaign.families)


def _table(law: Tuned) -> list[str]:
    name = law.law.law.name
    if law.chosen is None:
        return [f"# {name}: nothing is searched"]
    share = f"{100.0 * law.chosen.judged.violations:.3g} % of its runs violate a row"
    remark = [] if law.chosen.feasible else [f"# {name}: no setting is feasible; {share}"]
    setting = law.law.setting(law.chosen.asked.options)
    options = {"type": setting.law, **setting.options}
    return [
        *remark,
        f"[controllers.{_text(f'{name}-tuned')}]",
        *(f"{_key(key)} = {_value(options[key])}" for key in options),
    ]


def _value(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return _text(value) if isinstance(value, str) else json.dumps(value)


def _key(key: str) -> str:
    return key if key.isidentifier() and key.isascii() else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
