"""What is different between two comparisons, and whether it is for the worse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...errors import ConfigurationError
from ..statistics import simultaneous
from .changes import Change, changes
from .groups import Group, groups
from .outcomes import Outcome, outcomes
from .pairs import Pairs
from .shifts import Shift, chosen, shifts
from .sides import Side

SIGNIFICANT = 0.05
"""Chance, over all tests of a difference together, to find something where there is nothing."""

TOLERANCE = 1e-6
"""Share of a value by which it may move: another machine rounds otherwise."""


@dataclass(frozen=True)
class Difference:
    """B as seen from A.

    Attributes
    ----------
    a, b
        The folders.
    changes
        Besides results.
    pairs, groups
        Runs of the same scene, and how they are judged.
    found
        Outcomes and metrics in which pairs differ, each with its p-value after correction for all of them (Bonferroni),
        None where it was not tested.
    strict
        Whether each run counts that B lost.
    """

    a: Side
    b: Side
    changes: Sequence[Change]
    pairs: Pairs
    groups: Sequence[Group]
    found: Sequence[tuple[Outcome | Shift, float | None]]
    strict: bool

    @property
    def confidence(self) -> float:
        """Of each interval, so that those of all tests hold at once and agree with the tests."""
        return simultaneous(1.0 - SIGNIFICANT, sum(p is not None for _, p in self.found))

    @property
    def worse(self) -> list[Outcome | Shift]:
        """What got worse: see :meth:`counts`."""
        return [one for one, p in self.found if self.counts(one, p)]

    def counts(self, one: Outcome | Shift, p: float | None) -> bool:
        """Whether something that differs makes B the worse: significantly so, or, where strict, in any run."""
        lost = self.strict and isinstance(one, Outcome) and len(one.lost) > 0
        return lost or (one.for_worse and significant(p))


def significant(p: float | None) -> bool:
    """Whether a corrected p-value is."""
    return p is not None and p <= SIGNIFICANT


@dataclass(frozen=True)
class Question:
    """How two comparisons are held together.

    Attributes
    ----------
    metrics
        Columns of results.csv; all that can be judged if empty.
    strict
        Whether each run counts that B lost: of chosen scenes it does, of drawn ones not, if None.
    tolerance
        Share of a value by which it may move.
    renamed
        Controllers of A, and what they are called in B.
    """

    metrics: Sequence[str] = ()
    strict: bool | None = None
    tolerance: float = TOLERANCE
    renamed: Mapping[str, str] = field(default_factory=dict)


def difference(a: Path, b: Path, question: Question = Question()) -> Difference:
    """Compare two folders of results.

    Parameters
    ----------
    a, b
        Before and after: both of ``compare``, or both of ``evidence``.
    question
        What of.

    Raises
    ------
    ConfigurationError
        if one of them holds no results, or they cannot be compared.
    """
    metrics = chosen(question.metrics)
    if not question.tolerance >= 0.0:
        raise ConfigurationError(f"the tolerance must be 0 or more, not {question.tolerance:g}")
    one, other = Side.load(a, question.renamed), Side.load(b)
    pairs = Pairs.of(one, other)
    judged = groups(pairs, one.group)
    found: list[Any] = [*outcomes(judged), *shifts(judged, metrics, question.tolerance)]
    strict = one.drawn is None if question.strict is None else question.strict
    changed = changes(one.manifest, other.manifest)
    return Difference(one, other, changed, pairs, judged, list(zip(found, _corrected(found), strict=True)), strict)


def _corrected(found: Sequence[Outcome | Shift]) -> list[float | None]:
    tests = sum(one.p is not None for one in found)
    return [None if one.p is None else min(tests * one.p, 1.0) for one in found]
