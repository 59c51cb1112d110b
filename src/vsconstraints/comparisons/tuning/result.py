"""What a tuning found of each law."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from .fronts import choose, front, hypervolume
from .objectives import Judged
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
