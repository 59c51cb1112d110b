"""Differences of two comparisons as Markdown: regressions, changes and the runs to inspect."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ...reports.markdown import bold, bullets, enumeration, plain
from ...reports.numbers import DASH, number
from ...reports.page import render
from ..difference import SIGNIFICANT, Change, Difference, Outcome, Shift, significant
from ..statistics import median, with_interval
from ..statistics.judged import MIN_SCENES

TIMES = ("step_time_median_us", "step_time_p99_us", "rows_time_median_us")
#: Limits: named runs, lines in the table of metrics, names in a cell, characters of a setting.
MAX_RUNS = 10
MAX_LINES = 100
MAX_NAMES = 3
MAX_LENGTH = 60


def page(found: Difference) -> str:
    """Return the whole page."""
    outcomes = []
    shifts = []
    lost: list[str] = []
    for each, p in found.found:
        if isinstance(each, Outcome):
            outcomes.append((each, p))
            lost += _lost(found, each)
        else:
            shifts.append((each, p))
    # tested ones first, by p-value
    shifts.sort(key=lambda shift: (shift[1] is None, shift[1] or 0))
    return render(
        Path(__file__).with_name("difference.md"),
        found=found,
        verdict=verdict(found),
        changes=[(change, _names(change)) for change in found.changes],
        same=int((~found.pairs.differ).sum()),
        named=_named,
        outcomes=outcomes,
        lost=lost,
        shifts=shifts,
        most=MAX_LINES,
        times=list(_times(found)),
        mark=_mark,
        moved=_moved,
        value=_value,
        significance=_significance,
        significant=SIGNIFICANT,
        min_pairs=MIN_SCENES,
    )


def _significance(p: float | None) -> str:
    """Format a p-value; None if a difference was not tested."""
    if p is None:
        return DASH
    return "<0.001" if p < 1e-3 else number(p)


def verdict(found: Difference) -> str:
    """Return the lines that say what got worse and what got better."""
    if not found.pairs.differ.any():
        return f"All {len(found.pairs.differ)} runs in common are identical except for their times."
    worse = found.worse
    better = []
    for each, p in found.found:
        if significant(p) and not each.for_worse and each not in worse:
            better.append(each)
    lines = []
    for word, changed in (("Worse", worse), ("Better", better)):
        for each in changed[:MAX_RUNS]:
            lines.append(f"{word}: {_sentence(each, found.confidence)}")
        if len(changed) > MAX_RUNS:
            lines.append(f"{len(changed) - MAX_RUNS} more got {word.lower()}.")
    return bullets(lines or ["Nothing got worse."])


def _sentence(found: Outcome | Shift, confidence: float) -> str:
    law = bold(plain(found.group.law))
    group = ", ".join((law, *map(plain, found.group.place)))
    if isinstance(found, Outcome):
        runs = len(found.group.positions)
        return f"{group}: {found.what} in {found.after} of {runs} runs, before in {found.before}"
    return (
        f"{group}: {found.metric.header} by {_moved(found, confidence)} in the median where runs "
        f"differ; worse in {found.worse}, better in {found.better} of {found.of}"
    )


def _names(change: Change) -> str:
    if len(change.names) <= MAX_NAMES:
        return plain(enumeration(change.names))
    first = ", ".join(change.names[:MAX_NAMES])
    return plain(f"{len(change.names)}: {first}, …")


def _value(value: Any) -> str:
    if value is None:
        return DASH
    text = str(value)
    if len(text) > MAX_LENGTH:
        text = f"{text[:MAX_LENGTH]}…"
    return plain(text)


def _named(runs: Any) -> str:
    names = []
    for run in runs.head(MAX_RUNS).itertuples(index=False):
        names.append(", ".join(map(str, run)))
    text = plain("; ".join(names))
    if len(runs) > MAX_RUNS:
        text += f", and {len(runs) - MAX_RUNS} more"
    return text


def _lost(found: Difference, outcome: Outcome) -> Iterator[str]:
    """Yield the first runs that B lost, with status and reason."""
    for position in outcome.lost[:MAX_RUNS]:
        run = found.pairs.b.iloc[position]
        name = ", ".join(map(str, found.pairs.b.index[position]))
        reason = run["status"]
        if outcome.what == "stays inside":
            reason = f"violated {run['violated']}"
        if run["reason"]:
            reason += f"; {run['reason']}"
        yield f"{plain(name)} no longer {outcome.what}: {plain(reason)}"
    if len(outcome.lost) > MAX_RUNS:
        yield f"{len(outcome.lost) - MAX_RUNS} more of {plain(outcome.group)}"


def _times(found: Difference) -> Iterator[tuple[Any, ...]]:
    """Yield group, column, and medians of A, B and their ratio, for each column of times."""
    for group, column in product(found.groups, TIMES):
        a = group.a[column].to_numpy(dtype=float)
        b = group.b[column].to_numpy(dtype=float)
        is_known = np.isfinite(a) & np.isfinite(b) & (a > 0.0)
        if not is_known.any():
            continue
        before = a[is_known]
        after = b[is_known]
        texts = []
        for times in (before, after, after / before):
            median = float(np.median(times))
            texts.append(number(median))
        yield group, column, *texts


def _mark(found: Difference, each: Outcome | Shift, p: float | None) -> str:
    if found.counts(each, p):
        return bold("worse")
    if p is None:
        return ""
    if not significant(p):
        return "≈"
    return "worse" if each.for_worse else "better"


def _moved(shift: Shift, confidence: float) -> str:
    """Return the median of the differences, in the unit in which reports show the metric."""
    factor = shift.metric.factor
    if shift.metric.style == "percent":
        factor *= 100.0
    middle, low, high, _ = median(shift.differences, confidence)
    return with_interval(middle, low, high, factor)
