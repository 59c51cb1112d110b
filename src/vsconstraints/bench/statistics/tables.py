"""Tables of rates and medians of each law, and of all pairs of laws on the same scenes.

They require pandas.
"""

from __future__ import annotations

import math
from collections import namedtuple
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
    flagged = runs.assign(flag=OUTCOMES[outcome].flag(checked(runs, by)))
    lines = []
    for group, group_runs in _groups(flagged, (*by, LAW)):
        result = rate(group_runs["flag"].to_numpy(bool), confidence)
        lines.append((*group, result.count, result.of, result.share, result.low, result.high))
    return _frame((*by, LAW, "count", "of", "share", "low", "high"), lines)


def medians(runs: Any, metric: str, by: Sequence[str] = BY, confidence: float = 0.95) -> Any:
    """Return the median of a metric over the runs that count, for each group and law.

    These medians are over different scenes for each law. To compare laws, see :func:`compare_laws`.
    Columns: ``by``, controller, counted, of, median, low, high (:class:`.rates.Median`).
    """
    judged = judged_metric(metric)
    lines = []
    valued = runs.assign(value=values(checked(runs, by, judged), judged))
    for group, group_runs in _groups(valued, (*by, LAW)):
        middle = median(group_runs["value"].dropna(), confidence)
        lines.append((*group, middle.n, len(group_runs), middle.median, middle.low, middle.high))
    return _frame((*by, LAW, "counted", "of", "median", "low", "high"), lines)


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
    each = _by_law(runs, SCENE, cost.where(counts(runs, judged), np.inf))
    whole = each.dropna()
    return Costs(whole, len(each) - len(whole))


def _groups(lines: Any, by: Sequence[str]) -> Iterator[tuple[tuple[Any, ...], Any]]:
    if not by:
        yield (), lines
    else:
        yield from lines.groupby(list(by), observed=True, sort=True)


def _by_law(runs: Any, scene: Sequence[str], value: Any) -> Any:
    """Return one line per scene and one column per law; NaN where a law has not run."""
    which = [*dict.fromkeys(scene), LAW]
    return runs[which].assign(value=value).astype({LAW: str}).set_index(which)["value"].unstack(LAW)


def _frame(columns: Sequence[str], lines: Sequence[tuple[Any, ...]]) -> Any:
    demand("evidence")
    import pandas

    return pandas.DataFrame(lines, columns=list(columns))


Comparison = namedtuple(  # comparison of two laws: columns of compare_laws
    "Comparison",
    "scenes paired only_a only_b differ difference low high ratio ratio_low ratio_high effect p",
)


def _by_outcome(a: Array, b: Array, better: Better, confidence: float) -> Comparison:
    result = mcnemar(a, b, confidence)
    gain = (result.difference if result.n else 0.0) * (1.0 if better == "more" else -1.0)
    scenes = result.n, result.n, result.only_a, result.only_b, result.only_a + result.only_b
    return Comparison._make((*scenes, *result[:3], *[math.nan] * 3, (1.0 + gain) / 2.0, result.p))


def _by_metric(a: Array, b: Array, better: Better, least: float, confidence: float) -> Comparison:
    known_a = ~np.isnan(a)
    known_b = ~np.isnan(b)
    both = known_a & known_b
    result = paired(a, b, better=better, least=least, confidence=confidence)
    ratios = [math.nan] * 3
    if both.any() and min(a[both].min(), b[both].min()) >= 0.0:
        with np.errstate(over="ignore"):  # a ratio above 1e308 is infinite
            logarithms = paired(
                a, b, "log-ratio", better=better, least=least, confidence=confidence
            )[:3]
            ratios = np.exp(logarithms).tolist()
    scenes = (
        len(a),
        result.n,
        int((known_a & ~known_b).sum()),
        int((known_b & ~known_a).sum()),
        result.wins + result.losses,
    )
    return Comparison._make((*scenes, *result[:3], *ratios, result.effect, result.p))


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
    known = [str(name) for name in dict.fromkeys(checked(runs, by, judged)[LAW])]
    if reference is not None and reference not in known:
        raise unknown_name("controller", reference, known)
    value = OUTCOMES[metric].flag(runs) if judged is None else values(runs, judged)
    better: Better = (OUTCOMES[metric] if judged is None else judged).better or "less"
    each, ran = (_by_law(runs, (*by, *SCENE), column) for column in (value.astype(float), 1.0))
    lines: list[tuple[Any, ...]] = []
    for group, values_by_law in _groups(each, by):
        was_run = ran.loc[values_by_law.index].notna()
        laws = [law for law in values_by_law.columns if was_run[law].any()]
        against = [(law, reference) for law in laws if law != reference and reference in laws]
        pairs = []
        for a, b in combinations(laws, 2) if reference is None else against:
            both = (was_run[a] & was_run[b]).to_numpy()
            pairs.append(
                (a, b, values_by_law[a].to_numpy()[both], values_by_law[b].to_numpy()[both])
            )
        tests = sum(
            int((~np.isnan(values_a + values_b)).sum()) >= MIN_SCENES
            for *_, values_a, values_b in pairs
        )
        level = simultaneous(confidence, tests)
        for a, b, values_a, values_b in pairs:
            if judged is None:
                result = _by_outcome(values_a, values_b, better, level)
            else:
                result = _by_metric(
                    values_a,
                    values_b,
                    better,
                    resolution(judged) if least is None else least,
                    level,
                )
            judgement = verdict(result.low, result.high, n=result.paired, better=better)
            corrected = min(result.p * tests, 1.0) if result.paired >= MIN_SCENES else 1.0
            lines.append((*group, metric, a, b, *result, corrected, judgement))
    return _frame((*by, "metric", "a", "b", *Comparison._fields, "p_corrected", "verdict"), lines)
