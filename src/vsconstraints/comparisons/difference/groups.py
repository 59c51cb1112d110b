"""Pairs that are judged together: those of a law, and of a family and condition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..runs.spec import BASELINE
from .pairs import Pairs

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
