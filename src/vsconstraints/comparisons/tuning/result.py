"""The result of a tuning, and its tables and settings as files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..runs.files import replaced, storing
from .objectives import OBJECTIVES, Judged, choose, front, hypervolume
from .problem import Options, Problem, Searched

EVALUATIONS, HYPERVOLUMES, TUNED = "evaluations.parquet", "hypervolumes.parquet", "tuned.toml"


@dataclass(frozen=True)
class Asked:
    """A setting of a law that a tuner with this seed suggested, and its number there; 0 is the default."""

    law: Searched
    seed: int
    number: int
    options: Options


@dataclass(frozen=True)
class Evaluation:
    """A setting and how it is judged.

    Attributes
    ----------
    asked, judged
        The setting, and its outcomes.
    feasible
        Whether it violates no more than is allowed.
    on_front
        Whether no feasible evaluation of this law dominates it, of all tuner seeds.
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
        As the campaign defines it.
    evaluations
        Of all tuner seeds, one after the other; the first is the default.
    hypervolumes
        Of each tuner seed's feasible evaluations, to :data:`vsconstraints.comparisons.tuning.objectives.REFERENCE`.
    chosen
        Of the feasible settings the one that :func:`.choose` finds; if there is none, of those that violate least (Deb
        2000). None if nothing is searched.
    """

    law: Searched
    evaluations: tuple[Evaluation, ...]
    hypervolumes: tuple[float, ...]
    chosen: Evaluation | None

    @property
    def default(self) -> Evaluation:
        """The law as the campaign defines it."""
        return self.evaluations[0]

    @classmethod
    def of(cls, law: Searched, found: Iterable[tuple[Asked, Judged]], allowed: float) -> Tuned:
        """A law's evaluations, with the share of violations that is allowed."""
        ordered = sorted(found, key=lambda one: (one[0].seed, one[0].number))
        feasible = [i for i, (_, judged) in enumerate(ordered) if judged.violations <= allowed]
        on_front = {feasible[i] for i in front([ordered[i][1].point for i in feasible])}
        evaluations = tuple(
            Evaluation(asked, judged, judged.violations <= allowed, i in on_front)
            for i, (asked, judged) in enumerate(ordered)
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
    """The tuned laws of a campaign, in its order."""

    problem: Problem
    laws: tuple[Tuned, ...]

    @classmethod
    def of(cls, problem: Problem, found: Iterable[tuple[Asked, Judged]]) -> Tuning:
        """From evaluations in any order."""
        by_law: dict[str, list[tuple[Asked, Judged]]] = {law.law.name: [] for law in problem.laws}
        for asked, judged in found:
            by_law[asked.law.law.name].append((asked, judged))
        allowed = problem.budget.violations
        return cls(problem, tuple(Tuned.of(law, by_law[law.law.name], allowed) for law in problem.laws))

    def write(self, folder: Path) -> None:
        """Write tables and settings, each file whole or not at all; raises StorageError."""
        import pandas

        evaluations = [_line(law, one) for law in self.laws for one in law.evaluations]
        hypervolumes = [
            {"law": law.law.law.name, "seed": seed, "hypervolume": volume}
            for law in self.laws
            for seed, volume in enumerate(law.hypervolumes)
        ]
        with storing("results", folder):
            for name, lines in ((EVALUATIONS, evaluations), (HYPERVOLUMES, hypervolumes)):
                with replaced(folder / name) as part:
                    pandas.DataFrame(lines).to_parquet(part, index=False)
            with replaced(folder / TUNED) as part:
                part.write_text(self.toml(), encoding="utf-8")

    def toml(self) -> str:
        """Chosen settings as tables of controllers, which a campaign can take over."""
        campaign = self.problem.campaign
        families = ", ".join(family.name for family in campaign.families)
        lines = [f"# Laws of the campaign {campaign.name}, tuned on training scenes of {families}."]
        for law in self.laws:
            lines += ["", *_table(law)]
        return "\n".join(lines) + "\n"


def _line(law: Tuned, one: Evaluation) -> dict[str, Any]:
    return {
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


def _table(law: Tuned) -> list[str]:
    name = law.law.law.name
    if law.chosen is None:
        return [f"# {name}: nothing is searched"]
    share = f"{100.0 * law.chosen.judged.violations:.3g} % of its runs violate a row"
    remark = [] if law.chosen.feasible else [f"# {name}: no setting is feasible; {share}"]
    setting = law.law.setting(law.chosen.asked.options)
    options = {"type": setting.law, **setting.options}
    lines = [f"{_key(key)} = {_value(options[key])}" for key in options]
    return [*remark, f"[controllers.{_text(f'{name}-tuned')}]", *lines]


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
