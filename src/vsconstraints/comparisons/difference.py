"""What differs between two folders of results, A and B, and whether B is worse: runs of the same
scenes in pairs.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ..errors import ConfigurationError, unknown_name
from ..rows import Array
from .evidence import Evidence
from .evidence.campaign import different, in_words
from .evidence.parquet import RUNS, SCENES
from .metrics import METRICS, RESULT_COLUMNS, TIMING_COLUMNS, Metric
from .runs.folder import kind_of
from .runs.spec import BASELINE
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
from .stored import StoredComparison

#: chance, over all tests of a difference together, to find something where there is nothing
SIGNIFICANT = 0.05
TOLERANCE = 1e-6  #: share of a value by which it may move: another machine rounds otherwise
#: Columns that are equal if a run is: all but times.
SCORES = [
    metric.column
    for metric in METRICS
    if metric.value is not None and metric.column not in TIMING_COLUMNS
]

PARTS = dict.fromkeys(("version", "git_commit", "code"), "code")
PARTS |= {"configuration": "settings", "packages": "packages", "machine": "machine"}
"""Entries of a manifest that results depend on, and what they are part of."""

#: tables of a configuration that hold a table for each name
NAMED = ("scenarios", "controllers", "families")

#: What a run is to do, and whether each run does.
OUTCOMES: dict[str, Callable[[Any], Any]] = {
    "converges": converged,
    "stays inside": lambda runs: ~violated(runs),
    "comes to an end": lambda runs: ~runs["status"].isin(["failed", "aborted"]),
}


@dataclass(frozen=True)
class Side:
    """One of the two result folders, of chosen scenarios or of drawn scenes.

    ``runs`` (pandas.DataFrame) has one line per run: the columns of ``key``, scene and controller,
    then those of results.csv; those of ``group`` separate results, and ``unit`` is what the
    manifest counts. ``drawn`` (pandas.Series) is what was drawn for each scene, as text; None for
    chosen scenarios.
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
        """Read a folder of ``compare`` or ``evidence``; raises ConfigurationError if it holds
        neither.
        """
        if kind_of(folder) == "evidence":
            evidence = Evidence.load(folder, trust=True)  # nothing of it is drawn
            # the categories of the other side may be different
            runs = evidence.runs.astype({column.name: "str" for column in RUNS if column.category})
            scenes = evidence.scenes.astype(
                {column.name: "str" for column in SCENES if column.category}
            )
            drawn = scenes.set_index(["family", "half", "scene"])["values"]
            key = (*SCENE, "controller")
            group = ("family", "condition")
            return cls(
                folder, evidence.manifest, runs, evidence.remarks, drawn, key, group, "scenes"
            )
        import pandas

        stored = StoredComparison.load(folder, trust=True)  # nothing of it is built
        runs = pandas.DataFrame(stored.results, columns=list(RESULT_COLUMNS)).astype({"trial": int})
        return cls(folder, stored.manifest, runs, stored.remarks)

    def renamed(self, names: Mapping[str, str]) -> Side:
        """The same with other names for some controllers; raises ConfigurationError for unknown and
        used ones.
        """
        configuration = self.manifest["configuration"]
        controllers = configuration.get("controllers", {})
        for old, new in names.items():
            if old not in controllers:
                raise unknown_name(f"controller of {self.folder}", old, controllers)
            if new in controllers:
                raise ConfigurationError(
                    f"{old} cannot be called {new}: {self.folder} has a controller of that name"
                )
        tables = {names.get(name, name): table for name, table in controllers.items()}
        manifest = {**self.manifest, "configuration": {**configuration, "controllers": tables}}
        return replace(self, manifest=manifest, runs=self.runs.replace({"controller": dict(names)}))


@dataclass(frozen=True)
class Pairs:
    """Runs that both sides have, ``a`` and ``b`` in the same order, and those that only one has
    (pandas.DataFrames).

    ``drawn_otherwise`` counts the scenes that have the same number in both and are not the same.
    """

    a: Any
    b: Any
    only_a: Any
    only_b: Any
    drawn_otherwise: int

    @classmethod
    def of(cls, a: Side, b: Side) -> Pairs:
        """Pair two sides; ConfigurationError if only one has drawn scenes, seeds differ, or there
        is no pair.
        """
        seeds = [side.manifest["configuration"].get("seed", 0) for side in (a, b)]
        why = "" if a.key == b.key else "only one of them has drawn scenes"
        if not why and seeds[0] != seeds[1]:
            why = f"their seeds are {seeds[0]} and {seeds[1]}, so that their runs are no pairs"
        otherwise: Any = []
        if not why:
            runs_a, runs_b = (side.runs.set_index(list(side.key)) for side in (a, b))
            common = runs_a.index.intersection(runs_b.index, sort=False)
            only_a, only_b = (
                runs.index.difference(common, sort=False).to_frame(False)
                for runs in (runs_a, runs_b)
            )
            if a.drawn is not None:
                drawn_a, drawn_b = a.drawn.align(b.drawn, join="inner")
                otherwise = drawn_a.index[(drawn_a != drawn_b).to_numpy()]
                scenes = common.droplevel(
                    [name for name in a.key if name not in drawn_a.index.names]
                )
                common = common[~scenes.isin(otherwise)]
            if not len(common):
                why = "no law and scene is in both"
            if not len(common) and len(otherwise):
                first, second = (json.loads(side.drawn.loc[otherwise[0]]) for side in (a, b))
                keys = [key for key in {**first, **second} if first.get(key) != second.get(key)]
                why = f"all {len(otherwise)} scenes are drawn otherwise: {in_words(keys)}"
        if why:
            raise ConfigurationError(f"{a.folder} and {b.folder} cannot be compared: {why}")
        return cls(runs_a.loc[common], runs_b.loc[common], only_a, only_b, len(otherwise))

    @cached_property
    def differ(self) -> Any:
        """Whether anything but times differs, for each pair."""
        a = self.a[SCORES]
        b = self.b[SCORES]
        return ((a != b) & ~(a.isna() & b.isna())).any(axis=1)


@dataclass(frozen=True, eq=False)
class Group:
    """Pairs of a law in one family and condition, its ``place``, if they are drawn, and their runs
    (pandas.DataFrames).

    ``positions`` (n,) are those among all pairs.
    """

    law: str
    place: tuple[str, ...]
    positions: Any
    a: Any
    b: Any

    def __str__(self) -> str:
        return ", ".join((self.law, *self.place))


def groups(pairs: Pairs, by: tuple[str, ...]) -> list[Group]:
    """All pairs by controller and the columns ``by``; the unconstrained baseline is not judged."""
    found = []
    for key, positions in pairs.a.groupby(
        level=["controller", *by], sort=False, observed=True
    ).indices.items():
        law, *place = map(str, key if isinstance(key, tuple) else (key,))
        if law != BASELINE:
            at = np.sort(positions)
            found.append(Group(law, tuple(place), at, pairs.a.iloc[at], pairs.b.iloc[at]))
    return found


@dataclass(frozen=True)
class Change:
    """A difference of two manifests: which ``part`` and key, with dots, of which names; None where
    it is missing.
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
        for path, before, after in different(a.get(key), b.get(key)):
            names: tuple[str, ...] = ()
            if key == "configuration" and path and path[0] in NAMED and len(path) > 1:
                names = (path[1],)
                path = (path[0], *(step for step in path[2:] if step != "tables"))
            what = ".".join(path) or key
            same = (
                part,
                what,
                repr(
                    (before, after)
                    if len(path) != 1 or not names
                    else (before is None, after is None)
                ),
            )
            names = (*found[same].names, *names) if same in found else names
            found[same] = Change(part, what, names, before, after)
    return list(found.values())


@dataclass(frozen=True, eq=False)
class Outcome:
    """In how many pairs of a group A and B do ``what``, one of :data:`OUTCOMES`; ``lost``,
    ``gained``: only A, only B.

    ``p`` is of the exact sign test (McNemar), uncorrected; None if too few differ for a test,
    :data:`.judged.MIN_SCENES`.
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
    """All outcomes in which pairs differ."""
    for group in groups:
        for what, does in OUTCOMES.items():
            a = does(group.a).to_numpy()
            b = does(group.b).to_numpy()
            lost = group.positions[a & ~b]
            gained = group.positions[b & ~a]
            if differing := len(lost) + len(gained):
                p = sign_test(len(gained), len(lost))
                worse = len(lost) > len(gained)
                p_value = p if differing >= MIN_SCENES else None
                yield Outcome(group, what, int(a.sum()), int(b.sum()), lost, gained, worse, p_value)


@dataclass(frozen=True, eq=False)
class Shift:
    """How a metric of a group moved, in the pairs, ``of`` all, in which both runs converged and may
    be judged by it.

    In ``better`` and ``worse`` of them B is so by more than the tolerance; ``differences`` (n,) are
    B − A, as stored, of the pairs that differ. ``p`` is of the sign test, uncorrected; None if too
    few differ.
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
    """All metrics in which pairs differ by more than the tolerance, a share of the greater value,
    and reports show.
    """
    for group, metric in ((group, metric) for group in groups for metric in metrics):
        a, b = (values(runs, metric).to_numpy() for runs in (group.a, group.b))
        exist = np.isfinite(a) & np.isfinite(b)
        a = a[exist]
        b = b[exist]
        moved = np.abs(b - a) > np.maximum(
            tolerance * np.maximum(np.abs(a), np.abs(b)), resolution(metric)
        )
        found = paired(b[moved], a[moved], better=metric.better or "less")
        if found.n:
            p = found.p if found.n >= MIN_SCENES else None
            worse = found.losses > found.wins
            yield Shift(
                group, metric, len(a), found.wins, found.losses, b[moved] - a[moved], worse, p
            )


@dataclass(frozen=True)
class Difference:
    """B as seen from A.

    ``found`` are the outcomes and metrics in which pairs differ, each with its p-value corrected
    for all of them (Bonferroni), None if not tested. If ``strict``, every run counts that B lost.
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


def difference(
    a: Path,
    b: Path,
    *,
    metrics: Sequence[str] = (),
    strict: bool | None = None,
    tolerance: float = TOLERANCE,
    renamed: Mapping[str, str] = MappingProxyType({}),
) -> Difference:
    """Compare two folders of results, before and after: both of ``compare``, or both of
    ``evidence``.

    ``metrics`` are columns of results.csv, all that can be judged if empty; ``strict`` says whether
    every run counts that B lost: if None, those of chosen scenarios do, those of drawn scenes do
    not; ``tolerance`` is the share of a value by which it may move, ``renamed`` what controllers of
    A are called in B. Raises ConfigurationError if they are not comparable.
    """
    columns = [judged_metric(name) for name in metrics or judged_metrics()]
    if not tolerance >= 0.0:
        raise ConfigurationError(f"the tolerance must be 0 or more, not {tolerance:g}")
    before = Side.load(a).renamed(renamed)
    after = Side.load(b)
    pairs = Pairs.of(before, after)
    judged = groups(pairs, before.group)
    found: list[Outcome | Shift] = [*outcomes(judged), *shifts(judged, columns, tolerance)]
    tests = sum(each.p is not None for each in found)
    corrected = [(each, None if each.p is None else min(tests * each.p, 1.0)) for each in found]
    counted = before.drawn is None if strict is None else strict
    return Difference(
        before, after, changes(before.manifest, after.manifest), pairs, judged, corrected, counted
    )
