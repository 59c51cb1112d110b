"""Controllers ranked by how often they succeed, and compared in pairs on the same scenes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import inf, isfinite
from typing import Any, NamedTuple

from ...comparisons.statistics import compare_laws, distinguishable, mcnemar, rate, simultaneous
from ...comparisons.statistics.judged import MIN_SCENES, judged_metric
from ...rows.readable import counted
from ..numbers import number
from .dataset import Dataset
from .formatting import Share, percentage


@dataclass(frozen=True)
class Pair:
    """Two controllers on the same scenes.

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
        """Whether they differ significantly."""
        return distinguishable(self.difference.low, self.difference.high, self.n)

    def reversed(self) -> Pair:
        """The second against the first."""
        share = self.difference
        return Pair(Share(-share.value, -share.high, -share.low), self.n)


@dataclass(frozen=True)
class Ranking:
    """Controllers in a condition, the best first.

    Attributes
    ----------
    condition
        Its name.
    laws
        Names, by their rates; of equal ones in the campaign's order.
    shares
        How often each succeeds, in scenes that all of them ran.
    pairs
        Of every two, the one that comes first in ``laws`` against the other.
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
        """Whether there are too few scenes for any difference to be significant."""
        return self.scenes < MIN_SCENES

    def pair(self, first: str, second: str) -> Pair:
        """One controller against another."""
        pair = self.pairs.get((first, second))
        return self.pairs[second, first].reversed() if pair is None else pair

    @property
    def leader(self) -> str:
        """The controller with the best rate."""
        return self.laws[0]

    @property
    def front(self) -> tuple[str, ...]:
        """The leader, and all that do not differ significantly from it."""
        return tuple(law for law in self.laws if law == self.leader or not self.pairs[self.leader, law].distinguishable)

    @property
    def next(self) -> str | None:
        """The best of those that differ significantly from the leader."""
        return next((law for law in self.laws if law not in self.front), None)

    def among(self, laws: Iterable[str]) -> Ranking:
        """Some of the controllers only; their intervals stay simultaneous for all pairs."""
        chosen = set(laws)
        kept = tuple(law for law in self.laws if law in chosen)
        pairs = {names: pair for names, pair in self.pairs.items() if chosen.issuperset(names)}
        shares = {law: self.shares[law] for law in kept}
        return Ranking(self.condition, kept, shares, pairs, self.scenes, self.families)


def ranking(
    dataset: Dataset, condition: str, column: str = "success", families: Sequence[str] | None = None
) -> Ranking:
    """How often a column is true for each controller, in the scenes of a condition that all of them ran."""
    key = condition, column, None if families is None else tuple(families)
    return dataset.once(key, lambda: _ranked(dataset, condition, column, families))


def _ranked(dataset: Dataset, condition: str, column: str, families: Sequence[str] | None) -> Ranking:
    flags = dataset.paired(condition, column, families).astype(bool)
    arrays = {law: flags[law].to_numpy() for law in flags.columns}
    # sorting keeps the order of equal ones
    laws = tuple(sorted(arrays, key=lambda law: -int(arrays[law].sum()))) if len(flags) else ()
    names = list(combinations(laws, 2))
    level = simultaneous(0.95, len(names))
    tests = {(a, b): mcnemar(arrays[a], arrays[b], level) for a, b in names}
    pairs = {two: Pair(Share(test.difference, test.low, test.high), test.n) for two, test in tests.items()}
    shares = {law: Share.of(rate(arrays[law])) for law in laws}
    families_there = len(set(flags.index.get_level_values("family")))
    return Ranking(condition, laws, shares, pairs, len(flags), families_there)


class Measure(NamedTuple):
    """What two controllers are compared by.

    Attributes
    ----------
    name
        Of an outcome or a metric of :mod:`vsconstraints.comparisons.statistics`.
    words, title
        Its name in sentences and headings.
    margin
        Equivalence margin: the smallest reversal that would matter, as a difference or a ratio.
    more
        Whether more is better.
    ratio
        Whether values are compared by their ratio, and not by their difference, in per cent.
    """

    name: str
    words: str
    title: str
    margin: float
    more: bool = False
    ratio: bool = False

    def excludes(self, pair: PairVerdict) -> bool:
        """Whether an interval excludes that the first controller is worse by the margin or more."""
        return pair.low > -self.margin if self.more else pair.high < self.margin

    @property
    def margin_text(self) -> str:
        """The margin, for a table's cell."""
        return f"× {number(self.margin)}" if self.ratio else counted(round(100.0 * self.margin), "point")


MEASURES = (
    Measure("success", "success", "Success", 0.1, more=True),
    Measure("violation", "violation", "Violation", 0.1),
    Measure("utilization", "space", "Utilization, where both succeed", 0.01, more=True),
    Measure("acceleration_variation", "chattering", "Acceleration variation, where both succeed", 1.25, ratio=True),
)
"""What conclusions are about. The margins are a choice: half of what separates neighbors in the study of all families
by success and violation, a hundredth of the space, a quarter of the variation."""


class PairVerdict(NamedTuple):
    """One controller against another by a measure, in one condition.

    Attributes
    ----------
    difference, low, high
        Of the rates, or the median of the difference or ratio of values over the scenes in which they differ: the
        first controller's against the other's. The interval is simultaneous for all pairs.
    p
        Corrected for all pairs.
    scenes, differ
        How many are compared, and in how many of them the two differ.
    verdict
        ``better``, ``worse``, ``not distinguishable`` or ``too few``.
    """

    difference: float
    low: float
    high: float
    p: float
    scenes: int
    differ: int
    verdict: str

    def as_data(self) -> dict[str, Any]:
        """For files: what is not finite is None."""
        return {name: None if isinstance(v, float) and not isfinite(v) else v for name, v in self._asdict().items()}

    def text(self, measure: Measure) -> str:
        """The difference, for a table's cell."""
        return f"× {number(self.difference)}" if measure.ratio else f"{percentage(self.difference, 1)} %"


PairVerdicts = dict[tuple[str, str], PairVerdict]
"""Every controller against every other one."""


def pairwise_verdicts(runs: Any, metric: str, *, ratio: bool = False) -> PairVerdicts:
    """Every controller against every other one on the same scenes, by a metric's ratio or difference or an outcome."""
    verdicts: PairVerdicts = {}
    for line in compare_laws(runs, metric, by=()).itertuples():
        ends = (line.ratio, line.ratio_low, line.ratio_high) if ratio else (line.difference, line.low, line.high)
        swapped = [1.0 / end if end else inf for end in ends] if ratio else [-end for end in ends]
        against = {"better": "worse", "worse": "better"}.get(line.verdict, line.verdict)
        same = line.p_corrected, line.paired, line.differ
        verdicts[line.a, line.b] = PairVerdict(*ends, *same, line.verdict)
        verdicts[line.b, line.a] = PairVerdict(swapped[0], swapped[2], swapped[1], *same, against)
    return verdicts


@dataclass(frozen=True)
class Best:
    """The best of some controllers by a metric, on the scenes in which all of them succeed.

    Attributes
    ----------
    laws
        The best, and those that do not differ significantly from it.
    pairs
        Every controller against every other one.
    scenes
        How many scenes there are.
    """

    laws: tuple[str, ...]
    pairs: PairVerdicts
    scenes: int


def best_by(dataset: Dataset, condition: str, laws: Sequence[str], metric: str, ratio: bool = False) -> Best | None:
    """The best by the median of a metric over scenes in which all of these succeed; None where there are none."""
    runs = dataset.among(condition)
    runs = runs[runs["controller"].isin(list(laws))]
    values = dataset.paired(condition, metric)[list(laws)].astype(float)
    clean = dataset.paired(condition, "success").astype(bool)[list(laws)].all(axis=1) & values.notna().all(axis=1)
    values = values[clean]
    if len(laws) < 2 or values.empty:
        return None
    scenes = set(values.index)
    chosen = runs[[key in scenes for key in zip(runs["family"], runs["scene"], strict=True)]]
    medians = values.median()
    first = str(medians.idxmin() if judged_metric(metric).better == "less" else medians.idxmax())
    pairs = pairwise_verdicts(chosen, metric, ratio=ratio)  # of all: the same scenes say which is first
    ties = (law for law in laws if law != first and pairs[first, law].verdict != "better")
    return Best((first, *ties), pairs, len(values))
