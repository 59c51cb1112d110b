"""Paired comparison of two result folders A and B, which tests if B is worse.

Runs of the same scenes are compared in pairs.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ..comparisons.metrics import RUN, Metric, result_columns, timing_columns
from ..comparisons.runs.folder import kind_of
from ..comparisons.runs.identity import different, in_words
from ..comparisons.runs.spec import BASELINE
from ..comparisons.stored import StoredComparison
from ..errors import ConfigurationError, unknown_name
from ..rows import Array
from .evidence import Evidence
from .evidence.parquet import Column, tables
from .statistics import SCENE, paired, simultaneous
from .statistics.judged import (
    MIN_SCENES,
    converged,
    judged_metric,
    judged_metrics,
    resolution,
    values,
    violated,
)
from .statistics.rates import sign_test

#: Familywise significance level over all tests of a difference.
SIGNIFICANT = 0.05
TOLERANCE = 1e-6  #: Relative change that is ignored: rounding differs between machines.
#: Entries of a manifest that results depend on, with the part under which they are reported.
PARTS = {
    "version": "code",
    "git_commit": "code",
    "code": "code",
    "configuration": "settings",
    "packages": "packages",
    "machine": "machine",
}

#: Tables of a configuration that contain one table per name.
NAMED_TABLES = ("scenarios", "controllers", "families")

#: Desired outcomes, with a function that flags the runs that have them.
OUTCOMES: dict[str, Callable[[Any], Any]] = {
    "converges": converged,
    "stays inside": lambda runs: ~violated(runs),
    "comes to an end": lambda runs: ~runs["status"].isin(["failed", "aborted"]),
}


@dataclass(frozen=True)
class Side:
    """One of the two result folders, with runs of chosen scenarios or of drawn scenes.

    ``runs`` (pandas.DataFrame) has one line per run: the columns of ``key``, which identify scene
    and controller, then those of results.csv. The columns of ``group`` separate results. ``unit``
    is the unit in which the manifest counts. ``drawn`` (pandas.Series) holds the drawn values of
    each scene as text; None for chosen scenarios.
    """

    folder: Path
    manifest: Mapping[str, Any]
    runs: Any
    remarks: tuple[str, ...]
    drawn: Any = None
    key: tuple[str, ...] = ("scenario", "trial", "controller")
    group: tuple[str, ...] = ()
    unit: str = "runs"

    @classmethod
    def load(cls, folder: Path) -> Side:
        """Read a folder of ``compare`` or ``evidence``.

        Raises ConfigurationError if it contains neither.
        """
        if kind_of(folder) == "evidence":
            evidence = Evidence.load(folder, trust=True)  # no scene of it is drawn again
            scenes = _without_categories(evidence.scenes, tables()["scenes"])
            return cls(
                folder,
                evidence.manifest,
                runs=_without_categories(evidence.runs, tables()["runs"]),
                remarks=evidence.remarks,
                drawn=scenes.set_index(["family", "half", "scene"])["values"],
                key=(*SCENE, "controller"),
                group=("family", "condition"),
                unit="scenes",
            )
        import pandas

        stored = StoredComparison.load(folder, trust=True)  # no part of it is built
        runs = pandas.DataFrame(stored.results, columns=list(result_columns()))
        return cls(folder, stored.manifest, runs.astype({"trial": int}), stored.remarks)

    @property
    def seed(self) -> int:
        """Seed of the runs."""
        return int(self.manifest["configuration"].get("seed", 0))

    def renamed(self, names: Mapping[str, str]) -> Side:
        """Return a copy in which some controllers have other names.

        Raises ConfigurationError for unknown controllers and for names that are in use.
        """
        configuration = dict(self.manifest["configuration"])
        controllers = configuration.get("controllers", {})
        for old, new in names.items():
            if old not in controllers:
                raise unknown_name(f"controller of {self.folder}", old, controllers)
            if new in controllers:
                raise ConfigurationError(
                    f"{old} cannot be renamed to {new}: {self.folder} has a controller of that name"
                )
        configuration["controllers"] = {
            names.get(name, name): table for name, table in controllers.items()
        }
        manifest = {**self.manifest, "configuration": configuration}
        runs = self.runs.replace({"controller": dict(names)})
        return replace(self, manifest=manifest, runs=runs)


def _without_categories(lines: Any, columns: Sequence[Column]) -> Any:
    """Return lines with texts in place of categories, which may differ between two sides."""
    return lines.astype({column.name: "str" for column in columns if column.category})


@dataclass(frozen=True)
class Pairs:
    """Runs that exist on both sides, in the same order, and runs of one side only.

    ``a`` and ``b`` are the paired runs. All are pandas.DataFrames. ``drawn_otherwise`` counts the
    scenes that have the same number on both sides but different drawn values.
    """

    a: Any
    b: Any
    only_a: Any
    only_b: Any
    drawn_otherwise: int

    @classmethod
    def of(cls, a: Side, b: Side) -> Pairs:
        """Pair the runs of two sides.

        Raises ConfigurationError if only one side has drawn scenes, if the seeds differ, or if no
        run exists on both sides.
        """
        where = f"{a.folder} and {b.folder} cannot be compared"
        if a.key != b.key:
            raise ConfigurationError(f"{where}: only one of them has drawn scenes")
        if a.seed != b.seed:
            raise ConfigurationError(
                f"{where}: their seeds are {a.seed} and {b.seed}, so their runs cannot be paired"
            )
        runs_a = a.runs.set_index(list(a.key))
        runs_b = b.runs.set_index(list(b.key))
        common = runs_a.index.intersection(runs_b.index, sort=False)
        only_a = runs_a.index.difference(common, sort=False).to_frame(False)
        only_b = runs_b.index.difference(common, sort=False).to_frame(False)
        drawn_otherwise: Any = []
        if a.drawn is not None:
            drawn_a, drawn_b = a.drawn.align(b.drawn, join="inner")
            drawn_otherwise = drawn_a.index[(drawn_a != drawn_b).to_numpy()]
            other_levels = [name for name in a.key if name not in drawn_a.index.names]
            scenes = common.droplevel(other_levels)
            common = common[~scenes.isin(drawn_otherwise)]
        if not len(common) and len(drawn_otherwise):
            keys = _differing_keys(a, b, drawn_otherwise[0])
            raise ConfigurationError(
                f"{where}: all {len(drawn_otherwise)} scenes were drawn differently: "
                f"{in_words(keys)}"
            )
        if not len(common):
            raise ConfigurationError(f"{where}: they have no law and scene in common")
        return cls(
            a=runs_a.loc[common],
            b=runs_b.loc[common],
            only_a=only_a,
            only_b=only_b,
            drawn_otherwise=len(drawn_otherwise),
        )

    @cached_property
    def differ(self) -> Any:
        """Flag of each pair: True if any score differs, except times, which always do."""
        no_scores = (*RUN, *timing_columns())
        scores = [name for name in result_columns() if name not in no_scores]
        a = self.a[scores]
        b = self.b[scores]
        both_missing = a.isna() & b.isna()
        return ((a != b) & ~both_missing).any(axis=1)


def _differing_keys(a: Side, b: Side, scene: Any) -> list[str]:
    """Return the keys of a scene whose drawn values differ."""
    first = json.loads(a.drawn.loc[scene])
    second = json.loads(b.drawn.loc[scene])
    keys = {**first, **second}
    return [key for key in keys if first.get(key) != second.get(key)]


@dataclass(frozen=True, eq=False)
class Group:
    """Pairs of one law and, for drawn scenes, of one family and condition, its ``place``.

    ``a`` and ``b`` are the runs of both sides (pandas.DataFrames). ``positions`` (n,) are the
    indices of the pairs among all pairs.
    """

    law: str
    place: tuple[str, ...]
    positions: Any
    a: Any
    b: Any

    def __str__(self) -> str:
        return ", ".join((self.law, *self.place))


def groups(pairs: Pairs, by: tuple[str, ...]) -> list[Group]:
    """Group all pairs by controller and the columns ``by``, without the unconstrained baseline."""
    found = []
    by_key = pairs.a.groupby(level=["controller", *by], sort=False, observed=True)
    for key, positions in by_key.indices.items():
        law, *place = map(str, key if isinstance(key, tuple) else (key,))
        if law == BASELINE:
            continue
        ordered = np.sort(positions)
        runs_a = pairs.a.iloc[ordered]
        runs_b = pairs.b.iloc[ordered]
        found.append(Group(law, tuple(place), ordered, runs_a, runs_b))
    return found


@dataclass(frozen=True)
class Change:
    """Difference between two manifests.

    It has a ``part``, a key ``what`` with dots, and the ``names`` of the scenarios or controllers
    that it concerns. ``before`` or ``after`` is None if the key is missing there.
    """

    part: str
    what: str
    names: tuple[str, ...]
    before: Any
    after: Any


def changes(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[Change]:
    """List the differences between two manifests.

    A change that several scenarios or controllers have in common is listed once.
    """
    found: dict[tuple[str, str, str], Change] = {}
    for key, part in PARTS.items():
        for path, before, after in different(a.get(key), b.get(key)):
            compared = repr((before, after))
            names: tuple[str, ...] = ()
            if key == "configuration" and len(path) > 1 and path[0] in NAMED_TABLES:
                table, name, *steps = path
                names = (name,)
                path = (table, *(step for step in steps if step != "tables"))
                if path == (table,):
                    # a whole table of one name, which is on one side only
                    compared = repr((before is None, after is None))
            what = ".".join(path) or key
            same = (part, what, compared)
            if same in found:
                names = (*found[same].names, *names)
            found[same] = Change(part, what, names, before, after)
    return list(found.values())


@dataclass(frozen=True, eq=False)
class Outcome:
    """Number of pairs of a group in which A and B have the outcome ``what`` of :data:`OUTCOMES`.

    ``lost`` are the pairs in which only A has it, ``gained`` those in which only B has it. ``p`` is
    the uncorrected p-value of the exact sign test (McNemar); None if fewer than
    :data:`.judged.MIN_SCENES` pairs differ.
    """

    group: Group
    what: str
    before: int
    after: int
    lost: Any
    gained: Any
    for_worse: bool
    p: float | None


def outcomes(groups: Iterable[Group]) -> Iterator[Outcome]:
    """Yield every outcome in which pairs differ."""
    for group, (what, flag) in product(groups, OUTCOMES.items()):
        before = flag(group.a).to_numpy()
        after = flag(group.b).to_numpy()
        lost = group.positions[before & ~after]
        gained = group.positions[after & ~before]
        differing = len(lost) + len(gained)
        if differing:
            yield Outcome(
                group,
                what,
                before=int(before.sum()),
                after=int(after.sum()),
                lost=lost,
                gained=gained,
                for_worse=len(lost) > len(gained),
                p=sign_test(len(gained), len(lost)) if differing >= MIN_SCENES else None,
            )


@dataclass(frozen=True, eq=False)
class Shift:
    """Change of a metric in a group, over the pairs in which both runs can be judged by it.

    There are ``of`` such pairs: both runs converge and satisfy the condition of the metric. In
    ``better`` and ``worse`` of them B is better or worse by more than the tolerance.
    ``differences`` (n,) are B − A, as stored, of the pairs that differ. ``p`` is the uncorrected
    p-value of the sign test; None if too few pairs differ.
    """

    group: Group
    metric: Metric
    of: int
    better: int
    worse: int
    differences: Array
    for_worse: bool
    p: float | None


def shifts(groups: Iterable[Group], metrics: Iterable[Metric], tolerance: float) -> Iterator[Shift]:
    """Yield the metrics in which pairs differ by more than the tolerance.

    The tolerance is relative to the greater value. A change must also exceed the resolution of the
    metric, the smallest difference that reports show.
    """
    for group, metric in product(groups, metrics):
        a = values(group.a, metric).to_numpy()
        b = values(group.b, metric).to_numpy()
        exist = np.isfinite(a) & np.isfinite(b)
        a = a[exist]
        b = b[exist]
        change = np.abs(b - a)
        greater = np.maximum(np.abs(a), np.abs(b))
        has_moved = change > np.maximum(tolerance * greater, resolution(metric))
        before = a[has_moved]
        after = b[has_moved]
        found = paired(after, before, better=metric.better or "less")
        if found.n:
            yield Shift(
                group,
                metric,
                of=len(a),
                better=found.wins,
                worse=found.losses,
                differences=after - before,
                for_worse=found.losses > found.wins,
                p=found.p if found.n >= MIN_SCENES else None,
            )


@dataclass(frozen=True)
class Difference:
    """Result of comparing B with A.

    ``found`` are the outcomes and metrics in which pairs differ, each with its p-value after
    Bonferroni correction over all tests; None if not tested. If ``strict``, a single outcome that
    only A has makes B worse.
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
        """Confidence level of each interval, chosen to agree with the corrected tests.

        All intervals hold simultaneously.
        """
        tests = sum(p is not None for _, p in self.found)
        return simultaneous(1.0 - SIGNIFICANT, tests)

    @property
    def worse(self) -> list[Outcome | Shift]:
        """Outcomes and metrics in which B is worse, see :meth:`counts`."""
        return [each for each, p in self.found if self.counts(each, p)]

    def counts(self, found: Outcome | Shift, p: float | None) -> bool:
        """Return True if a difference makes B worse: significantly or, if strict, in any run."""
        lost = self.strict and isinstance(found, Outcome) and len(found.lost) > 0
        return lost or (found.for_worse and significant(p))


def significant(p: float | None) -> bool:
    """Return True if a corrected p-value is significant."""
    return p is not None and p <= SIGNIFICANT


def difference(
    a: Path,
    b: Path,
    *,
    metrics: Sequence[str] = (),
    strict: bool | None = None,
    tolerance: float = TOLERANCE,
    renamed: Mapping[str, str] = MappingProxyType({}),
) -> Difference:
    """Compare two result folders, before and after: both of ``compare``, or both of ``evidence``.

    ``metrics`` are columns of results.csv; if empty, all that can be judged. If ``strict``, a
    single outcome that only A has makes B worse. None means strict for chosen scenarios, and not
    strict for drawn scenes. ``tolerance`` is the relative change that is ignored. ``renamed`` maps
    controller names of A to those of B. Raises ConfigurationError if the folders are not
    comparable.
    """
    columns = [judged_metric(name) for name in metrics or judged_metrics()]
    if not tolerance >= 0.0:
        raise ConfigurationError(f"the tolerance must be 0 or more, not {tolerance:g}")
    before = Side.load(a).renamed(renamed)
    after = Side.load(b)
    if strict is None:
        strict = before.drawn is None
    pairs = Pairs.of(before, after)
    judged = groups(pairs, before.group)
    found: list[Outcome | Shift] = [*outcomes(judged), *shifts(judged, columns, tolerance)]
    tests = sum(each.p is not None for each in found)
    corrected = []
    for each in found:
        p = None if each.p is None else min(tests * each.p, 1.0)
        corrected.append((each, p))
    changed = changes(before.manifest, after.manifest)
    return Difference(before, after, changed, pairs, judged, corrected, strict)
