"""Tables of all laws: what each comes to, and every pair compared. They need pandas."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from ..errors import unknown_name
from ..extras import demand
from ..rows import Array
from .correction import holm
from .inputs import checked_confidence
from .judged import LAW, OUTCOMES, SCENE, checked, counts, judged_metric, resolution, values
from .median import median
from .paired import paired
from .rates import mcnemar, rate
from .verdicts import verdict

BY = ("family", "condition")
"""Scenes that have these in common are looked at together."""


def rates(runs: Any, outcome: str = "success", by: Sequence[str] = BY, confidence: float = 0.95) -> Any:
    """How often each law's runs come to an outcome: one line per group and law, of its runs.

    Parameters
    ----------
    runs
        One line per run, with the columns :data:`.judged.SCENE`, ``controller``, ``status`` and ``violated``.
    outcome
        One of :data:`.judged.OUTCOMES`.
    by
        Columns that tell the groups apart.

    Returns
    -------
    pandas.DataFrame
        ``by``, controller, count, of, share, low, high: :class:`.rates.Rate`.
    """
    if outcome not in OUTCOMES:
        raise unknown_name("outcome", outcome, OUTCOMES)
    flags = OUTCOMES[outcome].flag(_checked(runs, by, confidence))
    lines = []
    for group, own in _groups(runs.assign(flag=flags), (*by, LAW)):
        found = rate(own["flag"].to_numpy(bool), confidence)
        lines.append((*group, found.count, found.of, found.share, found.low, found.high))
    return _frame((*by, LAW, "count", "of", "share", "low", "high"), lines)


def medians(runs: Any, metric: str, by: Sequence[str] = BY, confidence: float = 0.95) -> Any:
    """The median of a metric over those of each law's runs that count, and how many do.

    Laws need not count in the same scenes, so these are not to be compared: that is :func:`compare_laws`.

    Returns
    -------
    pandas.DataFrame
        ``by``, controller, counted, of, median, low, high: :class:`.median.Median`.
    """
    judged = judged_metric(metric)
    found = values(_checked(runs, by, confidence), judged)
    lines = []
    for group, own in _groups(runs.assign(value=found), (*by, LAW)):
        middle = median(own["value"].dropna(), confidence)
        lines.append((*group, middle.n, len(own), middle.median, middle.low, middle.high))
    return _frame((*by, LAW, "counted", "of", "median", "low", "high"), lines)


class Costs(NamedTuple):
    """What profiles and ranks are made of.

    Attributes
    ----------
    table
        pandas.DataFrame, one line per scene, one column per law: less is better, ∞ for a run that does not count.
    left_out
        Scenes without a line: a law has not run there, or has no value though its run counts.
    """

    table: Any
    left_out: int


def costs(runs: Any, metric: str) -> Costs:
    """A metric as costs, of all scenes of ``runs``; of a metric of which more is better, less its value."""
    judged = judged_metric(metric)
    found = values(_checked(runs, (), 0.95), judged) * (1.0 if judged.better == "less" else -1.0)
    each = _by_law(runs, SCENE, found.where(counts(runs, judged), np.inf))
    whole = each.dropna()
    return Costs(whole, len(each) - len(whole))


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

    p-values are corrected by Holm's method for all pairs of a group, which are its family; ``comparisons`` says how
    many. To correct for more, give :func:`.correction.holm` the column ``p`` of all of them.

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
        ``by``, metric, a, b, scenes (that both ran), paired (that are compared), only_a, only_b; difference, low, high:
        of the rates, or the median over scenes of a − b, as stored; ratio, ratio_low, ratio_high: the median of a/b,
        empty of outcomes and where values are negative; effect, effect_low, effect_high: chance that a is better on a
        scene; p (of McNemar's test; of Wilcoxon's, of logarithms of ratios where there are any, else of differences),
        comparisons, p_corrected; verdict: what is said of a against b, :func:`.verdicts.verdict`.
    """
    known = [str(name) for name in dict.fromkeys(_checked(runs, by, confidence)[LAW])]
    if reference is not None and reference not in known:
        raise unknown_name("controller", reference, known)
    compare = _Outcome(metric, confidence) if metric in OUTCOMES else _Metric(metric, confidence, seed, least)
    lines: list[tuple[Any, ...]] = []
    data = compare.data(runs)
    for group, own in _groups(runs.assign(value=data, ran=1.0), by):
        each, ran = (_by_law(own, (*by, *SCENE), own[name]) for name in ("value", "ran"))
        found = []
        for a, b in _pairs(sorted(each.columns), reference):
            both = (ran[a].notna() & ran[b].notna()).to_numpy()
            found.append((a, b, compare.pair(each[a].to_numpy()[both], each[b].to_numpy()[both])))
        corrected = holm([comparison.p for _, _, comparison in found])
        for (a, b, comparison), p in zip(found, corrected, strict=True):
            told = compare.verdict(comparison, float(p))
            lines.append((*group, metric, a, b, *comparison, len(found), float(p), told))
    return _frame((*by, "metric", "a", "b", *Comparison._fields, "comparisons", "p_corrected", "verdict"), lines)


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
        self.outcome, self.confidence = OUTCOMES[name], confidence

    def data(self, runs: Any) -> Any:
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
        self.confidence, self.seed = confidence, seed
        self.least = resolution(self.metric) if least is None else least
        self.better: Any = self.metric.better

    def data(self, runs: Any) -> Any:
        return values(runs, self.metric)

    def pair(self, a: Array, b: Array) -> Comparison:
        one, other = ~np.isnan(a), ~np.isnan(b)
        both = one & other
        rule: dict[str, Any] = {"better": self.better, "confidence": self.confidence, "seed": self.seed}
        found = paired(a, b, **rule)
        p, ratios = found.p, (math.nan, math.nan, math.nan)
        if both.any() and min(a[both].min(), b[both].min()) >= 0.0:
            ratio = paired(a, b, "log-ratio", **rule)
            p, ratios = ratio.p, tuple(np.exp([ratio.median, ratio.low, ratio.high]).tolist())
        return Comparison(
            len(a), found.n, int((one & ~other).sum()), int((other & ~one).sum()),
            found.median, found.low, found.high, *ratios, found.effect, found.effect_low, found.effect_high, p,
        )  # fmt: skip

    def verdict(self, found: Comparison, p: float) -> str:
        rule: dict[str, Any] = {"n": found.paired, "better": self.better, "confidence": self.confidence}
        return verdict(found.low, found.high, p, least=self.least, **rule)


def _checked(runs: Any, by: Sequence[str], confidence: float) -> Any:
    checked_confidence(confidence)
    checked(runs, tuple(by))
    return runs


def _pairs(laws: Sequence[str], reference: str | None) -> Iterator[tuple[str, str]]:
    if reference is None:
        return combinations(laws, 2)
    return ((law, reference) for law in laws if law != reference and reference in laws)


def _groups(runs: Any, by: Sequence[str]) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Groups in the order of their names; all runs as one, if nothing tells groups apart."""
    if not by:
        yield (), runs
    else:
        yield from runs.groupby(list(by), observed=True, sort=True)


def _by_law(runs: Any, scene: Sequence[str], value: Any) -> Any:
    """One line per scene, one column per law; NaN where a law has not run."""
    keys = list(dict.fromkeys(scene))
    plain = runs[keys].assign(**{LAW: runs[LAW].astype(str), "value": value})
    return plain.set_index([*keys, LAW])["value"].unstack(LAW)


def _frame(columns: Sequence[str], lines: Sequence[tuple[Any, ...]]) -> Any:
    demand("evidence")
    import pandas

    return pandas.DataFrame(lines, columns=list(columns))
