"""Runs of the same scene with the same law, one of each side."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons import StoredComparison
from ...errors import ConfigurationError, unknown_name
from ..evidence import RUNS, SCENES, Evidence
from ..evidence.campaign import in_words
from ..metrics import METRICS, RESULT_COLUMNS, TIMING_COLUMNS
from ..runs.folder import kind_of
from ..runs.spec import BASELINE
from ..statistics import SCENE


@dataclass(frozen=True)
class Side:
    """One of two comparisons.

    Attributes
    ----------
    folder, manifest
        Where it is stored, and what was run.
    runs
        pandas.DataFrame, one line for each run, with the columns of results.csv behind those of ``key``.
    scene
        Columns that say which scene a run is of.
    group
        Those of them by which results are told apart: none, or family and condition.
    unit
        What the manifest counts, ``runs`` or ``scenes``: as many as were asked for, and as many as are finished.
    drawn
        pandas.Series of what was drawn for each scene, as text, by the columns of ``scene`` but the condition; None
        where scenes are chosen.
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
        """Columns that say which run it is."""
        return (*self.scene, "controller")

    @classmethod
    def load(cls, folder: Path, renamed: Mapping[str, str] | None = None) -> Side:
        """Read a folder of ``compare`` or of ``evidence``.

        Parameters
        ----------
        folder
            Where it is.
        renamed
            Other names for some of its controllers.

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
    # what has few values may have others on the other side
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


SCORES = tuple(metric.column for metric in METRICS if metric.value is not None and metric.column not in TIMING_COLUMNS)
"""The columns that are the same if a run is: all but times."""


@dataclass(frozen=True)
class Pairs:
    """What can be compared, and what cannot.

    Attributes
    ----------
    a, b
        pandas.DataFrames of the runs that both have, in the same order; index and columns as in :class:`Side`.
    only_a, only_b
        Runs that one of them has alone, as lines of names.
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
            if scenes are chosen in one and drawn in the other, starts are drawn from different seeds, or there is no
            pair.
        """
        if a.key != b.key:
            raise ConfigurationError(f"{a.folder} and {b.folder} cannot be compared: only one of them has drawn scenes")
        seeds = [side.manifest["configuration"].get("seed", 0) for side in (a, b)]
        if seeds[0] != seeds[1]:
            raise ConfigurationError(
                f"{a.folder} and {b.folder} cannot be compared: their seeds are {seeds[0]} and {seeds[1]}, so that "
                "their runs are no pairs"
            )
        one, other = (side.runs.set_index(list(side.key)) for side in (a, b))
        common = one.index.intersection(other.index, sort=False)
        only_a, only_b = (side.index.difference(common, sort=False) for side in (one, other))
        strange = _drawn_otherwise(a, b)
        if len(strange):
            common = common[~common.droplevel([name for name in a.key if name not in strange.names]).isin(strange)]
        if not len(common):
            why = "no law and scene is in both"
            if len(strange):
                why = f"all {len(strange)} scenes are drawn otherwise: {_keys_that_differ(a, b, strange[0])}"
            raise ConfigurationError(f"{a.folder} and {b.folder} cannot be compared: {why}")
        return cls(one.loc[common], other.loc[common], only_a.to_frame(False), only_b.to_frame(False), len(strange))

    @cached_property
    def differ(self) -> Any:
        """Whether anything but times is different, for each pair."""
        a, b = self.a[list(SCORES)], self.b[list(SCORES)]
        return ((a != b) & ~(a.isna() & b.isna())).any(axis=1)


def _keys_that_differ(a: Side, b: Side, scene: Any) -> str:
    """What was drawn otherwise for a scene: its keys."""
    one, other = (json.loads(side.drawn.loc[scene]) for side in (a, b))
    return in_words([key for key in dict.fromkeys((*one, *other)) if one.get(key) != other.get(key)])


def _drawn_otherwise(a: Side, b: Side) -> Any:
    """Index of the scenes that both have and were drawn otherwise."""
    import pandas

    if a.drawn is None or b.drawn is None:
        return pandas.Index([])
    common = a.drawn.index.intersection(b.drawn.index)
    return common[(a.drawn.loc[common] != b.drawn.loc[common]).to_numpy()]


LEAST_PAIRS = 6
"""So many pairs have to differ for a test: of fewer, not even all to the same side have p < 0.05, 2 / 2⁵ = 0.0625."""


@dataclass(frozen=True, eq=False)
class Group:
    """Pairs of a law.

    Attributes
    ----------
    law
        The controller's name.
    place
        Family and condition; none where scenes are chosen.
    positions
        (n,) where its pairs stand among all.
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
    """All of them; tracking alone is not judged.

    Parameters
    ----------
    pairs
        All pairs.
    by
        Columns besides the controller by which they are told apart.
    """
    found = pairs.a.groupby(level=["controller", *by], sort=False, observed=True).indices
    return [
        Group(str(law), tuple(map(str, place)), positions, pairs.a.iloc[positions], pairs.b.iloc[positions])
        for (law, *place), positions in ((_tuple(key), np.sort(found[key])) for key in found)
        if law != BASELINE
    ]


def tested(differing: int) -> bool:
    """Whether a test of so many pairs that differ could find anything."""
    return differing >= LEAST_PAIRS


def _tuple(key: Any) -> tuple[Any, ...]:
    return key if isinstance(key, tuple) else (key,)
