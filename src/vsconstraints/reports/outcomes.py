"""How every scenario ended with every controller, at a glance."""

from __future__ import annotations

from ..comparisons.metrics import NEGLIGIBLE, TOLERANT
from .headlines import anchor
from .markdown import tables
from .numbers import of_length
from .results import Line, Results, violated

OUTSIDE, WITHIN = "†", "‡"


def outcomes(results: Results) -> str:
    """One line per scenario and one column per controller; the other way round where there are more controllers."""
    laws, scenarios = results.controllers, results.scenarios
    linked = {name: f"[{name}](#{anchor(name)})" for name in scenarios}
    if len(laws) > len(scenarios):
        header = ["controller", *linked.values()]
        lines = [[law, *(outcome(results, name, law) for name in scenarios)] for law in laws]
    else:
        header = ["scenario", *laws]
        lines = [[link, *(outcome(results, name, law) for law in laws)] for name, link in linked.items()]
    legend = (
        f"{OUTSIDE} a row was violated by more than {of_length(TOLERANT)}. {WITHIN} by more than "
        f"{of_length(NEGLIGIBLE)}, and no more than that."
    )
    if results.trials > 1:
        legend += " Counts are of trials."
    return "\n\n".join(("## Outcomes", tables(header, lines, len(header)), legend))


def outcome(results: Results, scenario: str, controller: str) -> str:
    """How a controller ended on a scenario, counted where there are several trials, with marks for violated rows."""
    lines = results.runs(scenario, controller)
    if not lines:
        return "not run"
    endings = [f"{line['status'] or 'unknown'}{_mark(line)}" for line in lines]
    if len(lines) == 1:
        return endings[0]
    return ", ".join(f"{endings.count(ending)} {ending}" for ending in dict.fromkeys(endings))


def _mark(line: Line) -> str:
    return OUTSIDE if violated(line, "violated_tolerant") else WITHIN if violated(line) else ""
