"""How laws stand in a condition, and which of them evidence can tell apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from ...comparisons.statistics import distinguishable, mcnemar, rate, simultaneous
from ...comparisons.statistics.judged import MIN_SCENES
from .material import Material
from .words import Share


@dataclass(frozen=True)
class Pair:
    """Two laws on the same scenes.

    Attributes
    ----------
    difference
        Share of the first less that of the second, and its interval: simultaneous for all pairs of the condition, 95 %.
    n
        Scenes.
    """

    difference: Share
    n: int

    @property
    def distinguishable(self) -> bool:
        """Whether the evidence tells them apart."""
        return distinguishable(self.difference.low, self.difference.high, self.n)

    def reversed(self) -> Pair:
        """The second against the first."""
        found = self.difference
        return Pair(Share(-found.value, -found.high, -found.low), self.n)


@dataclass(frozen=True)
class Standing:
    """Laws in a condition, the best first.

    Attributes
    ----------
    condition
        Its name.
    laws
        Names, by their rates; of equal ones in the campaign's order.
    shares
        How often each law does it, in scenes that all of them ran.
    pairs
        Of every two laws, the one that stands first in ``laws`` against the other.
    scenes, families
        How many.
    """

    condition: str
    laws: tuple[str, ...]
    shares: Mapping[str, Share]
    pairs: Mapping[tuple[str, str], Pair]
    scenes: int
    families: int

    @property
    def too_few(self) -> bool:
        """Whether there are too few scenes to tell laws apart."""
        return self.scenes < MIN_SCENES

    def pair(self, first: str, second: str) -> Pair:
        """One law against another."""
        found = self.pairs.get((first, second))
        return self.pairs[second, first].reversed() if found is None else found

    @property
    def leader(self) -> str:
        """The law with the best rate."""
        return self.laws[0]

    @property
    def front(self) -> tuple[str, ...]:
        """The leader, and all laws that are not distinguishable from it."""
        return tuple(law for law in self.laws if law == self.leader or not self.pairs[self.leader, law].distinguishable)

    @property
    def next(self) -> str | None:
        """The best of the laws that are distinguishable from the leader."""
        return next((law for law in self.laws if law not in self.front), None)

    def among(self, laws: Iterable[str]) -> Standing:
        """Some of the laws only; their intervals stay simultaneous for all pairs."""
        chosen = set(laws)
        kept = tuple(law for law in self.laws if law in chosen)
        pairs = {names: pair for names, pair in self.pairs.items() if chosen.issuperset(names)}
        shares = {law: self.shares[law] for law in kept}
        return Standing(self.condition, kept, shares, pairs, self.scenes, self.families)


def standing(
    material: Material, condition: str, column: str = "success", families: Sequence[str] | None = None
) -> Standing:
    """How often a column is true for each law, in the scenes of a condition that all of them ran."""
    key = condition, column, None if families is None else tuple(families)
    return material.once(key, lambda: _worked_out(material, condition, column, families))


def _worked_out(material: Material, condition: str, column: str, families: Sequence[str] | None) -> Standing:
    flags = material.paired(condition, column, families).astype(bool)
    arrays = {law: flags[law].to_numpy() for law in flags.columns}
    # sorting keeps the order of equal ones
    laws = tuple(sorted(arrays, key=lambda law: -int(arrays[law].sum()))) if len(flags) else ()
    names = list(combinations(laws, 2))
    level = simultaneous(0.95, len(names))
    tests = {(a, b): mcnemar(arrays[a], arrays[b], level) for a, b in names}
    pairs = {two: Pair(Share(test.difference, test.low, test.high), test.n) for two, test in tests.items()}
    shares = {law: Share.of(rate(arrays[law])) for law in laws}
    families_there = len(set(flags.index.get_level_values("family")))
    return Standing(condition, laws, shares, pairs, len(flags), families_there)
