"""Ranking of controllers by success rate, and paired comparisons on the same scenes."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

from ...reports.markdown import bold, enumeration, first_names, plain
from ...reports.numbers import DASH, number, percentage
from ...rows.readable import counted
from ..statistics import (
    Rate,
    compare_laws,
    distinguishable,
    mcnemar,
    rate,
    simultaneous,
)
from ..statistics.judged import MIN_SCENES, judged_metric
from .dataset import SCENE, Dataset

if TYPE_CHECKING:
    import pandas as pd

#: Conditions as text at the beginning of a sentence.
CONDITIONS = {
    "nominal": "Without disturbances",
    "disturbed": "With disturbances",
    "limited": "Under the arms' own limits",
    "calibrated": "With calibration errors",
    "dynamics": "On arms with mass",
    "images": "By images",
    "images-and-dynamics": "By images and on arms with mass",
}
MAX_NAMES = 4  #: Most controllers that a sentence names.


def condition_text(condition: str, inside: bool = False) -> str:
    """Return a condition as text for the beginning or the inside of a sentence."""
    text = CONDITIONS.get(condition, f"In the condition {plain(condition)}")
    return text[0].lower() + text[1:] if inside else text


def scenes_text(scenes: int, families: int) -> str:
    """Return the number of scenes and families as text."""
    return f"{counted(scenes, 'scene')} of {counted(families, 'family', 'families')}"


def names_text(names: Sequence[str]) -> str:
    """Return the names as text, or the first of them and the number of the others."""
    return enumeration(first_names(names, MAX_NAMES))


class Share(NamedTuple):
    """Share from 0 to 1, or difference of two, with its interval; printed in per cent."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, rate: Rate) -> Share:
        """Return the share of a rate."""
        return cls(rate.share, rate.low, rate.high)

    @property
    def complement(self) -> Share:
        """Share of the opposite outcome."""
        return Share(1.0 - self.value, 1.0 - self.high, 1.0 - self.low)

    @property
    def reversed(self) -> Share:
        """Difference with the opposite sign."""
        return Share(-self.value, -self.high, -self.low)

    @property
    def digits(self) -> int:
        """Number of decimals that the interval can resolve."""
        half = 50.0 * (self.high - self.low)
        if not math.isfinite(half) or half <= 0.0:
            return 1
        digits = math.ceil(-math.log10(half / 3.0))
        return min(max(digits, 0), 4)

    def _texts(self) -> tuple[str, str]:
        """Return the value and its interval as texts without a unit."""
        value, low, high = (percentage(share, self.digits) for share in self)
        return value, f"{low}{_range_sign(self.low)}{high}"

    @property
    def cell(self) -> str:
        """Share for tables in per cent, as ``93.0 (91.2–94.6)``."""
        if not math.isfinite(self.value):
            return DASH
        value, interval = self._texts()
        return f"{value} ({interval})"

    @property
    def text(self) -> str:
        """Share for sentences, as ``93.0 % (91.2–94.6 %)``."""
        value, interval = self._texts()
        return f"{value} % ({interval} %)"

    @property
    def points(self) -> str:
        """Difference of two shares, as ``1.7 points (0.6–3.0)``."""
        value, interval = self._texts()
        return f"{value} points ({interval})"

    def numbers(
        self, name: str, low: str = "low", high: str = "high", law: str = ""
    ) -> dict[str, float]:
        """Return the value and its interval by these names, with the controller if given."""
        of = f"[{law}]" if law else ""
        return {name + of: self.value, low + of: self.low, high + of: self.high}


def _range_sign(low: float) -> str:
    """Return the text between the limits of an interval.

    A dash next to a negative number would be read as a sign.
    """
    return " to " if low < 0.0 else "–"


class Ranking(NamedTuple):
    """Controllers in a condition, the best first.

    ``shares`` are success rates in scenes that all controllers ran. ``differences`` are the
    differences of the rates of each two, with 95 % intervals simultaneous for all pairs of the
    condition.
    """

    condition: str
    laws: tuple[str, ...]
    shares: Mapping[str, Share]
    differences: Mapping[tuple[str, str], Share]
    scenes: int
    families: int

    @property
    def scenes_text(self) -> str:
        """Number of scenes and families as text."""
        return scenes_text(self.scenes, self.families)

    @property
    def too_few(self) -> bool:
        """True if there are too few scenes for any difference to be significant."""
        return self.scenes < MIN_SCENES

    def significant(self, first: str, second: str) -> bool:
        """Return True if two controllers differ significantly."""
        _, low, high = self.differences[first, second]
        return distinguishable(low, high, self.scenes)

    @property
    def leader(self) -> str:
        """Controller with the best rate."""
        return self.laws[0]

    @property
    def hopeless(self) -> bool:
        """True if no controller ever succeeds."""
        return self.shares[self.leader].value == 0.0

    @property
    def front(self) -> tuple[str, ...]:
        """Leader, and all controllers that do not differ significantly from it."""
        others = self.laws[1:]
        equal = [law for law in others if not self.significant(self.leader, law)]
        return (*self.laws[:1], *equal)

    @property
    def next(self) -> str | None:
        """Best of the controllers that differ significantly from the leader, None without any."""
        return next((law for law in self.laws if law not in self.front), None)

    def among(self, laws: Iterable[str]) -> Ranking:
        """Return the ranking of some controllers; intervals stay simultaneous for all pairs."""
        chosen = set(laws)
        in_order = tuple(law for law in self.laws if law in chosen)
        return self._replace(laws=in_order)

    def cell(self, law: str, complement: bool = False) -> str:
        """Format the success rate of a controller, or its complement.

        It is bold if significantly the best, and marked with ≈ if not significantly worse.
        """
        if law not in self.shares:
            return DASH
        share = self.shares[law]
        text = share.complement.cell if complement else share.cell
        has_winner = complement or not self.hopeless
        if len(self.laws) < 2 or not has_winner or law not in self.front:
            return text
        return bold(text) if len(self.front) == 1 else f"≈ {text}"

    @property
    def named_front(self) -> str:
        """Controllers of the front with their shares, or the first and the number of the others."""
        texts = []
        for name in first_names(self.front, MAX_NAMES):
            is_law = name in self.shares  # or the number of the others
            texts.append(f"{bold(name)} {self.shares[name].text}" if is_law else name)
        return enumeration(texts)


def ranking(
    dataset: Dataset, condition: str, column: str = "success", families: Sequence[str] | None = None
) -> Ranking:
    """Rank controllers by how often a column is true.

    Only scenes of the condition that all controllers ran are used.
    """

    def compute() -> Ranking:
        return ranked(dataset.paired(condition, column, families), condition)

    chosen = None if families is None else tuple(families)
    return dataset.once((condition, column, chosen), compute)


def kept_ranking(dataset: Dataset, condition: str, column: str = "kept") -> Ranking:
    """Rank controllers by how often rows are kept, without those all of whose runs failed."""
    return ranking(dataset, condition, column).among(dataset.working(condition))


def ranked(flags: pd.DataFrame, condition: str) -> Ranking:
    """Rank controllers from flags with one line per scene and one column per controller.

    The first level of the index is the family of a scene.
    """
    if flags.empty:
        return Ranking(condition, (), {}, {}, 0, 0)
    flags = flags.astype(bool)
    # A stable sort keeps the order of ties.
    counts = flags.sum().sort_values(ascending=False, kind="stable")
    laws = tuple(map(str, counts.index))
    successes = {}
    shares = {}
    for law in laws:
        successes[law] = flags[law].to_numpy()
        shares[law] = Share.of(rate(successes[law]))
    pairs = list(combinations(laws, 2))
    level = simultaneous(0.95, len(pairs))
    differences = {}
    for a, b in pairs:
        tested = mcnemar(successes[a], successes[b], level)
        difference = Share(tested.difference, tested.low, tested.high)
        differences[a, b] = difference
        differences[b, a] = difference.reversed
    families = flags.index.get_level_values(0)
    return Ranking(
        condition,
        laws,
        shares,
        differences,
        scenes=len(flags),
        families=families.nunique(),
    )


class PairVerdict(NamedTuple):
    """Comparison of one controller with another by a measure in one condition.

    ``difference`` is that of the rates, or the median of the difference or ratio over the scenes in
    which the two differ. Its interval is simultaneous for all pairs, and ``p`` is corrected for all
    pairs. ``scenes`` are compared, and ``differ`` of them differ. ``verdict`` is better, worse, not
    distinguishable or too few.
    """

    difference: float
    low: float
    high: float
    p: float
    scenes: int
    differ: int
    verdict: str

    def reversed(self, ratio: bool) -> PairVerdict:
        """Return the comparison of the second controller with the first one.

        ``ratio`` is True if the difference is a ratio.
        """
        inverse = _reciprocal if ratio else operator.neg
        opposite = {"better": "worse", "worse": "better"}
        return self._replace(
            difference=inverse(self.difference),
            low=inverse(self.high),
            high=inverse(self.low),
            verdict=opposite.get(self.verdict, self.verdict),
        )


def _reciprocal(ratio: float) -> float:
    return 1.0 / ratio if ratio else math.inf


def finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return numbers for files, with None for those that are not finite."""
    found = {}
    for name, value in numbers.items():
        is_number = not isinstance(value, float) or math.isfinite(value)
        found[name] = value if is_number else None
    return found


PairVerdicts = dict[tuple[str, str], PairVerdict]  #: Verdicts by pair of controllers.


def pairwise_verdicts(runs: Any, metric: str, *, ratio: bool = False) -> PairVerdicts:
    """Compare every controller with every other one on the same scenes.

    The measure is an outcome or the difference or ratio of a metric.
    """
    verdicts: PairVerdicts = {}
    for line in compare_laws(runs, metric, by=()).itertuples():
        if ratio:
            estimate = (line.ratio, line.ratio_low, line.ratio_high)
        else:
            estimate = (line.difference, line.low, line.high)
        tested = (line.p_corrected, line.paired, line.differ)
        verdict = PairVerdict(*estimate, *tested, line.verdict)
        verdicts[line.a, line.b] = verdict
        verdicts[line.b, line.a] = verdict.reversed(ratio)
    return verdicts


def best_by(
    dataset: Dataset, condition: str, laws: Sequence[str], metric: str, ratio: bool = False
) -> tuple[list[str], PairVerdicts] | None:
    """Return the best controllers by the median of a metric, and the verdicts of all pairs.

    The best one is followed by its ties. Only scenes in which all succeed are used. Return None
    without such scenes, or for fewer than two controllers.
    """
    laws = list(laws)
    values = dataset.paired(condition, metric)[laws].astype(float)
    success = dataset.paired(condition, "success")[laws].astype(bool)
    # One set of scenes for all laws, so that the same scenes decide which law is first.
    values = values[success.all(axis=1)].dropna()
    if len(laws) < 2 or values.empty:
        return None
    medians = values.median()
    less_is_better = judged_metric(metric).better == "less"
    first = str(medians.idxmin() if less_is_better else medians.idxmax())
    runs = dataset.among(condition)
    runs = runs[runs["controller"].isin(laws)]
    in_scenes = runs.set_index(SCENE).index.isin(values.index)
    pairs = pairwise_verdicts(runs[in_scenes], metric, ratio=ratio)
    best = [first]
    for law in laws:
        if law != first and pairs[first, law].verdict != "better":
            best.append(law)
    return best, pairs


def gap(pair: PairVerdict, factor: float = 1.0) -> str:
    """Format a median difference with its interval, after ≈ if it is not significant."""
    if not pair.scenes:
        return DASH
    text = number(factor * pair.difference)
    if pair.verdict not in ("better", "worse"):
        text = f"≈ {text}"
    low = factor * pair.low
    high = factor * pair.high
    if math.isfinite(low) and math.isfinite(high) and low != high:
        text += f" ({number(low)}{_range_sign(low)}{number(high)})"
    return text
