"""What was found, computed from the data."""

from __future__ import annotations

import math
from itertools import combinations
from urllib.parse import quote

from ..comparisons.metrics import METRICS, NEGLIGIBLE, TOLERANT, Metric
from ..comparisons.suite import BASELINE
from ..rows.readable import counted
from ..simulation.start import UNSOLVABLE
from .best import shown
from .markdown import bold, bullets, code, enumeration
from .numbers import FORMATS, median, number, of_length
from .results import CARRIED_THROUGH, Line, Results, clean, violated

MOST_NAMES = 9
"""A sentence names no more scenarios than this."""

NOT_CONVERGED = {
    "slow": "was too slow",
    "trapped": "was trapped",
    "aborted": "was aborted",
    "failed": "failed",
    "unfinished": "was still moving at the end",
}
"""What a controller did in runs that did not converge."""


def findings(results: Results) -> str:
    """What was found, a line each."""
    return f"## Findings\n\n{bullets(_findings(results))}"


def anchor(scenario: str) -> str:
    """Where a scenario's section is, in links."""
    return quote(f"scenario-{scenario}")


def _findings(results: Results) -> list[str]:
    if not results.competitors:
        return [f"Only {BASELINE} alone was run: there is nothing to compare."]
    ranked_names = sorted(results.clean, key=lambda name: -results.clean[name])
    found = [
        f"Runs that converged without violating a row by more than {of_length(NEGLIGIBLE)}: "
        + ", ".join(_clean_runs(results, name) for name in ranked_names)
        + "."
    ]
    found += _disagreement(results)
    found += [_of_controller(results, name) for name in results.competitors]
    if len(results.competitors) > 1:
        found += [text for metric in METRICS if metric.finding[0] and (text := _winners(results, metric))]
    nobody = [name for name in results.scenarios if _ran(results, name) and not _clean(results, name)]
    if nobody:
        found.append(
            "Nobody converged without violating a row in "
            + enumeration(some([f"[{name}](#{anchor(name)}){_why(results, name)}" for name in nobody]))
            + "."
        )
    return found


def _why(results: Results, scenario: str) -> str:
    """That nobody could, where that is known."""
    reasons = [line["reason"] for name in results.competitors for line in results.runs(scenario, name)]
    closed = reasons and all(UNSOLVABLE in reason for reason in reasons)
    return " (nobody could: constraints close off a marker from its goal)" if closed else ""


def _clean_runs(results: Results, name: str) -> str:
    lines = results.all_runs(name)
    strict, tolerant = results.clean[name], results.clean_tolerant[name]
    text = f"{bold(name)} {strict} of {len(lines)}"
    return f"{text} ({tolerant} by no more than {of_length(TOLERANT)})" if tolerant > strict else text


def _disagreement(results: Results) -> list[str]:
    """Which laws the two standards do not rank alike."""
    strict, tolerant = results.clean, results.clean_tolerant
    pairs = [
        f"{a} is {_ranked(strict[a], strict[b])} {b} at {of_length(NEGLIGIBLE)}, and "
        f"{_ranked(tolerant[a], tolerant[b])} it at {of_length(TOLERANT)}"
        for a, b in combinations(results.competitors, 2)
        if _ranked(strict[a], strict[b]) != _ranked(tolerant[a], tolerant[b])
    ]
    return [f"The two standards do not rank these laws alike: {'; '.join(some(pairs))}."] if pairs else []


def _ranked(one: int, other: int) -> str:
    return "ahead of" if one > other else "behind" if one < other else "level with"


def _of_controller(results: Results, name: str) -> str:
    lines = results.all_runs(name)
    if not lines:
        return f"{bold(name)}: no run finished."
    converged = sum(line["status"] == "converged" for line in lines)
    text = f"{bold(name)} converged in {converged} of {counted(len(lines), 'run')}"
    for status, did in NOT_CONVERGED.items():
        where = list(dict.fromkeys(line["scenario"] for line in lines if line["status"] == status))
        if where:
            text += f", {did} in {enumeration(some(where))}"
    outside = [line for line in lines if violated(line)]
    carried = sum(line["status"] in CARRIED_THROUGH for line in lines)
    if not outside:
        return f"{text}; it violated no row." if carried == len(lines) else f"{text}; until then it violated no row."
    worst = max(outside, key=lambda line: float(line["violation_depth"]))
    where = list(dict.fromkeys(line["scenario"] for line in outside))
    return (
        f"{text}; it violated rows in {counted(len(outside), 'run')} ({enumeration(some(where))}), at worst by "
        f"{number(100.0 * worst['violation_depth'])} % of L ({_worst_row(results, worst)}, {worst['scenario']})."
    )


def _worst_row(results: Results, run: Line) -> str:
    """The row that is outside by the greatest share of its characteristic length."""
    rows = [
        row
        for row in results.rows(run["scenario"], run["controller"])
        if row["trial"] == run["trial"] and row["violation_depth"] > 0.0
    ]
    worst = max(rows, key=lambda row: float(row["usage_max"]), default=None)
    return code(worst["constraint"]) if worst else "row unknown"


def _winners(results: Results, metric: Metric) -> str:
    """In which scenarios each controller is the best of those that converged without violating a row, strictly.

    Nobody is where nothing is challenged, or where there is nobody else to be better than.
    """
    (what, unit), show = metric.finding, FORMATS[metric.style]
    won: dict[str, list[str]] = {}
    for scenario in results.challenged_scenarios:
        values = {
            name: median([shown(metric, line) for line in results.runs(scenario, name)])
            for name in _clean(results, scenario)
        }
        values = {name: value for name, value in values.items() if math.isfinite(value)}
        if len({show(value) for value in values.values()}) < 2:
            continue
        top = show((max if metric.better == "more" else min)(values.values()))
        for name, value in values.items():
            if show(value) == top:
                won.setdefault(name, []).append(f"{scenario} ({top} {unit})")
    if not won:
        return ""
    ranked = sorted(won.items(), key=lambda item: -len(item[1]))
    return (
        f"{what}, among the controllers that converged and violated no row: "
        + "; ".join(f"{bold(name)} in {enumeration(some(where))}" for name, where in ranked)
        + "."
    )


def _clean(results: Results, scenario: str) -> list[str]:
    """Controllers that converged and violated nothing, in every trial."""
    runs = {name: results.runs(scenario, name) for name in results.competitors}
    return [name for name, lines in runs.items() if lines and all(map(clean, lines))]


def _ran(results: Results, scenario: str) -> bool:
    return any(results.runs(scenario, name) for name in results.competitors)


def some(names: list[str]) -> list[str]:
    """The names or, if there are more than :data:`MOST_NAMES`, the first of them and how many more there are."""
    return names if len(names) <= MOST_NAMES else [*names[: MOST_NAMES - 1], f"{len(names) - MOST_NAMES + 1} more"]
