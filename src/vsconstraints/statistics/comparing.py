"""Every pair of laws compared on the same scenes, in one table. It needs pandas."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from ..errors import unknown_name
from ..rows import Array
from .correction import holm
from .inputs import FEWEST, checked_confidence
from .judged import LAW, OUTCOMES, SCENE, checked, judged_metric, resolution, values
from .paired import paired
from .rates import mcnemar
from .tables import BY, by_law, frame, groups
from .verdicts import verdict


class Comparison(NamedTuple):
    """A pair of laws: columns of :func:`compare_laws`."""

    scenes: int
    paired: int
    only_a: int
    only_b: int
    difference: float
    low: float
    high: float
    ratio: float
    ratio_low: float
    ratio_high: float
    effect: float
    effect_low: float
    effect_high: float
    p: float


class _Outcome:
    """Pairs compared by a flag."""

    def __init__(self, name: str, confidence: float) -> None:
        self.outcome, self.confidence = OUTCOMES[name], checked_confidence(confidence)
        self.metric = None

    def values(self, runs: Any) -> Any:
        return self.outcome.flag(runs).astype(float)

    def pair(self, a: Array, b: Array) -> Comparison:
        found = mcnemar(a, b, self.confidence)
        sign = 1.0 if self.outcome.better == "more" else -1.0
        gain = sign * np.array([found.difference if found.n else 0.0, found.low, found.high])
        effect, low, high = (1.0 + np.array([gain[0], *np.sort(gain[1:])])) / 2.0
        return Comparison(
            found.n, found.n, found.only_a, found.only_b, found.difference, found.low, found.high,
            math.nan, math.nan, math.nan, float(effect), float(low), float(high), found.p,
        )  # fmt: skip

    def verdict(self, found: Comparison, p: float) -> str:
        rule: dict[str, Any] = {"n": found.paired, "better": self.outcome.better, "confidence": self.confidence}
        return verdict(found.low, found.high, p, **rule)


class _Metric:
    """Pairs compared by a number."""

    def __init__(self, name: str, confidence: float, seed: int, least: float | None) -> None:
        self.metric = judged_metric(name)
        self.confidence, self.seed = checked_confidence(confidence), seed
        self.least = resolution(self.metric) if least is None else least
        self.better: Any = self.metric.better

    def values(self, runs: Any) -> Any:
        return values(runs, self.metric)

    def pair(self, a: Array, b: Array) -> Comparison:
        one, other = ~np.isnan(a), ~np.isnan(b)
        both = one & other
        rule: dict[str, Any] = {"better": self.better, "confidence": self.confidence, "seed": self.seed}
        found = paired(a, b, **rule)
        p, ratios = found.p, (math.nan, math.nan, math.nan)
        if both.any() and min(a[both].min(), b[both].min()) >= 0.0:
            ratio = paired(a, b, "log-ratio", **rule)
            with np.errstate(over="ignore"):  # a ratio beyond 1e308 is infinite
                p, ratios = ratio.p, tuple(np.exp(ratio[:3]).tolist())
        return Comparison(
            len(a), found.n, int((one & ~other).sum()), int((other & ~one).sum()),
            found.median, found.low, found.high, *ratios, found.effect, found.effect_low, found.effect_high, p,
        )  # fmt: skip

    def verdict(self, found: Comparison, p: float) -> str:
        rule: dict[str, Any] = {"n": found.paired, "better": self.better, "confidence": self.confidence}
        return verdict(found.low, found.high, p, least=self.least, **rule)


def compare_laws(
    runs: Any,
    metric: str,
    reference: str | None = None,
    *,
    by: Sequence[str] = BY,
    least: float | None = None,
    confidence: float = 0.95,
    seed: int = 0,
) -> Any:
    """Every pair of laws on the same scenes, by a metric or an outcome; or each law against one reference.

    In an outcome, all scenes are compared that both laws ran. In a metric, those of them in which both runs count
    (:func:`.judged.counts`): ``only_a`` and ``only_b`` say how many more there are in which one does.

    p-values are corrected by Holm's method for all pairs of a group that are tested, those of
    :data:`.inputs.FEWEST` scenes or more. To correct for more, give :func:`.correction.holm` the column ``p`` of all.

    Parameters
    ----------
    runs
        One line per run: the columns :data:`.judged.SCENE`, ``controller``, ``status``, ``violated`` and the metric's.
    metric
        One of :func:`.judged.judged_metrics` or of :data:`.judged.OUTCOMES`.
    reference
        Law that is b in every pair.
    by
        Columns that tell the groups apart.
    least
        Smallest difference that matters; :func:`.judged.resolution` if not given.

    Returns
    -------
    pandas.DataFrame
        ``by``, metric, a, b; scenes (that both ran), paired (that are compared), only_a, only_b; difference, low, high:
        of the rates, or the median over scenes of a − b, as stored; ratio, ratio_low, ratio_high: the median of a/b, by
        logarithms (empty of outcomes and where values are negative); effect, effect_low, effect_high: chance that a is
        better on a scene; p (of McNemar's test; of Wilcoxon's, of logarithms of ratios where there are any, else of
        differences), p_corrected; verdict: what is said of a against b, :func:`.verdicts.verdict`.
    """
    compare = _Outcome(metric, confidence) if metric in OUTCOMES else _Metric(metric, confidence, seed, least)
    known = [str(name) for name in dict.fromkeys(checked(runs, by, compare.metric)[LAW])]
    if reference is not None and reference not in known:
        raise unknown_name("controller", reference, known)
    lines: list[tuple[Any, ...]] = []
    each, ran = (by_law(runs, (*by, *SCENE), column) for column in (compare.values(runs), 1.0))
    for group, own in groups(each, by):
        there = ran.loc[own.index].notna()
        found = []
        for a, b in _pairs([law for law in own.columns if there[law].any()], reference):
            both = (there[a] & there[b]).to_numpy()
            found.append((a, b, compare.pair(own[a].to_numpy()[both], own[b].to_numpy()[both])))
        for (a, b, comparison), p in zip(found, _corrected([comparison for *_, comparison in found]), strict=True):
            lines.append((*group, metric, a, b, *comparison, p, compare.verdict(comparison, p)))
    return frame((*by, "metric", "a", "b", *Comparison._fields, "p_corrected", "verdict"), lines)


def _pairs(laws: Sequence[str], reference: str | None) -> Iterator[tuple[str, str]]:
    if reference is None:
        return combinations(laws, 2)
    return ((law, reference) for law in laws if law != reference and reference in laws)


def _corrected(comparisons: Sequence[Comparison]) -> list[float]:
    """Their p, corrected for each other; what is of too few scenes to be tested is no test, and has 1."""
    tested = np.array([comparison.paired >= FEWEST for comparison in comparisons], dtype=bool)
    corrected = np.ones(len(comparisons))
    corrected[tested] = holm([comparison.p for comparison, ok in zip(comparisons, tested, strict=True) if ok])
    return [float(p) for p in corrected]
