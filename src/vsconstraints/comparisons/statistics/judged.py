"""What laws are compared by: metrics and outcomes of runs, and which runs count; checks of inputs,
and verdicts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from ...errors import ConfigurationError, InvalidInput, shown, unknown_name
from ...rows import Array, BoolArray
from ..metrics import METRICS, Metric

Better = Literal["less", "more"]  #: which values are better

#: what is said of a against b
Verdict = Literal["better", "worse", "not distinguishable", "too few"]

MIN_SCENES = 6  #: fewer are too few: an exact two-sided test of n pairs never gives less than 2/2ⁿ
#: columns that say which scene a run is of, and its condition
SCENE = ("family", "condition", "half", "scene")
LAW = "controller"  #: the column that says which law


def checked_confidence(confidence: float) -> float:
    """One strictly between 0 and 1."""
    if not isinstance(confidence, (int, float)) or not 0.0 < confidence < 1.0:
        raise ConfigurationError(
            f"confidence must be between 0 and 1, such as 0.95, not {shown(confidence)}"
        )
    return float(confidence)


def checked_name(what: str, name: object, candidates: Any) -> None:
    """A name out of a ``Literal``."""
    if name not in get_args(candidates):
        raise unknown_name(what, name, get_args(candidates))


def array(values: ArrayLike, name: str, ndim: int = 1) -> Array:
    """(scenes,) or (scenes, laws) floats; InvalidInput for anything else."""
    try:
        numbers = np.asarray(values).astype(float)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{name} must hold numbers only: {error}") from error
    if numbers.ndim != ndim or (ndim == 2 and numbers.shape[1] == 0):
        raise InvalidInput(
            f"{name} must be of shape {('(scenes,)', '(scenes, laws)')[ndim - 1]}, not "
            f"{numbers.shape}"
        )
    return numbers


def flags(values: ArrayLike, name: str = "flags") -> BoolArray:
    """(n,) booleans; numbers have to be 0 or 1."""
    column = array(values, name)
    if not np.isin(column, (0, 1)).all():
        raise InvalidInput(
            f"{name} must be true or false in every scene; give only scenes in which that is known"
        )
    return column.astype(np.bool_)


def numbers(values: ArrayLike, name: str) -> Array:
    """(n,) floats; NaN stands for a run that does not count, and nothing may be infinite."""
    column = array(values, name)
    if np.isinf(column).any():
        infinite = shown(column[np.isinf(column)][0])
        raise InvalidInput(f"{name} holds {infinite}: NaN stands for a run that does not count")
    return column


def pair(a: Any, b: Any) -> None:
    """Two columns of one length: entry i of both is scene i."""
    if len(a) != len(b):
        raise InvalidInput(
            f"a and b must be of the same scenes, one entry each, not of {len(a)} and {len(b)}"
        )


def simultaneous(confidence: float, comparisons: int) -> float:
    """Confidence of each of several intervals, so that all hold at once with ``confidence``
    (Bonferroni).
    """
    return 1.0 - (1.0 - checked_confidence(confidence)) / max(comparisons, 1)


def distinguishable(low: float, high: float, n: int = MIN_SCENES) -> bool:
    """Whether an interval of a difference on n scenes excludes zero, and there are scenes enough to
    say so.
    """
    return n >= MIN_SCENES and not low <= 0.0 <= high


def verdict(low: float, high: float, *, n: int = MIN_SCENES, better: Better = "less") -> Verdict:
    """What is said of a against b, from the interval of a − b, which is simultaneous for all that
    is compared.
    """
    if not distinguishable(low, high, n):
        return "too few" if n < MIN_SCENES else "not distinguishable"
    return "better" if (high < 0.0) == (better == "less") else "worse"


def converged(runs: Any) -> Any:
    """Whether each run reached its last goal and held it."""
    return runs["status"] == "converged"


def violated(runs: Any, column: str = "violated") -> Any:
    """Whether each run violated a row, by the strict standard or as another column has it, which
    has to be there.
    """
    if column not in runs.columns:
        raise ConfigurationError(
            f"runs have no column {column!r}; another version may have scored them"
        )
    return runs[column].astype(object).fillna("") != ""


class Outcome(NamedTuple):
    """A flag of every run, and whether it is wanted."""

    flag: Callable[[Any], Any]
    better: Better


#: Outcomes of a run. A success converged and violated nothing: by the strict standard, or by the
#: tolerant one.
OUTCOMES: Mapping[str, Outcome] = {
    "success": Outcome(lambda runs: converged(runs) & ~violated(runs), "more"),
    "convergence": Outcome(converged, "more"),
    "violation": Outcome(violated, "less"),
    "tolerant success": Outcome(
        lambda runs: converged(runs) & ~violated(runs, "violated_tolerant"), "more"
    ),
    "tolerant violation": Outcome(lambda runs: violated(runs, "violated_tolerant"), "less"),
}

#: What statuses mean where no row is violated; any other status is a failure.
ENDINGS: Mapping[str, str] = {
    "converged": "success",
    "trapped": "stuck",
    "slow": "slow",
    "unfinished": "slow",
}
UNSUCCESSFUL = ("violated", "stuck", "slow", "failed")  #: How runs end that are no success.


def endings(runs: Any) -> Any:
    """How each run ended: ``"success"``, or one of :data:`UNSUCCESSFUL`: violated, strictly, or
    else by its status.
    """
    return (
        runs["status"].astype(str).map(ENDINGS).fillna("failed").where(~violated(runs), "violated")
    )


def judged_metrics() -> dict[str, Metric]:
    """Metrics of which less or more is better, by name: the column, or ``column / column`` of a
    ratio of two.
    """
    return {
        f"{metric.column} / {metric.over}" if metric.over else metric.column: metric
        for metric in METRICS
        if metric.kind == "number" and metric.header and metric.better is not None
    }


def judged_metric(name: str) -> Metric:
    """A metric by its name, one of :func:`judged_metrics`."""
    known = judged_metrics()
    if name not in known:
        raise unknown_name("metric", name, [*known, *OUTCOMES])
    return known[name]


def counts(runs: Any, metric: Metric) -> Any:
    """Whether each run counts: it converged and, as the metric says, violated no row and never lost
    a sliding mode.
    """
    may = converged(runs)
    if metric.judged != "any":
        may &= ~violated(runs)
    if metric.judged == "sliding":
        may &= runs["sliding_lost_s"] == 0.0
    return may


def values(runs: Any, metric: Metric) -> Any:
    """The metric of each run, as stored; NaN where the run has none or does not count."""
    column = runs[metric.column].astype(float)
    if metric.over:
        column = column / runs[metric.over].astype(float)
    return column.where(counts(runs, metric) & np.isfinite(column))


def resolution(metric: Metric) -> float:
    """The smallest difference that matters: of remaining errors, the thousandth below which none
    are shown.
    """
    return 1e-3 / metric.factor if metric.style == "error" else 0.0


def checked(runs: Any, by: Sequence[str], metric: Metric | None = None) -> Any:
    """The runs, which have the columns that are needed, and no law twice in a scene; raises
    ConfigurationError.
    """
    which = [*dict.fromkeys((*by, *SCENE)), LAW]
    wanted = [*which, "status", "violated"]
    if metric is not None:
        wanted += [metric.column, *([metric.over] if metric.over else [])]
        wanted += ["sliding_lost_s"] if metric.judged == "sliding" else []
    missing = [name for name in wanted if name not in runs.columns]
    if missing:
        raise ConfigurationError(
            f"runs have no column {missing[0]!r}; needed are {', '.join(dict.fromkeys(wanted))}"
        )
    again = runs.duplicated(which)
    if again.any():
        first = ", ".join(str(cell) for cell in runs.loc[again, which].iloc[0])
        raise ConfigurationError(
            f"{int(again.sum())} runs are there twice, the first of them {first}"
        )
    return runs
