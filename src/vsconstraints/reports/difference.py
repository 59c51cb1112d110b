"""A difference of two comparisons as Markdown: what got worse, what changed, and which runs to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..comparisons.difference import SIGNIFICANT, Change, Difference, Outcome, Shift, significant
from ..comparisons.statistics import median, with_interval
from ..comparisons.statistics.judged import MIN_SCENES
from .markdown import bold, bullets, code, enumeration, plain, table
from .numbers import DASH, number

TIMES = ("step_time_median_us", "step_time_p99_us", "rows_time_median_us")

MAX_RUNS, MAX_LINES, MAX_NAMES, MAX_LENGTH = 10, 100, 3, 60
"""Runs that are named, lines of the table of metrics, names in a cell, and characters of a setting."""


def page(found: Difference) -> str:
    """The whole page."""
    sections = {
        "What changed": _changes(found.changes),
        "Runs": _runs(found),
        "How runs end": _outcomes(found),
        "Metrics": _shifts(found),
        "Times": _times(found),
        "How this is judged": _judged(found),
    }
    parts = [f"# {plain(str(found.b.folder))} against {plain(str(found.a.folder))}", verdict(found)]
    return "\n\n".join([*parts, *(f"## {title}\n\n{text}" for title, text in sections.items())]) + "\n"


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
    group = ", ".join((bold(plain(found.group.law)), *map(plain, found.group.place)))
    if isinstance(found, Outcome):
        return f"{group}: {found.what} in {found.after} of {len(found.group.positions)} runs, before in {found.before}"
    return (
        f"{group}: {found.metric.header} by {_moved(found, confidence)} in the median where runs differ; "
        f"worse in {found.worse}, better in {found.better} of {found.of}"
    )


def _changes(changes: Sequence[Change]) -> str:
    lines = []
    for change in changes:
        names = enumeration(change.names)
        if len(change.names) > MAX_NAMES:
            names = f"{len(change.names)}: {', '.join(change.names[:MAX_NAMES])}, …"
        lines.append([change.part, plain(change.what), plain(names), _value(change.before), _value(change.after)])
    return table(["part", "what", "of", "A", "B"], lines, text_columns=5) if lines else "Nothing."


def _value(value: Any) -> str:
    text = str(value)
    return DASH if value is None else plain(text if len(text) <= MAX_LENGTH else f"{text[:MAX_LENGTH]}…")


def _runs(found: Difference) -> str:
    pairs = found.pairs
    same = int((~pairs.differ).sum())
    lines = [f"{len(pairs.differ)} runs are in both; {same} of them are the same, but for their times."]
    if pairs.drawn_otherwise:
        lines.append(f"{pairs.drawn_otherwise} scenes are not the same in both, and left out.")
    for name, alone in (("A", pairs.only_a), ("B", pairs.only_b)):
        if len(alone):
            runs = [", ".join(map(str, run)) for run in alone.head(MAX_RUNS).itertuples(index=False)]
            more = f", and {len(alone) - MAX_RUNS} more" if len(alone) > MAX_RUNS else ""
            lines.append(f"{len(alone)} only in {name}: {plain('; '.join(runs))}{more}.")
    for name, side in (("A", found.a), ("B", found.b)):
        planned, finished = side.manifest.get(side.unit), side.manifest.get("finished")
        if planned != finished:
            lines.append(f"{name} is not finished: {finished} of {planned} {side.unit}.")
    return bullets(lines)


def _outcomes(found: Difference) -> str:
    own = [(each, p) for each, p in found.found if isinstance(each, Outcome)]
    if not own:
        return "Every run that is in both ends alike: it converges, violates something or fails in both or in neither."
    lines = []
    for each, p in own:
        counts = len(each.group.positions), each.before, each.after, len(each.lost), len(each.gained)
        lines.append([*_group(each), each.what, _mark(found, each, p), *map(str, counts), _p(p)])
    header = ["law", *found.a.group, "outcome", "", "runs", "in A", "in B", "lost", "gained", "p"]
    parts = [table(header, lines, text_columns=3 + len(found.a.group))]
    if lost := [line for each, _ in own for line in _lost(found, each)]:
        parts.append(bullets(lost))
    return "\n\n".join(parts)


def _lost(found: Difference, outcome: Outcome) -> list[str]:
    """The first runs that B lost, with status and reason."""
    lines = []
    for position in outcome.lost[:MAX_RUNS]:
        run = found.pairs.b.iloc[position]
        name = ", ".join(map(str, found.pairs.b.index[position]))
        why = (f"violated {run['violated']}" if outcome.what == "stays inside" else run["status"]), run["reason"]
        lines.append(f"{plain(name)} no longer {outcome.what}: {plain('; '.join(filter(None, why)))}")
    if len(outcome.lost) > MAX_RUNS:
        lines.append(f"{len(outcome.lost) - MAX_RUNS} more of {plain(str(outcome.group))}")
    return lines


def _shifts(found: Difference) -> str:
    own = [(each, p) for each, p in found.found if isinstance(each, Shift)]
    if not own:
        return "No metric differs in any run that converged in both."
    lines = []
    for each, p in sorted(own, key=lambda own: (own[1] is None, own[1] or 0.0)):
        counts = map(str, (each.of, each.better, each.worse))
        moved = _moved(each, found.confidence)
        lines.append([*_group(each), each.metric.header, _mark(found, each, p), *counts, moved, _p(p)])
    header = ["law", *found.a.group, "metric", "", "runs", "better", "worse", "median of B − A where they differ", "p"]
    text = table(header, lines[:MAX_LINES], text_columns=3 + len(found.a.group))
    return f"{text}\n\n{len(lines) - MAX_LINES} more, less significant." if len(lines) > MAX_LINES else text


def _times(found: Difference) -> str:
    lines = []
    for group in found.groups:
        for column in TIMES:
            a, b = (runs[column].to_numpy(dtype=float) for runs in (group.a, group.b))
            exist = np.isfinite(a) & np.isfinite(b) & (a > 0.0)
            if exist.any():
                a, b = a[exist], b[exist]
                medians = (number(float(np.median(values))) for values in (a, b, b / a))
                lines.append([plain(group.law), *map(plain, group.place), column, *medians])
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
        f"Where fewer than {MIN_SCENES} pairs differ, nothing is tested: no test could find anything.",
        "A metric is compared over pairs in which both runs converged, violated nothing and lost no sliding mode, as "
        "far as the metric requires that. Medians are of those of them that differ, with simultaneous 95 % "
        "intervals: one excludes zero where the test does.",
        f"{code('worse')} marks what decides, {code('better')} what is significant the other way, and "
        f"{code('≈')} what is inconclusive.",
    ]
    return bullets(lines)


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
