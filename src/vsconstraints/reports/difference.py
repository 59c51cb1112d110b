"""A difference of two comparisons as Markdown: what got worse, what changed, and which runs to look at."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..comparisons.difference import SIGNIFICANT, Change, Difference, Outcome, Shift, significant
from ..comparisons.statistics import median, with_interval
from ..comparisons.statistics.judged import MIN_SCENES
from .markdown import Table, bold, bullets, enumeration, plain
from .numbers import DASH, number
from .page import render

TIMES = ("step_time_median_us", "step_time_p99_us", "rows_time_median_us")

#: Runs that are named, lines of the table of metrics, names in a cell, and characters of a setting.
MAX_RUNS, MAX_LINES, MAX_NAMES, MAX_LENGTH = 10, 100, 3, 60


def page(found: Difference) -> str:
    """The whole page."""
    group, outcomes = found.a.group, [(each, p) for each, p in found.found if isinstance(each, Outcome)]
    shifts = sorted(
        ((each, p) for each, p in found.found if isinstance(each, Shift)), key=lambda one: (one[1] is None, one[1] or 0)
    )
    ended = [
        [*_group(each), each.what, _mark(found, each, p),
         *map(str, (len(each.group.positions), each.before, each.after, len(each.lost), len(each.gained))), _p(p)]
        for each, p in outcomes
    ]  # fmt: skip
    moved = [
        [*_group(each), each.metric.header, _mark(found, each, p), *map(str, (each.of, each.better, each.worse)),
         _moved(each, found.confidence), _p(p)]
        for each, p in shifts[:MAX_LINES]
    ]  # fmt: skip
    return render(
        "difference.md",
        found=found,
        verdict=verdict(found),
        changes=Table(["part", "what", "of", "A", "B"], map(_change, found.changes), 5),
        same=int((~found.pairs.differ).sum()),
        named=_named,
        outcomes=Table(
            ["law", *group, "outcome", "", "runs", "in A", "in B", "lost", "gained", "p"], ended, 3 + len(group)
        ),
        lost=[line for each, _ in outcomes for line in _lost(found, each)],
        shifts=Table(
            ["law", *group, "metric", "", "runs", "better", "worse", "median of B − A where they differ", "p"],
            moved,
            3 + len(group),
        ),
        more_shifts=len(shifts) - MAX_LINES,
        times=Table(["law", *group, "time", "A", "B", "median of B / A"], _times(found), 2 + len(group)),
        significant=SIGNIFICANT,
        min_pairs=MIN_SCENES,
    )


def verdict(found: Difference) -> str:
    """What got worse, line by line, and what got better."""
    if not found.pairs.differ.any():
        return f"All {len(found.pairs.differ)} runs that both have are the same, but for their times."
    worse = found.worse
    better = [each for each, p in found.found if significant(p) and not each.for_worse and each not in worse]
    lines = []
    for word, those in (("Worse", worse), ("Better", better)):
        lines += [f"{word}: {_sentence(each, found.confidence)}" for each in those[:MAX_RUNS]]
        if len(those) > MAX_RUNS:
            lines.append(f"{len(those) - MAX_RUNS} more got {word.lower()}.")
    return bullets(lines or ["Nothing got worse."])


def _sentence(found: Outcome | Shift, confidence: float) -> str:
    law, *place = _group(found)
    group = ", ".join((bold(law), *place))
    if isinstance(found, Outcome):
        return f"{group}: {found.what} in {found.after} of {len(found.group.positions)} runs, before in {found.before}"
    return (
        f"{group}: {found.metric.header} by {_moved(found, confidence)} in the median where runs differ; "
        f"worse in {found.worse}, better in {found.better} of {found.of}"
    )


def _change(change: Change) -> list[str]:
    names = enumeration(change.names)
    if len(change.names) > MAX_NAMES:
        names = f"{len(change.names)}: {', '.join(change.names[:MAX_NAMES])}, …"
    return [change.part, plain(change.what), plain(names), _value(change.before), _value(change.after)]


def _value(value: Any) -> str:
    text = str(value)
    return DASH if value is None else plain(text if len(text) <= MAX_LENGTH else f"{text[:MAX_LENGTH]}…")


def _named(runs: Any) -> str:
    more = f", and {len(runs) - MAX_RUNS} more" if len(runs) > MAX_RUNS else ""
    return plain("; ".join(", ".join(map(str, run)) for run in runs.head(MAX_RUNS).itertuples(index=False))) + more


def _lost(found: Difference, outcome: Outcome) -> Iterator[str]:
    """The first runs that B lost, with status and reason."""
    for position in outcome.lost[:MAX_RUNS]:
        run = found.pairs.b.iloc[position]
        name = ", ".join(map(str, found.pairs.b.index[position]))
        why = (f"violated {run['violated']}" if outcome.what == "stays inside" else run["status"]), run["reason"]
        yield f"{plain(name)} no longer {outcome.what}: {plain('; '.join(filter(None, why)))}"
    if len(outcome.lost) > MAX_RUNS:
        yield f"{len(outcome.lost) - MAX_RUNS} more of {plain(outcome.group)}"


def _times(found: Difference) -> Iterator[list[str]]:
    for group in found.groups:
        for column in TIMES:
            a, b = (runs[column].to_numpy(dtype=float) for runs in (group.a, group.b))
            exist = np.isfinite(a) & np.isfinite(b) & (a > 0.0)
            if exist.any():
                a, b = a[exist], b[exist]
                medians = (number(float(np.median(each))) for each in (a, b, b / a))
                yield [plain(group.law), *map(plain, group.place), column, *medians]


def _group(found: Outcome | Shift) -> list[str]:
    return [plain(found.group.law), *map(plain, found.group.place)]


def _mark(found: Difference, each: Outcome | Shift, p: float | None) -> str:
    if found.counts(each, p):
        return bold("worse")
    return ("worse" if each.for_worse else "better") if significant(p) else "" if p is None else "≈"


def _moved(shift: Shift, confidence: float) -> str:
    """The median of the differences in the unit in which reports show the metric."""
    factor = shift.metric.factor * (100.0 if shift.metric.style == "percent" else 1.0)
    return with_interval(*median(shift.differences, confidence)[:3], factor)


def _p(p: float | None) -> str:
    return DASH if p is None else "<0.001" if p < 1e-3 else number(p)
