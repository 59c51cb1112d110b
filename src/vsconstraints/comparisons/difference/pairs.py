"""Runs of the same scene with the same controller, one from each of two result folders A and B."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import ConfigurationError, unknown_name
from ..evidence import RUNS, SCENES, Evidence
from ..evidence.campaign import in_words
from ..metrics import METRICS, RESULT_COLUMNS, TIMING_COLUMNS
from ..runs.folder import kind_of
from ..runs.spec import BASELINE
from ..statistics import SCENE
from ..stored import StoredComparison

SCORES = tuple(metric.column for metric in METRICS if metric.value is not None and metric.column not in TIMING_COLUMNS)
"""Columns that are equal if a run is: all but times."""

MIN_PAIRS = 6
"""Pairs that have to differ for a test: with fewer, p is at least 2 / 2⁵ = 0.0625."""


@dataclass(frozen=True)
class Side:
    """One of the two result folders, of chosen scenarios or of drawn scenes.

    Attributes
    ----------
    folder, manifest
        Where it is stored, and what was run.
    runs
        pandas.DataFrame, one line per run: the columns of ``key``, then those of results.csv.
    scene, group
        Columns that identify the scene of a run, and those that separate results: none, or family and condition.
    unit
        What the manifest counts: ``runs`` or ``scenes``.
    drawn
        pandas.Series of what was drawn for each scene, as text; None for chosen scenarios.
    remarks
        What a reader should know of what is stored.
    """

    folder: Path
    manifest: Mapping[str, Any]
    runs: Any
    scene: tuple[str, ...]
    group: tuple[str, ...]
    unit: str
    drawn: Any
    remarks: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, ...]:
        """Columns that identify a run."""
        return (*self.scene, "controller")

    @classmethod
    def load(cls, folder: Path, renamed: Mapping[str, str] | None = None) -> Side:
        """Read a folder of ``compare`` or ``evidence``, with other names for some of its controllers.

        Raises
        ------
        ConfigurationError
            if it holds neither, or no such controller.
        """
        side = _drawn(folder) if kind_of(folder) == "evidence" else _chosen(folder)
        return _renamed(side, renamed or {})


def _chosen(folder: Path) -> Side:
    import pandas

    stored = StoredComparison.load(folder, trust=True)  # nothing of it is built
    runs = pandas.DataFrame(stored.results, columns=list(RESULT_COLUMNS))
    runs["trial"] = runs["trial"].astype(int)
    return Side(folder, stored.manifest, runs, ("scenario", "trial"), (), "runs", None, stored.remarks)


def _drawn(folder: Path) -> Side:
    evidence = Evidence.load(folder, trust=True)  # nothing of it is drawn
    # the categories of the other side may be different
    runs = evidence.runs.astype({column.name: "str" for column in RUNS if column.category})
    scenes = evidence.scenes.astype({column.name: "str" for column in SCENES if column.category})
    drawn = scenes.set_index(["family", "half", "scene"])["values"]
    return Side(folder, evidence.manifest, runs, SCENE, ("family", "condition"), "scenes", drawn, evidence.remarks)


def _renamed(side: Side, names: Mapping[str, str]) -> Side:
    if not names:
        return side
    configuration = side.manifest["configuration"]
    controllers = configuration["controllers"]
    for old, new in names.items():
        if old not in controllers:
            raise unknown_name(f"controller of {side.folder}", old, controllers)
        if new in controllers:
            raise ConfigurationError(f"{old} cannot be called {new}: {side.folder} has a controller of that name")
    tables = {names.get(name, name): table for name, table in controllers.items()}
    manifest = {**side.manifest, "configuration": {**configuration, "controllers": tables}}
    return replace(side, manifest=manifest, runs=side.runs.assign(controller=side.runs["controller"].replace(names)))


@dataclass(frozen=True)
class Pairs:
    """Runs that both sides have, and those that they do not.

    Attributes
    ----------
    a, b
        pandas.DataFrames of the runs that both have, in the same order.
    only_a, only_b
        Runs that only one has, as lines of names.
    drawn_otherwise
        Scenes that have the same number in both and are not the same.
    """

    a: Any
    b: Any
    only_a: Any
    only_b: Any
    drawn_otherwise: int

    @classmethod
    def of(cls, a: Side, b: Side) -> Pairs:
        """Pair two sides.

        Raises
        ------
        ConfigurationError
            if only one has drawn scenes, the seeds differ, or there is no pair.
        """

        def refuse(why: str) -> ConfigurationError:
            return ConfigurationError(f"{a.folder} and {b.folder} cannot be compared: {why}")

        if a.key != b.key:
            raise refuse("only one of them has drawn scenes")
        seeds = [side.manifest["configuration"].get("seed", 0) for side in (a, b)]
        if seeds[0] != seeds[1]:
            raise refuse(f"their seeds are {seeds[0]} and {seeds[1]}, so that their runs are no pairs")
        runs_a, runs_b = (side.runs.set_index(list(side.key)) for side in (a, b))
        common = runs_a.index.intersection(runs_b.index, sort=False)
        only_a, only_b = (runs.index.difference(common, sort=False).to_frame(False) for runs in (runs_a, runs_b))
        otherwise = _drawn_otherwise(a, b)
        if len(otherwise):
            scenes = common.droplevel([name for name in a.key if name not in otherwise.names])
            common = common[~scenes.isin(otherwise)]
        if not len(common) and len(otherwise):
            first = [json.loads(side.drawn.loc[otherwise[0]]) for side in (a, b)]
            keys = [key for key in {**first[0], **first[1]} if first[0].get(key) != first[1].get(key)]
            raise refuse(f"all {len(otherwise)} scenes are drawn otherwise: {in_words(keys)}")
        if not len(common):
            raise refuse("no law and scene is in both")
        return cls(runs_a.loc[common], runs_b.loc[common], only_a, only_b, len(otherwise))

    @cached_property
    def differ(self) -> Any:
        """Whether anything but times differs, for each pair."""
        a, b = self.a[list(SCORES)], self.b[list(SCORES)]
        return ((a != b) & ~(a.isna() & b.isna())).any(axis=1)


def _drawn_otherwise(a: Side, b: Side) -> Any:
    """Index of the scenes that both have, with different values."""
    import pandas

    if a.drawn is None or b.drawn is None:
        return pandas.Index([])
    common = a.drawn.index.intersection(b.drawn.index)
    return common[(a.drawn.loc[common] != b.drawn.loc[common]).to_numpy()]


@dataclass(frozen=True, eq=False)
class Group:
    """Pairs that are judged together.

    Attributes
    ----------
    law, place
        The controller's name; family and condition, nothing for chosen scenarios.
    positions
        (n,) of its pairs among all.
    a, b
        pandas.DataFrames of their runs.
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
    found = pairs.a.groupby(level=["controller", *by], sort=False, observed=True).indices
    keys = {key: key if isinstance(key, tuple) else (key,) for key in found}
    return [
        Group(str(law), tuple(map(str, place)), positions, pairs.a.iloc[positions], pairs.b.iloc[positions])
        for (law, *place), positions in ((keys[key], np.sort(found[key])) for key in found)
        if law != BASELINE
    ]
