"""What is different between two comparisons, and whether it is for the worse."""

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
from .pairs import Group, Pairs, Side, groups, tested

PARTS = {
    "version": "code",
    "git_commit": "code",
    "code": "code",
    "configuration": "settings",
    "packages": "packages",
    "machine": "machine",
}
"""Entries of a manifest that results depend on, and what they are part of; the others say how a command went."""

NAMED = ("scenarios", "controllers", "families")
"""Tables of a configuration that hold a table for each name."""


@dataclass(frozen=True)
class Change:
    """Something that is another in B than in A.

    Attributes
    ----------
    part
        ``code``, ``settings``, ``packages`` or ``machine``.
    what
        Its key, with dots.
    names
        The scenarios, families or controllers that it is a key of, alike in all of them; none if it is of no such.
    before, after
        In A and in B; None where it is not there.
    """

    part: str
    what: str
    names: tuple[str, ...]
    before: Any
    after: Any


def changes(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[Change]:
    """What two manifests say differently; the same change of several scenarios or controllers is one."""
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
    """Paths to what is different, as deep as both have the same tables."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys((*a, *b)):
            yield from _different(a.get(key), b.get(key), (*path, str(key)))
    elif _tables(a) and _tables(b) and len(a) == len(b):
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from _different(one, other, (*path, str(i)))
    elif a != b:
        yield path, a, b


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(entry, dict) for entry in value)


OUTCOMES: dict[str, Callable[[Any], Any]] = {
    "converges": converged,
    "stays inside": lambda runs: ~violated(runs),
    "comes to an end": lambda runs: ~runs["status"].isin(["failed", "aborted"]),
}
"""What a run is to do, and in which runs it does."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """How often a law does something in A and in B.

    Attributes
    ----------
    group
        Whose runs.
    what
        One of :data:`OUTCOMES`.
    before, after
        In how many pairs it does so in A, in B.
    lost, gained
        Positions of the pairs in which only A does so, only B.
    p
        McNemar's, exact, which is the sign test; before correction. None where so few pairs differ that none could be
        significant.
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
        """Which way it goes."""
        return len(self.lost) > len(self.gained)


def outcomes(groups: list[Group]) -> Iterator[Outcome]:
    """All of them in which pairs differ."""
    for group in groups:
        for what, does in OUTCOMES.items():
            a, b = does(group.a).to_numpy(), does(group.b).to_numpy()
            lost, gained = group.positions[a & ~b], group.positions[b & ~a]
            if len(lost) + len(gained):
                p = sign_test(len(gained), len(lost)) if tested(len(lost) + len(gained)) else None
                yield Outcome(group, what, int(a.sum()), int(b.sum()), lost, gained, p)


@dataclass(frozen=True, eq=False)
class Shift:
    """How a metric of a law moved.

    Attributes
    ----------
    group, metric
        Whose, and which.
    of
        Pairs in which both runs converged and may be judged by it.
    better, worse
        In how many of them it is better in B than in A, or worse, by more than the tolerance.
    differences
        (n,) B − A, as stored, of the pairs that differ.
    p
        Of the sign test, before correction; None where so few pairs differ that none could be significant.
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
        """Which way it goes: that of most pairs."""
        return self.worse > self.better


def chosen(names: Sequence[str]) -> list[Metric]:
    """The metrics of these names, or all; raises ConfigurationError that names the candidates."""
    return [judged_metric(name) for name in names or judged_metrics()]


def shifts(groups: Iterable[Group], metrics: Iterable[Metric], tolerance: float) -> Iterator[Shift]:
    """All of them in which pairs differ by more than the tolerance.

    Parameters
    ----------
    groups, metrics
        Whose, and which.
    tolerance
        Share of the greater of both values by which they may differ and count as the same; remaining errors are the
        same, too, where reports show them alike.
    """
    for group, metric in ((group, metric) for group in groups for metric in metrics):
        a, b = (values(runs, metric).to_numpy() for runs in (group.a, group.b))
        exist = np.isfinite(a) & np.isfinite(b)
        a, b = a[exist], b[exist]
        moved = np.abs(b - a) > np.maximum(tolerance * np.maximum(np.abs(a), np.abs(b)), resolution(metric))
        found = paired(b[moved], a[moved], better=metric.better or "less")
        if found.n:
            p = found.p if tested(found.n) else None
            yield Shift(group, metric, len(a), found.wins, found.losses, b[moved] - a[moved], p)


TIMES = ("step_time_median_us", "step_time_p99_us", "rows_time_median_us")


@dataclass(frozen=True)
class Ratio:
    """Times of a law's runs.

    Attributes
    ----------
    group, column
        Whose, and which time.
    before, after
        Their medians in A and B [µs].
    ratio
        Median of B / A over the pairs.
    """

    group: Group
    column: str
    before: float
    after: float
    ratio: float


def ratios(groups: Iterable[Group]) -> Iterator[Ratio]:
    """All of which there are pairs with both."""
    for group in groups:
        for column in TIMES:
            a, b = (runs[column].to_numpy(dtype=float) for runs in (group.a, group.b))
            exist = np.isfinite(a) & np.isfinite(b) & (a > 0.0)
            if exist.any():
                a, b = a[exist], b[exist]
                yield Ratio(group, column, float(np.median(a)), float(np.median(b)), float(np.median(b / a)))


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
