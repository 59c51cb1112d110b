"""Where controllers do not carry a scenario through, or leave the allowed space: which row, when and why."""

from __future__ import annotations

from collections.abc import Mapping

from .challenges import FINER
from .headlines import anchor
from .jobs import Drawn
from .markdown import bullets, code, enumeration, plain
from .numbers import number
from .results import Line, Results

AT_THE_END = 0.5
"""A row that acted within this time before the end counts as acting at the end [s]."""


def failures(results: Results, drawn: Mapping[str, Drawn]) -> str:
    """One list per scenario, one entry per controller; all controllers but tracking alone are treated alike."""
    parts = ["## Where controllers fail"]
    for scenario in results.scenarios:
        entries = []
        for name in results.competitors:
            for line in results.runs(scenario, name):
                sentences = _sentences(results, drawn[scenario], line)
                if sentences:
                    trial = f", trial {line['trial']:.0f}" if results.trials > 1 else ""
                    entries.append(f"**{name}**{trial}: {' '.join(sentences)}")
        if entries:
            parts.append(f"[{scenario}](#{anchor(scenario)})\n\n{bullets(entries)}")
    if len(parts) == 1:
        parts.append("Every run that finished converged and violated no row.")
    return "\n\n".join(parts)


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
    unit, factor = FINER.get(row["unit"], (row["unit"], 1.0))
    text = f"Outside {code(row['constraint'])} by up to {number(factor * row['violation_depth'])} {unit}"
    if row["violation_time_s"] > 0.0:
        text += f" for {number(row['violation_time_s'])} s"
    else:
        text += ", between samples only"
    first = drawn.first_outside.get((run["controller"], row["constraint"])) if run["trial"] == 0 else None
    return f"{text}, first at {first:.3f} s." if first is not None else f"{text}."
