"""Tables of rates and medians of each law, and of all pairs of laws on the same scenes.

They require pandas.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.rates import checked_confidence
from ...errors import unknown_name
from ...plugins.extras import demand
from ...rows import Array
from .judged import (
    LAW,
    MIN_SCENES,
    OUTCOMES,
    SCENE,
    Better,
    checked,
    counts,
    judged_metric,
    resolution,
    simultaneous,
    values,
    verdict,
)
from .rates import mcnemar, median, paired, rate

BY = ("family", "condition")  #: columns that define the groups of scenes


def rates(
    runs: Any, outcome: str = "success", by: Sequence[str] = BY, confidence: float = 0.95
) -> Any:
    """Return the rate of an outcome for each group and law.

    ``outcome`` is one of :data:`.judged.OUTCOMES`. Groups are defined by the columns ``by``.
    ``runs`` has the columns :data:`.judged.SCENE`, ``controller``, ``status`` and ``violated``. The
    returned pandas.DataFrame has the columns ``by``, controller, count, of, share, low, high:
    :class:`.rates.Rate`.
    """
    if outcome not in OUTCOMES:
        raise unknown_name("outcome", outcome, OUTCOMES)
    flags = OUTCOMES[outcome].flag(checked(runs, by))
    key = (*by, LAW)
    lines = []
    for group, group_runs in _groups(runs.assign(flag=flags), key):
        result = rate(group_runs["flag"].to_numpy(bool), confidence)
        counts = (result.count, result.of)
        lines.append((*group, *counts, result.share, result.low, result.high))
    return _frame((*key, "count", "of", "share", "low", "high"), lines)


def medians(runs: Any, metric: str, by: Sequence[str] = BY, confidence: float = 0.95) -> Any:
    """Return the median of a metric over the runs that count, for each group and law.

    These medians are over different scenes for each law. To compare laws, see :func:`compare_laws`.
    Columns: ``by``, controller, counted, of, median, low, high (:class:`.rates.Median`).
    """
    judged = judged_metric(metric)
    column = values(checked(runs, by, judged), judged)
    key = (*by, LAW)
    lines = []
    for group, group_runs in _groups(runs.assign(value=column), key):
        counted = group_runs["value"].dropna()
        middle, low, high, n = median(counted, confidence)
        lines.append((*group, n, len(group_runs), middle, low, high))
    return _frame((*key, "counted", "of", "median", "low", "high"), lines)


class Costs(NamedTuple):
    """Costs as pandas.DataFrame with one line per scene and one column per law.

    Smaller is better, and a run that does not count has infinite cost. ``left_out`` counts the
    scenes without a line: a law has not run there, or has no value although its run counts.
    """

    table: Any
    left_out: int


def costs(runs: Any, metric: str) -> Costs:
    """Return a metric as costs in all scenes of ``runs``.

    If larger values of the metric are better, the cost is the negative value.
    """
    judged = judged_metric(metric)
    result = values(checked(runs, (), judged), judged)
    cost = result if judged.better == "less" else -result
    cost = cost.where(counts(runs, judged), np.inf)
    by_law = _by_law(runs, SCENE, cost)
    whole = by_law.dropna()
    return Costs(whole, len(by_law) - len(whole))


def _groups(lines: Any, by: Sequence[str]) -> Iterator[tuple[tuple[Any, ...], Any]]:
    if not by:
        yield (), lines
    else:
        yield from lines.groupby(list(by), observed=True, sort=True)


def _by_law(runs: Any, scene: Sequence[str], value: Any) -> Any:
    """Return one line per scene and one column per law; NaN where a law has not run."""
    key = [*dict.fromkeys(scene), LAW]
    lines = runs[key].assign(value=value).astype({LAW: str})
    return lines.set_index(key)["value"].unstack(LAW)


def _frame(columns: Sequence[str], lines: Sequence[tuple[Any, ...]]) -> Any:
    demand("evidence")
    import pandas

    return pandas.DataFrame(lines, columns=list(columns))


class Comparison(NamedTuple):
    """Comparison of two laws: columns of :func:`compare_laws`."""

    scenes: int
    paired: int
    only_a: int
    only_b: int
    differ: int
    difference: float
    low: float
    high: float
    ratio: float = math.nan
    ratio_low: float = math.nan
    ratio_high: float = math.nan
    effect: float = math.nan
    p: float = math.nan


def _by_outcome(a: Array, b: Array, better: Better, confidence: float) -> Comparison:
    result = mcnemar(a, b, confidence)
    gain = 0.0
    if result.n:
        gain = result.difference if better == "more" else -result.difference
    return Comparison(
        scenes=result.n,
        paired=result.n,
        only_a=result.only_a,
        only_b=result.only_b,
        differ=result.only_a + result.only_b,
        difference=result.difference,
        low=result.low,
        high=result.high,
        effect=(1.0 + gain) / 2.0,
        p=result.p,
    )


def _by_metric(a: Array, b: Array, better: Better, least: float, confidence: float) -> Comparison:
    known_a = ~np.isnan(a)
    known_b = ~np.isnan(b)
    both = known_a & known_b
    only_a = known_a & ~known_b
    only_b = known_b & ~known_a
    result = paired(a, b, better=better, least=least, confidence=confidence)
    comparison = Comparison(
        scenes=len(a),
        paired=result.n,
        only_a=int(only_a.sum()),
        only_b=int(only_b.sum()),
        differ=result.wins + result.losses,
        difference=result.median,
        low=result.low,
        high=result.high,
        effect=result.effect,
        p=result.p,
    )
    if not both.any():
        return comparison
    least_value = min(a[both].min(), b[both].min())
    if least_value < 0.0:
        return comparison
    logarithms = paired(a, b, "log-ratio", better=better, least=least, confidence=confidence)
    with np.errstate(over="ignore"):  # a ratio above 1e308 is infinite
        ratio, low, high = np.exp(logarithms[:3]).tolist()
    return comparison._replace(ratio=ratio, ratio_low=low, ratio_high=high)


def compare_laws(
    runs: Any,
    metric: str,
    reference: str | None = None,
    *,
    by: Sequence[str] = BY,
    least: float | None = None,
    confidence: float = 0.95,
) -> Any:
    """Compare every pair of laws on the same scenes, or each law with one reference.

    An outcome is compared on all scenes that both laws ran. A metric is compared on those of them
    in which both runs count (:func:`.judged.counts`). Intervals are simultaneous and p-values are
    corrected (Bonferroni) for all tested pairs of a group. A pair is tested if it has
    :data:`.judged.MIN_SCENES` scenes or more.

    Parameters
    ----------
    runs
        One line per run, with the columns :data:`.judged.SCENE`, ``controller``, ``status``,
        ``violated`` and the metric's.
    metric
        One of :func:`.judged.judged_metrics` or of :data:`.judged.OUTCOMES`.
    reference
        Law that is b in every pair, chosen before looking at the runs.
    by
        Columns that define groups.
    least
        Values that differ by at most this are equal; :func:`.judged.resolution` if not given.
    confidence
        Level at which all intervals of a group hold simultaneously.

    Returns
    -------
    pandas.DataFrame
        One line per group and pair, with the columns:

        - ``by``, metric, a, b;
        - scenes: number that both ran; paired: number compared; only_a, only_b: number in which
          only one of them counts; differ: number in which the two are not equal;
        - difference, low, high: of the rates, or the median of a − b over the scenes in which they
          differ;
        - ratio, ratio_low, ratio_high: the same for a/b, empty for outcomes and negative values;
        - effect: probability that a is better in a scene, with ties counted as half;
        - p (of McNemar's or of the sign test), p_corrected;
        - verdict: :func:`.judged.verdict`.
    """
    checked_confidence(confidence)
    judged = None if metric in OUTCOMES else judged_metric(metric)
    laws = checked(runs, by, judged)[LAW].unique()
    known = [str(name) for name in laws]
    if reference is not None and reference not in known:
        raise unknown_name("controller", reference, known)
    better: Better
    if judged is None:
        value = OUTCOMES[metric].flag(runs)
        better = OUTCOMES[metric].better
        threshold = 0.0
    else:
        value = values(runs, judged)
        better = judged.better or "less"
        threshold = resolution(judged) if least is None else least
    # a law that has run in a scene may have no value there
    scene = (*by, *SCENE)
    by_law = _by_law(runs, scene, value.astype(float))
    ran = _by_law(runs, scene, 1.0).notna()
    lines: list[tuple[Any, ...]] = []
    for group, group_values in _groups(by_law, by):
        pairs = _pairs(group_values, ran.loc[group_values.index], reference)
        tests = sum(pair.is_tested for pair in pairs)
        level = simultaneous(confidence, tests)
        for pair in pairs:
            if judged is None:
                result = _by_outcome(pair.values_a, pair.values_b, better, level)
            else:
                result = _by_metric(pair.values_a, pair.values_b, better, threshold, level)
            judgement = verdict(result.low, result.high, n=result.paired, better=better)
            p_corrected = 1.0
            if result.paired >= MIN_SCENES:
                p_corrected = min(result.p * tests, 1.0)
            lines.append((*group, metric, pair.a, pair.b, *result, p_corrected, judgement))
    return _frame((*by, "metric", "a", "b", *Comparison._fields, "p_corrected", "verdict"), lines)


class _Pair(NamedTuple):
    """Two laws with their values (scenes,) in all scenes that both ran, NaN where one has none."""

    a: str
    b: str
    values_a: Array
    values_b: Array

    @property
    def is_tested(self) -> bool:
        """True if the pair has enough scenes for a verdict."""
        compared = ~np.isnan(self.values_a + self.values_b)
        return int(compared.sum()) >= MIN_SCENES


def _pairs(by_law: Any, ran: Any, reference: str | None) -> list[_Pair]:
    """Return all pairs of laws, or those of each law with the reference.

    ``by_law`` and ``ran``, pandas.DataFrames with one line per scene and one column per law, are
    the values and flags of the runs.
    """
    laws = [law for law in by_law.columns if ran[law].any()]
    if reference is None:
        names = list(combinations(laws, 2))
    elif reference in laws:
        names = [(law, reference) for law in laws if law != reference]
    else:
        names = []
    pairs = []
    for a, b in names:
        both_ran = (ran[a] & ran[b]).to_numpy()
        values_a = by_law[a].to_numpy()[both_ran]
        values_b = by_law[b].to_numpy()[both_ran]
        pairs.append(_Pair(a, b, values_a, values_b))
    return pairs
