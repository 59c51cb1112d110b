"""Metrics and outcomes by which laws are compared, and the runs that count.

Also checks inputs and gives verdicts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from ...comparisons.metrics import Metric, run_metrics
from ...comparisons.rates import checked_confidence
from ...errors import ConfigurationError, InvalidInput, format_value, unknown_name
from ...rows import Array, BoolArray

Better = Literal["less", "more"]  #: values that are better: smaller or larger ones

#: result of comparing a with b
Verdict = Literal["better", "worse", "not distinguishable", "too few"]

#: Minimum number of scenes for a verdict: the p-value of an exact two-sided test of n pairs is at
#: least 2/2ⁿ.
MIN_SCENES = 6
#: columns that identify the scene and the condition of a run
SCENE = ("family", "condition", "half", "scene")
LAW = "controller"  #: column with the name of the law


def checked_name(what: str, name: object, candidates: Any) -> None:
    """Raise ConfigurationError unless ``name`` is a value of a ``Literal``."""
    if name not in get_args(candidates):
        raise unknown_name(what, name, get_args(candidates))


def array(values: ArrayLike, name: str, ndim: int = 1) -> Array:
    """Convert values to floats of shape (scenes,) or (scenes, laws).

    Raises InvalidInput for any other input.
    """
    try:
        numbers = np.asarray(values).astype(float)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{name} must hold numbers only: {error}") from error
    has_no_law = numbers.ndim == 2 and numbers.shape[1] == 0
    if numbers.ndim != ndim or has_no_law:
        shape = "(scenes,)" if ndim == 1 else "(scenes, laws)"
        raise InvalidInput(f"{name} must be of shape {shape}, not {numbers.shape}")
    return numbers


def flags(values: ArrayLike, name: str = "flags") -> BoolArray:
    """Convert values to (n,) booleans. Raises InvalidInput unless numbers are 0 or 1."""
    column = array(values, name)
    if not np.isin(column, (0, 1)).all():
        raise InvalidInput(
            f"{name} must be true or false in every scene; give only scenes in which that is known"
        )
    return column.astype(np.bool_)


def numbers(values: ArrayLike, name: str) -> Array:
    """Convert values to (n,) floats. NaN marks a run that does not count.

    Raises InvalidInput if a value is infinite.
    """
    column = array(values, name)
    is_infinite = np.isinf(column)
    if is_infinite.any():
        infinite = format_value(column[is_infinite][0])
        raise InvalidInput(f"{name} holds {infinite}: NaN stands for a run that does not count")
    return column


def require_pairs(a: Any, b: Any) -> None:
    """Raise InvalidInput unless two columns have the same length.

    Entry i of both belongs to scene i.
    """
    if len(a) != len(b):
        raise InvalidInput(
            f"a and b must be of the same scenes, one entry each, not of {len(a)} and {len(b)}"
        )


def simultaneous(confidence: float, comparisons: int) -> float:
    """Return the confidence level of each of several simultaneous intervals.

    With the Bonferroni correction, all intervals hold at once with probability ``confidence`` or
    more.
    """
    alpha = 1.0 - checked_confidence(confidence)
    return 1.0 - alpha / max(comparisons, 1)


def distinguishable(low: float, high: float, n: int = MIN_SCENES) -> bool:
    """True if the interval of a difference on n scenes excludes zero and n is large enough."""
    return n >= MIN_SCENES and not low <= 0.0 <= high


def verdict(low: float, high: float, *, n: int = MIN_SCENES, better: Better = "less") -> Verdict:
    """Return the verdict on a compared with b from the simultaneous interval of a − b."""
    if n < MIN_SCENES:
        return "too few"
    if not distinguishable(low, high, n):
        return "not distinguishable"
    return "better" if (high < 0.0) == (better == "less") else "worse"


def converged(runs: Any) -> Any:
    """Return a flag for each run: True if it reached its last goal and held it."""
    return runs["status"] == "converged"


def violated(runs: Any, column: str = "violated") -> Any:
    """Return a flag for each run: True if it violated a row.

    ``column`` selects the standard, strict by default. Raises ConfigurationError if the column is
    missing.
    """
    if column not in runs.columns:
        raise ConfigurationError(
            f"runs have no column {column!r}; another version may have scored them"
        )
    return runs[column].astype(object).fillna("") != ""


class Outcome(NamedTuple):
    """Flag of each run as a function of the table of runs, with the preferred direction.

    ``better`` is "more" if the flag is desired, and "less" otherwise.
    """

    flag: Callable[[Any], Any]
    better: Better


#: Outcomes of a run. A success is a run that converged and violated no row by the strict or by the
#: tolerant standard.
OUTCOMES: Mapping[str, Outcome] = {
    "success": Outcome(lambda runs: converged(runs) & ~violated(runs), "more"),
    "convergence": Outcome(converged, "more"),
    "violation": Outcome(violated, "less"),
    "tolerant success": Outcome(
        lambda runs: converged(runs) & ~violated(runs, "violated_tolerant"), "more"
    ),
    "tolerant violation": Outcome(lambda runs: violated(runs, "violated_tolerant"), "less"),
}

#: Ending of a run without violation, by status; any other status is a failure. The ending ``slow``
#: also contains runs with the status ``unfinished``.
ENDINGS: Mapping[str, str] = {
    "converged": "success",
    "trapped": "stuck",
    "slow": "slow",
    "unfinished": "slow",
}
UNSUCCESSFUL = ("violated", "stuck", "slow", "failed")  #: Endings of unsuccessful runs.


def endings(runs: Any) -> Any:
    """Return how each run ended: ``"success"`` or one of :data:`UNSUCCESSFUL`.

    A run that violates a row by the strict standard is ``"violated"``. All others are classified by
    status.
    """
    by_status = runs["status"].astype(str).map(ENDINGS).fillna("failed")
    return by_status.where(~violated(runs), "violated")


def judged_metrics() -> dict[str, Metric]:
    """Return the metrics for which smaller or larger values are better, by name.

    The name is the column, or ``column / column`` for a ratio of two.
    """
    judged = {}
    for metric in run_metrics():
        if metric.kind != "number" or not metric.header or metric.better is None:
            continue
        name = f"{metric.column} / {metric.over}" if metric.over else metric.column
        judged[name] = metric
    return judged


def judged_metric(name: str) -> Metric:
    """Return a metric by its name, one of :func:`judged_metrics`."""
    known = judged_metrics()
    if name not in known:
        raise unknown_name("metric", name, [*known, *OUTCOMES])
    return known[name]


def counts(runs: Any, metric: Metric) -> Any:
    """Return a flag for each run: True if it counts for a metric.

    A run counts if it converged and, depending on the metric, violated no row and never lost a
    sliding mode.
    """
    flags = converged(runs)
    if metric.judged != "any":
        flags &= ~violated(runs)
    if metric.judged == "sliding":
        flags &= runs["sliding_lost_s"] == 0.0
    return flags


def values(runs: Any, metric: Metric) -> Any:
    """Return the stored metric of each run.

    It is NaN for a run that has no value or does not count.
    """
    column = runs[metric.column].astype(float)
    if metric.over:
        column = column / runs[metric.over].astype(float)
    return column.where(counts(runs, metric) & np.isfinite(column))


def resolution(metric: Metric) -> float:
    """Return the smallest relevant difference of a metric.

    For remaining errors, it is 0.001 of the displayed unit, since smaller errors are not shown. For
    all other metrics, it is zero.
    """
    return 1e-3 / metric.factor if metric.style == "error" else 0.0


def checked(runs: Any, by: Sequence[str], metric: Metric | None = None) -> Any:
    """Return the runs after checking their columns.

    Raises ConfigurationError if a required column is missing, or if a law has two runs in a scene.
    """
    key = [*dict.fromkeys((*by, *SCENE)), LAW]
    needed = [*key, "status", "violated"]
    if metric is not None:
        needed.append(metric.column)
        if metric.over:
            needed.append(metric.over)
        if metric.judged == "sliding":
            needed.append("sliding_lost_s")
    missing = [name for name in needed if name not in runs.columns]
    if missing:
        raise ConfigurationError(
            f"runs have no column {missing[0]!r}; needed are {', '.join(dict.fromkeys(needed))}"
        )
    is_repeated = runs.duplicated(key)
    if is_repeated.any():
        first = ", ".join(map(str, runs.loc[is_repeated, key].iloc[0]))
        count = int(is_repeated.sum())
        raise ConfigurationError(f"{count} runs appear twice, the first of them {first}")
    return runs
