"""A difference as a page of Markdown: what got worse, what changed, and which runs to look at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..comparisons.difference.difference import SIGNIFICANT, Change, Difference, Outcome, Shift, significant
from ..comparisons.difference.pairs import LEAST_PAIRS
from ..comparisons.statistics import median, with_interval
from .markdown import bold, bullets, code, enumeration, plain, table
from .numbers import DASH, number

TIMES = ("step_time_median_us", "step_time_p99_us", "rows_time_median_us")
"""Columns that are compared for information."""

FIRST = 10
"""So many runs or names of a kind are named, and the others counted."""

MOST_LINES = 100
"""So many lines has the table of metrics, those with the least p first."""

FEW = 3
"""So many names stand in a cell."""

LONGEST_VALUE = 60
"""Characters of a setting that are shown."""


def page(found: Difference) -> str:
    """The whole of it."""
    parts = [
        f"# {plain(str(found.b.folder))} against {plain(str(found.a.folder))}",
        verdict(found),
        "## What changed",
        _changes(found.changes),
        "## Runs",
        _runs(found),
        "## How runs end",
        _outcomes(found),
        "## Metrics",
        _shifts(found),
        "## Times",
        _times(found),
        "## How this is judged",
        _judged(found),
    ]
    return "\n\n".join(parts) + "\n"


def verdict(found: Difference) -> str:
    """What got worse, line by line, and what got better; that nothing did if so."""
    same = not found.pairs.differ.any()
    if same:
        return f"All {len(found.pairs.differ)} runs that both have are the same, but for their times."
    worse = [f"Worse: {_sentence(one, found.confidence)}" for one in found.worse]
    better = [
        f"Better: {_sentence(one, found.confidence)}"
        for one, p in found.found
        if significant(p) and not one.for_worse and one not in found.worse
    ]
    return bullets([*_first(worse, "more got worse"), *_first(better, "more got better")] or ["Nothing got worse."])


def _sentence(one: Outcome | Shift, confidence: float) -> str:
    group = f"{bold(plain(one.group.law))}{''.join(f', {plain(place)}' for place in one.group.place)}"
    if isinstance(one, Outcome):
        return f"{group}: {one.what} in {one.after} of {len(one.group.positions)} runs, before in {one.before}"
    return (
        f"{group}: {one.metric.header} by {_moved(one, confidence)} in the median where runs differ; "
        f"worse in {one.worse}, better in {one.better} of {one.of}"
    )


def _changes(changes: Sequence[Change]) -> str:
    lines = [
        [change.part, plain(change.what), _names(change.names), _value(change.before), _value(change.after)]
        for change in changes
    ]
    return table(["part", "what", "of", "A", "B"], lines, text_columns=5) if lines else "Nothing."


def _runs(found: Difference) -> str:
    pairs = found.pairs
    same = int((~pairs.differ).sum())
    lines = [f"{len(pairs.differ)} runs are in both; {same} of them are the same, but for their times."]
    if pairs.drawn_otherwise:
        lines.append(f"{pairs.drawn_otherwise} scenes are not the same in both, and left out.")
    for name, alone in (("A", pairs.only_a), ("B", pairs.only_b)):
        if len(alone):
            runs = [", ".join(map(str, run)) for run in alone.head(FIRST).itertuples(index=False)]
            more = f", and {len(alone) - FIRST} more" if len(alone) > FIRST else ""
            lines.append(f"{len(alone)} only in {name}: {plain('; '.join(runs))}{more}.")
    for name, side in (("A", found.a), ("B", found.b)):
        planned, finished = side.manifest.get(side.unit), side.manifest.get("finished")
        if planned != finished:
            lines.append(f"{name} is not finished: {finished} of {planned} {side.unit}.")
    return bullets(lines)


def _outcomes(found: Difference) -> str:
    own = [(one, p) for one, p in found.found if isinstance(one, Outcome)]
    if not own:
        return "Every run that is in both ends alike: it converges, violates something or fails in both or in neither."
    places = found.a.group
    lines = [
        [
            plain(one.group.law),
            *map(plain, one.group.place),
            one.what,
            _mark(found, one, p),
            *map(str, (len(one.group.positions), one.before, one.after, len(one.lost), len(one.gained))),
            _p(p),
        ]
        for one, p in own
    ]
    header = ["law", *places, "outcome", "", "runs", "in A", "in B", "lost", "gained", "p"]
    named = [line for one, _ in own if len(one.lost) for line in _lost(found, one)]
    return "\n\n".join([table(header, lines, text_columns=3 + len(places)), *([bullets(named)] if named else [])])


def _lost(found: Difference, one: Outcome) -> list[str]:
    """The first runs that B lost, with what it says of them."""
    lines = []
    for position in one.lost[:FIRST]:
        run = found.pairs.b.iloc[position]
        name = ", ".join(str(part) for part in found.pairs.b.index[position])
        why = (f"violated {run['violated']}" if one.what == "stays inside" else run["status"]), run["reason"]
        lines.append(f"{plain(name)} no longer {one.what}: {plain('; '.join(filter(None, why)))}")
    if len(one.lost) > FIRST:
        lines.append(f"… and {len(one.lost) - FIRST} more of {plain(str(one.group))}")
    return lines


def _shifts(found: Difference) -> str:
    own = [(one, p) for one, p in found.found if isinstance(one, Shift)]
    if not own:
        return "No metric differs in any run that converged in both."
    places = found.a.group
    lines = [
        [
            plain(one.group.law),
            *map(plain, one.group.place),
            one.metric.header,
            _mark(found, one, p),
            *map(str, (one.of, one.better, one.worse)),
            _moved(one, found.confidence),
            _p(p),
        ]
        for one, p in sorted(own, key=lambda own: (own[1] is None, own[1] or 0.0))
    ]
    header = ["law", *places, "metric", "", "runs", "better", "worse", "median of B − A where they differ", "p"]
    shown = table(header, lines[:MOST_LINES], text_columns=3 + len(places))
    return f"{shown}\n\n{len(lines) - MOST_LINES} more, less surely." if len(lines) > MOST_LINES else shown


def _times(found: Difference) -> str:
    lines = []
    for group in found.groups:
        for column in TIMES:
            a, b = (runs[column].to_numpy(dtype=float) for runs in (group.a, group.b))
            exist = np.isfinite(a) & np.isfinite(b) & (a > 0.0)
            if exist.any():
                medians = (float(np.median(each[exist])) for each in (a, b, b / np.where(exist, a, 1.0)))
                lines.append([plain(group.law), *map(plain, group.place), column, *map(number, medians)])
    header = ["law", *found.a.group, "time", "A", "B", "median of B / A"]
    text = "They are those of two commands, perhaps on two machines, and decide nothing."
    return f"{text}\n\n{table(header, lines, text_columns=2 + len(found.a.group))}" if lines else "None."


def _judged(found: Difference) -> str:
    strict = (
        "Each run counts that no longer converges, violates something new, or fails."
        if found.strict
        else "Scenes are drawn: how often runs converge, violate something or fail counts where it is significant, "
        "single runs do not."
    )
    lines = [
        strict,
        f"Metrics count where they are significantly worse, p ≤ {SIGNIFICANT:g} after correction for all tests of "
        "this page (Bonferroni): the sign test for metrics, McNemar's (exact) for how runs end, both two-sided and of "
        "pairs.",
        f"Where fewer than {LEAST_PAIRS} pairs differ, nothing is tested: no test could find anything.",
        "A metric is compared over pairs in which both runs converged, violated nothing and lost no sliding mode, as "
        "far as the metric asks for that. Medians are of those of them that differ, with simultaneous 95 % "
        "intervals: one excludes zero where the test does.",
        f"{code('worse')} marks what decides, {code('better')} what is significant the other way, and "
        f"{code('≈')} what cannot be told from no difference.",
    ]
    return bullets(lines)


def _mark(found: Difference, one: Outcome | Shift, p: float | None) -> str:
    if found.counts(one, p):
        return bold("worse")
    return ("worse" if one.for_worse else "better") if significant(p) else "" if p is None else "≈"


def _moved(one: Shift, confidence: float) -> str:
    """The median of the differences in the unit in which reports show the metric."""
    shown_as = one.metric.factor * (100.0 if one.metric.style == "percent" else 1.0)
    return with_interval(*median(one.differences, confidence)[:3], shown_as)


def _p(p: float | None) -> str:
    return DASH if p is None else "<0.001" if p < 1e-3 else number(p)


def _names(names: tuple[str, ...]) -> str:
    return plain(enumeration(names)) if len(names) <= FEW else f"{len(names)}: {plain(', '.join(names[:FEW]))}, …"


def _value(value: Any) -> str:
    if value is None:
        return DASH
    text = str(value)
    return plain(text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…")


def _first(lines: Sequence[str], more: str) -> Iterable[str]:
    return [*lines[:FIRST], *([f"{len(lines) - FIRST} {more}."] if len(lines) > FIRST else [])]
