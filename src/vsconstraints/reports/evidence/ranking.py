"""Controllers ranked by how often they succeed, and compared in pairs on the same scenes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

from ...comparisons.statistics import (
    Rate,
    compare_laws,
    distinguishable,
    mcnemar,
    rate,
    simultaneous,
)
from ...comparisons.statistics.judged import MIN_SCENES, judged_metric
from ...rows.readable import counted
from ..markdown import bold, enumeration, first_names, plain
from ..numbers import DASH, number, percentage
from .dataset import Dataset

if TYPE_CHECKING:
    import pandas as pd

#: What conditions are called at the beginning of a sentence.
CONDITIONS = {
    "nominal": "Without disturbances",
    "disturbed": "With disturbances",
    "limited": "Under the arms' own limits",
    "calibrated": "With calibration errors",
    "dynamics": "On arms with mass",
    "images": "By images",
    "images-and-dynamics": "By images and on arms with mass",
}
MAX_NAMES = 4  #: A sentence names no more controllers than this.


def condition_text(condition: str, inside: bool = False) -> str:
    """The beginning of a sentence on a condition, or the same inside a sentence."""
    text = CONDITIONS.get(condition, f"In the condition {plain(condition)}")
    return text[0].lower() + text[1:] if inside else text


def scenes_text(scenes: int, families: int) -> str:
    """How many scenes, of how many families."""
    return f"{counted(scenes, 'scene')} of {counted(families, 'family', 'families')}"


def names_text(names: Sequence[str]) -> str:
    """The names, or the first of them and how many more there are."""
    return enumeration(first_names(names, MAX_NAMES))


class Share(NamedTuple):
    """A share from 0 to 1, or a difference of two, and its interval; printed in per cent."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, rate: Rate) -> Share:
        """The share of a rate."""
        return cls(rate.share, rate.low, rate.high)

    @property
    def complement(self) -> Share:
        """How often it does not happen."""
        return Share(1.0 - self.value, 1.0 - self.high, 1.0 - self.low)

    @property
    def reversed(self) -> Share:
        """The difference the other way round."""
        return Share(-self.value, -self.high, -self.low)

    @property
    def digits(self) -> int:
        """Decimals: as many as the interval can resolve, and no more."""
        half = 50.0 * (self.high - self.low)
        return (
            min(max(math.ceil(-math.log10(half / 3.0)), 0), 4)
            if math.isfinite(half) and half > 0.0
            else 1
        )

    def _texts(self) -> tuple[str, str]:
        """The value and its interval, without a unit."""
        value, low, high = (percentage(one, self.digits) for one in self)
        # a dash before or behind a negative number would be read as a sign
        return value, f"{low}{' to ' if self.low < 0.0 else '–'}{high}"

    @property
    def cell(self) -> str:
        """``93.0 (91.2–94.6)``, for tables in per cent."""
        return "{} ({})".format(*self._texts()) if math.isfinite(self.value) else DASH

    @property
    def text(self) -> str:
        """``93.0 % (91.2–94.6 %)``."""
        return "{} % ({} %)".format(*self._texts())

    @property
    def points(self) -> str:
        """``1.7 points (0.6–3.0)``, of a difference of two shares."""
        return "{} points ({})".format(*self._texts())

    def numbers(
        self, name: str, low: str = "low", high: str = "high", law: str = ""
    ) -> dict[str, float]:
        """The three numbers by these names, of a controller if one is named."""
        of = f"[{law}]" if law else ""
        return {name + of: self.value, low + of: self.low, high + of: self.high}


class Ranking(NamedTuple):
    """Controllers in a condition, the best first.

    ``shares`` say how often each succeeds, in scenes that all of them ran; ``differences`` by how
    much each of two does more often than the other, with 95 % intervals simultaneous for all pairs
    of the condition.
    """

    condition: str
    laws: tuple[str, ...]
    shares: Mapping[str, Share]
    differences: Mapping[tuple[str, str], Share]
    scenes: int
    families: int

    @property
    def scenes_text(self) -> str:
        """How many scenes of how many families."""
        return scenes_text(self.scenes, self.families)

    @property
    def too_few(self) -> bool:
        """Whether there are too few scenes for any difference to be significant."""
        return self.scenes < MIN_SCENES

    def significant(self, first: str, second: str) -> bool:
        """Whether two controllers differ significantly."""
        _, low, high = self.differences[first, second]
        return distinguishable(low, high, self.scenes)

    @property
    def leader(self) -> str:
        """The controller with the best rate."""
        return self.laws[0]

    @property
    def hopeless(self) -> bool:
        """Whether no controller ever succeeds."""
        return self.shares[self.leader].value == 0.0

    @property
    def front(self) -> tuple[str, ...]:
        """The leader, and all that do not differ significantly from it."""
        return tuple(
            law for law in self.laws if law == self.leader or not self.significant(self.leader, law)
        )

    @property
    def next(self) -> str | None:
        """The best of those that differ significantly from the leader."""
        return next((law for law in self.laws if law not in self.front), None)

    def among(self, laws: Iterable[str]) -> Ranking:
        """Some of the controllers only; their intervals stay simultaneous for all pairs."""
        chosen = set(laws)
        return self._replace(laws=tuple(law for law in self.laws if law in chosen))

    def cell(self, law: str, complement: bool = False) -> str:
        """How often one succeeds, or does not: bold if significantly the best, ≈ if not
        significantly worse.
        """
        if law not in self.shares:
            return DASH
        share = self.shares[law]
        text = (share.complement if complement else share).cell
        if (
            len(self.laws) < 2
            or law not in self.laws
            or law not in self.front
            or (self.hopeless and not complement)
        ):
            return text
        return bold(text) if len(self.front) == 1 else f"≈ {text}"

    @property
    def named_front(self) -> str:
        """Those in front with their shares, or the first of them and how many more there are."""
        texts = first_names(self.front, MAX_NAMES)
        return enumeration(
            [f"{bold(law)} {self.shares[law].text}" if law in self.shares else law for law in texts]
        )


def ranking(
    dataset: Dataset, condition: str, column: str = "success", families: Sequence[str] | None = None
) -> Ranking:
    """How often a column is true for each controller, in the scenes of a condition that all of them
    ran.
    """
    key = (condition, column, None if families is None else tuple(families))
    return dataset.once(key, lambda: ranked(dataset.paired(condition, column, families), condition))


def kept_ranking(dataset: Dataset, condition: str, column: str = "kept") -> Ranking:
    """How often rows are kept, of controllers not all of whose runs failed."""
    return ranking(dataset, condition, column).among(dataset.working(condition))


def ranked(flags: pd.DataFrame, condition: str) -> Ranking:
    """The same from one line per scene, whose index begins with its family, and one column per
    controller.
    """
    arrays = {law: flags[law].to_numpy(bool) for law in flags.columns}
    # sorting keeps the order of equal ones
    laws = tuple(sorted(arrays, key=lambda law: -int(arrays[law].sum()))) if len(flags) else ()
    pairs = list(combinations(laws, 2))
    level = simultaneous(0.95, len(pairs))
    differences = {(a, b): Share(*mcnemar(arrays[a], arrays[b], level)[:3]) for a, b in pairs}
    differences |= {(b, a): share.reversed for (a, b), share in differences.items()}
    shares = {law: Share.of(rate(arrays[law])) for law in laws}
    return Ranking(
        condition, laws, shares, differences, len(flags), len(set(flags.index.get_level_values(0)))
    )


class PairVerdict(NamedTuple):
    """One controller against another by a measure, in one condition.

    ``difference`` with the ends of its interval, simultaneous for all pairs, is that of the rates,
    or the median of the difference or ratio over the scenes in which the two differ; ``p`` is
    corrected for all pairs; ``scenes`` are compared, and in ``differ`` of them they differ.
    ``verdict``: better, worse, not distinguishable or too few.
    """

    difference: float
    low: float
    high: float
    p: float
    scenes: int
    differ: int
    verdict: str


def finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """The same for files: None where a number is not finite."""
    return {
        name: None if isinstance(x, float) and not math.isfinite(x) else x
        for name, x in numbers.items()
    }


PairVerdicts = dict[tuple[str, str], PairVerdict]  #: Every controller against every other one.


def pairwise_verdicts(runs: Any, metric: str, *, ratio: bool = False) -> PairVerdicts:
    """Every controller against every other one on the same scenes, by a metric's ratio or
    difference or an outcome.
    """
    verdicts: PairVerdicts = {}
    for line in compare_laws(runs, metric, by=()).itertuples():
        ends = (
            (line.ratio, line.ratio_low, line.ratio_high)
            if ratio
            else (line.difference, line.low, line.high)
        )
        middle, high, low = (
            [1.0 / end if end else math.inf for end in ends] if ratio else [-end for end in ends]
        )
        against = {"better": "worse", "worse": "better"}.get(line.verdict, line.verdict)
        same = line.p_corrected, line.paired, line.differ
        verdicts[line.a, line.b] = PairVerdict(*ends, *same, line.verdict)
        verdicts[line.b, line.a] = PairVerdict(middle, low, high, *same, against)
    return verdicts


def best_by(
    dataset: Dataset, condition: str, laws: Sequence[str], metric: str, ratio: bool = False
) -> tuple[list[str], PairVerdicts] | None:
    """The best by the median of a metric over scenes in which all succeed, with its ties, and all
    pairs; or None.
    """
    values = dataset.paired(condition, metric)[list(laws)].astype(float)
    clean = dataset.paired(condition, "success").astype(bool)[list(laws)].all(
        axis=1
    ) & values.notna().all(axis=1)
    values = values[clean]
    if len(laws) < 2 or values.empty:
        return None
    runs = dataset.among(condition)
    chosen = runs["controller"].isin(list(laws)) & runs.set_index(["family", "scene"]).index.isin(
        values.index
    )
    medians = values.median()
    first = str(medians.idxmin() if judged_metric(metric).better == "less" else medians.idxmax())
    # of all: the same scenes say which is first
    pairs = pairwise_verdicts(runs[chosen], metric, ratio=ratio)
    return [
        first,
        *(law for law in laws if law != first and pairs[first, law].verdict != "better"),
    ], pairs


def gap(pair: PairVerdict, factor: float = 1.0) -> str:
    """A median difference with its interval; ≈ in front where it is not significant."""
    if not pair.scenes:
        return DASH
    middle, low, high = (factor * value for value in pair[:3])
    tie = "" if pair.verdict in ("better", "worse") else "≈ "
    known = math.isfinite(low) and math.isfinite(high) and low != high
    between = " to " if low < 0.0 else "–"
    return f"{tie}{number(middle)}{f' ({number(low)}{between}{number(high)})' if known else ''}"
