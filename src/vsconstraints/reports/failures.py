"""Where controllers do not carry a scenario through, or leave the allowed space: which row, when and why."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping

from .challenges import FINER
from .drawing import Drawn
from .headlines import anchor
from .markdown import bullets, code, enumeration, plain
from .numbers import number
from .results import Line, Results

AT_THE_END = 0.5
"""A row that acted within this time before the end counts as acting at the end [s]."""


def failures(results: Results, drawn: Mapping[str, Drawn]) -> str:
    """One list per scenario; all controllers but tracking alone are treated alike.

    One entry per controller or, where there are several trials, one per controller and kind of failure.
    """
    parts = ["## Where controllers fail"]
    for scenario in results.scenarios:
        entries = []
        for name in results.competitors:
            if results.trials > 1:
                entries += [f"**{name}**{text}" for text in _counted(results, scenario, name)]
                continue
            for line in results.runs(scenario, name):
                sentences = _sentences(results, drawn.get(scenario, Drawn()), line)
                if sentences:
                    entries.append(f"**{name}**: {' '.join(sentences)}")
        if entries:
            parts.append(f"[{scenario}](#{anchor(scenario)})\n\n{bullets(entries)}")
    if len(parts) == 1:
        parts.append("Every run that finished converged and violated no row.")
    return "\n\n".join(parts)


def kind(reason: str) -> str:
    """A reason without its numbers: runs that fail in the same way at other times and places have the same."""
    return re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", "#", reason)


def _counted(results: Results, scenario: str, controller: str) -> list[str]:
    """One text per kind of failure of a controller: in how many trials, and the first or the worst of them."""
    runs = results.runs(scenario, controller)
    ended: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for run in runs:
        if run["status"] != "converged":
            ended[run["status"], kind(run["reason"])].append(run)
    texts = []
    for (status, _), own in ended.items():
        first = own[0]
        reason = f": {plain(first['reason'])}" if first["reason"] else ""
        texts.append(
            f", {len(own)} of {len(runs)} trials: {status.capitalize()}, first in trial {first['trial']:.0f}{reason}."
        )
    outside: dict[str, list[Line]] = defaultdict(list)
    for row in results.rows(scenario, controller):
        if row["violation_depth"] > 0.0:
            outside[row["constraint"]].append(row)
    for own in outside.values():
        worst = max(own, key=lambda row: float(row["violation_depth"]))
        texts.append(
            f", {len(own)} of {len(runs)} trials: {_outside_by(worst)}, at worst in trial {worst['trial']:.0f}."
        )
    return texts


def _sentences(results: Results, drawn: Drawn, run: Line) -> list[str]:
    sentences = []
    rows = [row for row in results.rows(run["scenario"], run["controller"]) if row["trial"] == run["trial"]]
    if run["status"] != "converged":
        reason = f": {plain(str(run['reason']))}" if run["reason"] else ""
        sentences.append(f"{str(run['status'] or 'status unknown').capitalize()}{reason}.")
        acting = [code(row["constraint"]) for row in rows if row["last_active_s"] >= run["duration_s"] - AT_THE_END]
        if acting:
            sentences.append(f"Acting in the last {AT_THE_END:g} s: {enumeration(acting)}.")
    for row in rows:
        if row["violation_depth"] > 0.0:
            sentences.append(_outside(drawn, run, row))
    if sentences and run["status"] == "converged":
        sentences.insert(0, "Converged.")
    return sentences


def _outside(drawn: Drawn, run: Line, row: Line) -> str:
    text = _outside_by(row)
    first = drawn.first_outside.get((run["controller"], row["constraint"])) if run["trial"] == 0 else None
    return f"{text}, first at {first:.3f} s." if first is not None else f"{text}."


def _outside_by(row: Line) -> str:
    """Which row was left, how far and how long."""
    unit, factor = FINER.get(row["unit"], (plain(row["unit"]), 1.0))
    text = f"Outside {code(row['constraint'])} by up to {number(factor * row['violation_depth'])} {unit}"
    if row["violation_time_s"] > 0.0:
        return f"{text} for {number(row['violation_time_s'])} s"
    return f"{text}, between samples only"
