"""Differences of two comparisons as Markdown: regressions, changes and the runs to inspect."""

from __future__ import annotations

from collections.abc import Iterator
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
    outcomes = [(each, p) for each, p in found.found if isinstance(each, Outcome)]
    shifts = [(each, p) for each, p in found.found if isinstance(each, Shift)]
    shifts.sort(key=lambda shift: (shift[1] is None, shift[1] or 0))
    return render(
        Path(__file__).with_name("difference.md"),
        found=found,
        verdict=verdict(found),
        changes=[(change, _names(change)) for change in found.changes],
        same=int((~found.pairs.differ).sum()),
        named=_named,
        outcomes=outcomes,
        lost=[line for each, _ in outcomes for line in _lost(found, each)],
        shifts=shifts,
        most=MAX_LINES,
        times=list(_times(found)),
        mark=_mark,
        moved=_moved,
        value=_value,
        significance=lambda p: DASH if p is None else "<0.001" if p < 1e-3 else number(p),
        significant=SIGNIFICANT,
        min_pairs=MIN_SCENES,
    )


def verdict(found: Difference) -> str:
    """Return the lines that say what got worse and what got better."""
    if not found.pairs.differ.any():
        return f"All {len(found.pairs.differ)} runs in common are identical except for their times."
    worse = found.worse
    better = [
        each
        for each, p in found.found
        if significant(p) and not each.for_worse and each not in worse
    ]
    lines = []
    for word, those in (("Worse", worse), ("Better", better)):
        lines += [f"{word}: {_sentence(each, found.confidence)}" for each in those[:MAX_RUNS]]
        if len(those) > MAX_RUNS:
            lines.append(f"{len(those) - MAX_RUNS} more got {word.lower()}.")
    return bullets(lines or ["Nothing got worse."])


def _sentence(found: Outcome | Shift, confidence: float) -> str:
    group = ", ".join((bold(plain(found.group.law)), *map(plain, found.group.place)))
    if isinstance(found, Outcome):
        return (
            f"{group}: {found.what} in {found.after} of {len(found.group.positions)} runs, "
            f"before in {found.before}"
        )
    return (
        f"{group}: {found.metric.header} by {_moved(found, confidence)} in the median where runs "
        f"differ; "
        f"worse in {found.worse}, better in {found.better} of {found.of}"
    )


def _names(change: Change) -> str:
    several = len(change.names) > MAX_NAMES
    shown = f"{len(change.names)}: {', '.join(change.names[:MAX_NAMES])}, …"
    return plain(shown if several else enumeration(change.names))


def _value(value: Any) -> str:
    if value is None:
        return DASH
    text = str(value)
    return plain(text if len(text) <= MAX_LENGTH else f"{text[:MAX_LENGTH]}…")


def _named(runs: Any) -> str:
    names = []
    for run in runs.head(MAX_RUNS).itertuples(index=False):
        names.append(", ".join(map(str, run)))
    text = plain("; ".join(names))
    return f"{text}, and {len(runs) - MAX_RUNS} more" if len(runs) > MAX_RUNS else text


def _lost(found: Difference, outcome: Outcome) -> Iterator[str]:
    """Yield the first runs that B lost, with status and reason."""
    for position in outcome.lost[:MAX_RUNS]:
        run = found.pairs.b.iloc[position]
        name = ", ".join(map(str, found.pairs.b.index[position]))
        status = run["status"]
        if outcome.what == "stays inside":
            status = f"violated {run['violated']}"
        why = "; ".join(filter(None, (status, run["reason"])))
        yield f"{plain(name)} no longer {outcome.what}: {plain(why)}"
    if len(outcome.lost) > MAX_RUNS:
        yield f"{len(outcome.lost) - MAX_RUNS} more of {plain(outcome.group)}"


def _times(found: Difference) -> Iterator[tuple[Any, ...]]:
    for group in found.groups:
        for column in TIMES:
            a = group.a[column].to_numpy(dtype=float)
            b = group.b[column].to_numpy(dtype=float)
            known = np.isfinite(a) & np.isfinite(b) & (a > 0.0)
            if known.any():
                a = a[known]
                b = b[known]
                medians = [number(float(np.median(times))) for times in (a, b, b / a)]
                yield group, column, *medians


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
    factor = shift.metric.factor * (100.0 if shift.metric.style == "percent" else 1.0)
    return with_interval(*median(shift.differences, confidence)[:3], factor)
