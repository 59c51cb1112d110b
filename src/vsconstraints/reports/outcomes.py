"""How every scenario ended with every controller, at a glance."""

from __future__ import annotations

from .groups import by_controller
from .headlines import anchor
from .results import Line, Results, violated, within_band

OUTSIDE, WITHIN = "†", "‡"


def outcomes(results: Results) -> str:
    """One line per scenario, one column per controller."""
    lines = [
        ([f"[{name}](#{anchor(name)})"], {one: _outcome(list(results.runs(name, one))) for one in results.controllers})
        for name in results.scenarios
    ]
    legend = f"{OUTSIDE} a row was violated. {WITHIN} none was, but one was outside within the sampling band."
    if results.trials > 1:
        legend += " Counts are of trials."
    table = by_controller(results.groups, ["scenario"], lines, left=1 + len(results.controllers))
    return "\n\n".join(("## Outcomes", table, legend))


def _outcome(lines: list[Line]) -> str:
    if not lines:
        return "not run"
    endings = [f"{line['status'] or 'unknown'}{_mark(line)}" for line in lines]
    if len(lines) == 1:
        return endings[0]
    return ", ".join(f"{endings.count(ending)} {ending}" for ending in dict.fromkeys(endings))


def _mark(line: Line) -> str:
    return OUTSIDE if violated(line) else WITHIN if within_band(line) else ""
