"""How far metrics moved between the runs of each pair."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...rows import Array
from ..metrics import Metric
from ..statistics import paired
from ..statistics.judged import judged_metric, judged_metrics, resolution, values
from .groups import Group, tested


@dataclass(frozen=True, eq=False)
class Shift:
    """How a metric of a law moved.

    Attributes
    ----------
    group, metric
        Whose, and which.
    of
        Pairs in which both runs converged and may be judged by it.
    better, worse
        In how many of them it is better in B than in A, or worse, by more than the tolerance.
    differences
        (n,) B − A, as stored, of the pairs that differ.
    p
        Of the sign test, before correction; None where so few pairs differ that none could be significant.
    """

    group: Group
    metric: Metric
    of: int
    better: int
    worse: int
    differences: Array
    p: float | None

    @property
    def for_worse(self) -> bool:
        """Which way it goes: that of most pairs."""
        return self.worse > self.better


def chosen(names: Sequence[str]) -> list[Metric]:
    """The metrics of these names, or all; raises ConfigurationError that names the candidates."""
    return [judged_metric(name) for name in names or judged_metrics()]


def shifts(groups: Iterable[Group], metrics: Iterable[Metric], tolerance: float) -> Iterator[Shift]:
    """All of them in which pairs differ by more than the tolerance.

    Parameters
    ----------
    groups, metrics
        Whose, and which.
    tolerance
        Share of the greater of both values by which they may differ and count as the same; remaining errors are the
        same, too, where reports show them alike.
    """
    for group, metric in ((group, metric) for group in groups for metric in metrics):
        a, b = (values(runs, metric).to_numpy() for runs in (group.a, group.b))
        exist = np.isfinite(a) & np.isfinite(b)
        a, b = a[exist], b[exist]
        moved = np.abs(b - a) > np.maximum(tolerance * np.maximum(np.abs(a), np.abs(b)), resolution(metric))
        found = paired(b[moved], a[moved], better=metric.better or "less")
        if found.n:
            p = found.p if tested(found.n) else None
            yield Shift(group, metric, len(a), found.wins, found.losses, b[moved] - a[moved], p)
