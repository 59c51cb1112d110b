"""Tables of what each law comes to. They need pandas."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import unknown_name
from ...plugins.extras import demand
from .judged import LAW, OUTCOMES, SCENE, checked, counts, judged_metric, values
from .median import median
from .rates import rate

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
    flags = OUTCOMES[outcome].flag(checked(runs, by))
    lines = []
    for group, own in groups(runs.assign(flag=flags), (*by, LAW)):
        found = rate(own["flag"].to_numpy(bool), confidence)
        lines.append((*group, found.count, found.of, found.share, found.low, found.high))
    return frame((*by, LAW, "count", "of", "share", "low", "high"), lines)


def medians(runs: Any, metric: str, by: Sequence[str] = BY, confidence: float = 0.95) -> Any:
    """The median of a metric over those of each law's runs that count, and how many do.

    Laws need not count in the same scenes, so these are not to be compared: that is :func:`.comparing.compare_laws`.

    Returns
    -------
    pandas.DataFrame
        ``by``, controller, counted, of, median, low, high: :class:`.median.Median`.
    """
    judged = judged_metric(metric)
    found = values(checked(runs, by, judged), judged)
    lines = []
    for group, own in groups(runs.assign(value=found), (*by, LAW)):
        middle = median(own["value"].dropna(), confidence)
        lines.append((*group, middle.n, len(own), middle.median, middle.low, middle.high))
    return frame((*by, LAW, "counted", "of", "median", "low", "high"), lines)


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
    found = values(checked(runs, (), judged), judged)
    each = by_law(runs, SCENE, (found if judged.better == "less" else -found).where(counts(runs, judged), np.inf))
    whole = each.dropna()
    return Costs(whole, len(each) - len(whole))


def groups(lines: Any, by: Sequence[str]) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Groups by columns or levels, in the order of their names; all lines as one, if nothing tells groups apart."""
    if not by:
        yield (), lines
    else:
        yield from lines.groupby(list(by), observed=True, sort=True)


def by_law(runs: Any, scene: Sequence[str], value: Any) -> Any:
    """One line per scene, one column per law, both in the order of their names; NaN where a law has not run."""
    which = [*dict.fromkeys(scene), LAW]
    return runs[which].assign(value=value).astype({LAW: str}).set_index(which)["value"].unstack(LAW)


def frame(columns: Sequence[str], lines: Sequence[tuple[Any, ...]]) -> Any:
    """A pandas.DataFrame of lines."""
    demand("evidence")
    import pandas

    return pandas.DataFrame(lines, columns=list(columns))
