"""Conditions that are a full factorial of levels, such as speed × latency × noise, found from a family's table."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import product
from typing import Any, NamedTuple

from ...scenarios.families.family import NOMINAL, TOGETHER

MIN_LEVELS = 3  #: Of the first factor, over which curves are drawn.


class Factorial(NamedTuple):
    """Levels of each factor, the nominal one first and the factor with most levels first; conditions by their levels.

    Only levels and conditions that were run are in it.
    """

    factors: tuple[tuple[str, ...], ...]
    conditions: Mapping[tuple[str, ...], str]

    @classmethod
    def of(cls, table: Mapping[str, Mapping[str, Any]], run: Collection[str]) -> Factorial | None:
        """That of a family's table of conditions, of which some were run; None if there is none to draw curves of.

        Conditions that name others together are combinations. Levels that never come together are of one factor.
        """
        combined = {frozenset(said[TOGETHER]): name for name, said in table.items() if [*said] == [TOGETHER]}
        factors: list[list[str]] = []
        for level in (name for name in table if any(name in levels for levels in combined)):
            apart = (own for own in factors if not any({level, other} <= one for one in combined for other in own))
            own = next(apart, None)
            if own is None:
                factors.append(own := [NOMINAL])
            own.append(level)
        factors.sort(key=len, reverse=True)
        names = {frozenset(): NOMINAL, **{frozenset([name]): name for own in factors for name in own[1:]}, **combined}
        cells = {levels: names.get(frozenset(levels) - {NOMINAL}) for levels in product(*factors)}
        there = {levels: name for levels, name in cells.items() if name is not None and name in run}
        kept = tuple(tuple(own for own in one if any(c[k] == own for c in there)) for k, one in enumerate(factors))
        full = None not in cells.values() and kept and len(kept[0]) >= MIN_LEVELS
        return cls(kept, there) if full else None
