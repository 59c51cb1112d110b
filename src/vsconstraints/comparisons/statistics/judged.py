"""What laws are compared by: the metrics of reports, and what a run comes to; which runs count for which."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import ConfigurationError, unknown_name
from ..metrics import METRICS, Metric
from .inputs import Better

SCENE = ("family", "condition", "half", "scene")
"""Columns that say which scene a run is of, and what went otherwise than assumed in it."""

LAW = "controller"
"""The column that says which law."""


class Outcome(NamedTuple):
    """A flag of every run, and whether it is wanted."""

    flag: Callable[[Any], Any]
    better: Better


def converged(runs: Any) -> Any:
    """Whether each run reached its last goal and held it."""
    return runs["status"] == "converged"


def violated(runs: Any, column: str = "violated") -> Any:
    """Whether each run violated a row, by the strict standard or as another column has it.

    Raises ConfigurationError without that column: runs that were scored before there was one.
    """
    if column not in runs.columns:
        raise ConfigurationError(f"runs have no column {column!r}; another version may have scored them")
    return runs[column].astype(object).fillna("") != ""


OUTCOMES: Mapping[str, Outcome] = {
    "success": Outcome(lambda runs: converged(runs) & ~violated(runs), "more"),
    "convergence": Outcome(converged, "more"),
    "violation": Outcome(violated, "less"),
    "tolerant success": Outcome(lambda runs: converged(runs) & ~violated(runs, "violated_tolerant"), "more"),
    "tolerant violation": Outcome(lambda runs: violated(runs, "violated_tolerant"), "less"),
}
"""What a run comes to. A success converged and violated nothing: by the strict standard, or by the tolerant one."""


def judged_metrics() -> dict[str, Metric]:
    """Metrics of which less or more is better, by name: the column, or ``column / column`` of a ratio of two."""
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
    """Whether each run counts: it converged and, as the metric says, violated no row and never lost a sliding mode."""
    may = converged(runs)
    if metric.judged != "any":
        may &= ~violated(runs)
    if metric.judged == "sliding":
        may &= runs["sliding_lost_s"] == 0.0
    return may


def values(runs: Any, metric: Metric) -> Any:
    """The metric of each run, as stored; NaN where the run has none or does not count."""
    found = runs[metric.column].astype(float)
    if metric.over:
        found = found / runs[metric.over].astype(float)
    return found.where(counts(runs, metric) & np.isfinite(found))


def resolution(metric: Metric) -> float:
    """The smallest difference that matters: of remaining errors, the thousandth below which none are shown."""
    return 1e-3 / metric.factor if metric.style == "error" else 0.0


def checked(runs: Any, by: Sequence[str], metric: Metric | None = None) -> Any:
    """The runs, which have the columns that are needed, and no law twice in a scene.

    Raises
    ------
    ConfigurationError
        if that is not so; it says which column, or which run.
    """
    which = [*dict.fromkeys((*by, *SCENE)), LAW]
    wanted = [*which, "status", "violated"]
    if metric is not None:
        wanted += [metric.column, *([metric.over] if metric.over else [])]
        wanted += ["sliding_lost_s"] if metric.judged == "sliding" else []
    missing = [name for name in wanted if name not in runs.columns]
    if missing:
        raise ConfigurationError(f"runs have no column {missing[0]!r}; needed are {', '.join(dict.fromkeys(wanted))}")
    again = runs.duplicated(which)
    if again.any():
        first = ", ".join(str(cell) for cell in runs.loc[again, which].iloc[0])
        raise ConfigurationError(f"{int(again.sum())} runs are there twice, the first of them {first}")
    return runs
