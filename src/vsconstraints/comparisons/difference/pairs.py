"""Runs of the same scene with the same law, one of each side."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ...errors import ConfigurationError
from ..evidence.identity import in_words
from ..metrics import METRICS, TIMING_COLUMNS
from .sides import Side

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
