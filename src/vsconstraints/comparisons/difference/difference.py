"""What differs between two comparisons, and whether it is for the worse."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import ConfigurationError
from ...rows import Array
from ..metrics import Metric
from ..statistics import paired, simultaneous
from ..statistics.judged import converged, judged_metric, judged_metrics, resolution, values, violated
from ..statistics.rates import sign_test
from .pairs import MIN_PAIRS, Group, Pairs, Side, groups

SIGNIFICANT = 0.05
"""Chance, over all tests of a difference together, to find something where there is nothing."""

TOLERANCE = 1e-6
"""Share of a value by which it may move: another machine rounds otherwise."""

PARTS = {
    "version": "code",
    "git_commit": "code",
    "code": "code",
    "configuration": "settings",
    "packages": "packages",
    "machine": "machine",
}
"""Entries of a manifest that results depend on, and what they are part of."""

NAMED = ("scenarios", "controllers", "families")
"""Tables of a configuration that hold a table for each name."""

OUTCOMES: dict[str, Callable[[Any], Any]] = {
    "converges": converged,
    "stays inside": lambda runs: ~violated(runs),
    "comes to an end": lambda runs: ~runs["status"].isin(["failed", "aborted"]),
}
"""What a run is to do, and whether each run does."""


@dataclass(frozen=True)
class Change:
    """A difference of two manifests.

    Attributes
    ----------
    part, what
        ``code``, ``settings``, ``packages`` or ``machine``, and the key, with dots.
    names
        The scenarios, families or controllers whose key it is.
    before, after
        In A and in B; None where it is missing.
    """

    part: str
    what: str
    names: tuple[str, ...]
    before: Any
    after: Any


def changes(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[Change]:
    """Differences of two manifests; the same change of several scenarios or controllers is one."""
    found: dict[tuple[str, str, str], Change] = {}
    for key, part in PARTS.items():
        for path, before, after in _different(a.get(key), b.get(key), ()):
            names: tuple[str, ...] = ()
            if key == "configuration" and path and path[0] in NAMED and len(path) > 1:
                names, path = (path[1],), (path[0], *(step for step in path[2:] if step != "tables"))
            what = ".".join(path) or key
            same = part, what, repr((before, after) if len(path) != 1 or not names else (before is None, after is None))
            names = (*found[same].names, *names) if same in found else names
            found[same] = Change(part, what, names, before, after)
    return list(found.values())


def _different(a: Any, b: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Paths to what differs, as deep as both have the same tables."""

    def are_tables(value: Any) -> bool:
        return isinstance(value, list) and bool(value) and all(isinstance(entry, dict) for entry in value)

    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys((*a, *b)):
            yield from _different(a.get(key), b.get(key), (*path, str(key)))
    elif are_tables(a) and are_tables(b) and len(a) == len(b):
        for i in range(len(a)):
            yield from _different(a[i], b[i], (*path, str(i)))
    elif a != b:
        yield path, a, b


@dataclass(frozen=True, eq=False)
class Outcome:
    """How often the runs of a group do something, one of :data:`OUTCOMES`, in A and in B.

    Attributes
    ----------
    before, after
        In how many pairs in A, in B.
    lost, gained
        Positions of the pairs in which only A does, only B.
    p
        Of the exact McNemar (sign) test, uncorrected; None below :data:`.pairs.MIN_PAIRS`.
    """

    group: Group
    what: str
    before: int
    after: int
    lost: Any
    gained: Any
    p: float | None

    @property
    def for_worse(self) -> bool:
        """Whether more pairs lose it than gain it."""
        return len(self.lost) > len(self.gained)


def outcomes(groups: Iterable[Group]) -> Iterator[Outcome]:
    """All outcomes in which pairs differ."""
    for group in groups:
        for what, does in OUTCOMES.items():
            a, b = does(group.a).to_numpy(), does(group.b).to_numpy()
            lost, gained = group.positions[a & ~b], group.positions[b & ~a]
            if differing := len(lost) + len(gained):
                p = sign_test(len(gained), len(lost)) if differing >= MIN_PAIRS else None
                yield Outcome(group, what, int(a.sum()), int(b.sum()), lost, gained, p)


@dataclass(frozen=True, eq=False)
class Shift:
    """How a metric of a group moved.

    Attributes
    ----------
    of
        Pairs in which both runs converged and may be judged by it.
    better, worse
        In how many of them B is better, or worse, by more than the tolerance.
    differences
        (n,) B − A, as stored, of the pairs that differ.
    p
        Of the sign test, uncorrected; None below :data:`.pairs.MIN_PAIRS`.
    """

    group: Group
    metric: Metric
    of: int
    better: int
    worse: int
    differences: Array
    p: float | None

    @property
    def for_worse(self) -> bool:
        """Whether more pairs got worse than better."""
        return self.worse > self.better


def shifts(groups: Iterable[Group], metrics: Iterable[Metric], tolerance: float) -> Iterator[Shift]:
    """All metrics in which pairs differ by more than the tolerance, a share of the greater value.

    Remaining errors that reports round to the same are the same, too.
    """
    for group, metric in ((group, metric) for group in groups for metric in metrics):
        a, b = (values(runs, metric).to_numpy() for runs in (group.a, group.b))
        exist = np.isfinite(a) & np.isfinite(b)
        a, b = a[exist], b[exist]
        moved = np.abs(b - a) > np.maximum(tolerance * np.maximum(np.abs(a), np.abs(b)), resolution(metric))
        found = paired(b[moved], a[moved], better=metric.better or "less")
        if found.n:
            p = found.p if found.n >= MIN_PAIRS else None
            yield Shift(group, metric, len(a), found.wins, found.losses, b[moved] - a[moved], p)


@dataclass(frozen=True)
class Difference:
    """B as seen from A.

    Attributes
    ----------
    a, b
        The folders.
    changes
        Of what results depend on.
    pairs, groups
        Runs of the same scene, and how they are grouped.
    found
        Outcomes and metrics in which pairs differ, each with its p-value corrected for all of them (Bonferroni), None
        if not tested.
    strict
        Whether every run counts that B lost.
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
        """Of each interval, so that all hold at once and agree with the tests."""
        return simultaneous(1.0 - SIGNIFICANT, sum(p is not None for _, p in self.found))

    @property
    def worse(self) -> list[Outcome | Shift]:
        """What got worse: see :meth:`counts`."""
        return [each for each, p in self.found if self.counts(each, p)]

    def counts(self, found: Outcome | Shift, p: float | None) -> bool:
        """Whether a difference makes B worse: significantly, or, if strict, in any run."""
        lost = self.strict and isinstance(found, Outcome) and len(found.lost) > 0
        return lost or (found.for_worse and significant(p))


def significant(p: float | None) -> bool:
    """Whether a corrected p-value is."""
    return p is not None and p <= SIGNIFICANT


@dataclass(frozen=True)
class Question:
    """How two comparisons are compared.

    Attributes
    ----------
    metrics
        Columns of results.csv; all that can be judged if empty.
    strict
        Whether every run counts that B lost; if None, those of chosen scenarios do, those of drawn scenes do not.
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
    """Compare two folders of results, before and after: both of ``compare``, or both of ``evidence``.

    Raises
    ------
    ConfigurationError
        if one of them holds no results, or they cannot be compared.
    """
    metrics = [judged_metric(name) for name in question.metrics or judged_metrics()]
    if not question.tolerance >= 0.0:
        raise ConfigurationError(f"the tolerance must be 0 or more, not {question.tolerance:g}")
    before, after = Side.load(a, question.renamed), Side.load(b)
    pairs = Pairs.of(before, after)
    judged = groups(pairs, before.group)
    found: list[Outcome | Shift] = [*outcomes(judged), *shifts(judged, metrics, question.tolerance)]
    tests = sum(each.p is not None for each in found)
    corrected = [(each, None if each.p is None else min(tests * each.p, 1.0)) for each in found]
    strict = before.drawn is None if question.strict is None else question.strict
    return Difference(before, after, changes(before.manifest, after.manifest), pairs, judged, corrected, strict)
