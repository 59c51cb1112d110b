"""Tables over all scenarios: the answer a report begins with, outcomes, scores, violations and the best of each."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from urllib.parse import quote

from ..comparisons.metrics import METRICS, NEGLIGIBLE, TOLERANCES, TOLERANT, Metric
from ..comparisons.statistics import rate_of, rate_text
from ..comparisons.suite import BASELINE
from ..rows.readable import counted
from ..simulation.start import UNSOLVABLE
from .best import Better, Cell, judged_by, marked, shown
from .markdown import Table, bold, code, enumeration
from .numbers import DASH, FORMATS, count, largest, median, number, of_length
from .results import Line, Results, clean, diverged, violated

STATUSES = ("converged", "slow", "trapped", "unfinished", "aborted", "failed")

CONDENSED: dict[str, Callable[[Sequence[float]], float]] = {"worst": largest, "median": median}
"""How several runs become one value."""

FIRST = ("violation_depth", "utilization", "acceleration_variation", "step_time_median_us")
"""Columns of results.csv in the first table."""

MAX_COLUMNS = 8
"""Of the first table."""

MAX_NAMES = 9
"""A cell names no more scenarios than this."""

FIRST_LEGEND = (
    "*Converged inside*: runs that converged and violated no constraint, strictly (by more than "
    f"{of_length(NEGLIGIBLE)}); next to it with {of_length(TOLERANT)} tolerated. Medians over converged runs; timing "
    "medians over all runs. **Bold**: best of the column. Values in parentheses are excluded from the ranking: the "
    "controller failed a run that another controller solved, or violated a constraint. Timings are not ranked; "
    "*implementation* says whether compiled or NumPy code was timed."
)

Column = tuple[str, list[str]]


def answer(results: Results) -> str:
    """How often the unconstrained baseline violates a constraint, and each controller converges without doing so."""
    if not results.competitors:
        return f"Only {BASELINE} was run: there is nothing to compare."
    sentences = []
    baseline = results.all_runs(BASELINE)
    if baseline:
        times = sum(bool(violated(run)) for run in baseline)
        sentences.append(f"Unconstrained tracking violates a constraint in {times} of {counted(len(baseline), 'run')}.")
    if baseline and not results.challenged_scenarios:
        sentences.append("Controllers are not ranked.")
    ranking: dict[tuple[int, int], list[str]] = defaultdict(list)
    for name, good in results.clean.items():
        ranking[good, len(results.all_runs(name))].append(name)
    ordered = sorted(ranking.items(), key=lambda item: (-item[0][0], item[0][1]))
    contested = len(ordered) > 1 and bool(results.challenged_scenarios)
    texts = []
    for place, ((good, runs), names) in enumerate(ordered):
        named = enumeration([bold(name) for name in names] if contested and place == 0 else names)
        texts.append(f"{named} {rate_text(rate_of(good, runs)) if results.trials > 1 else f'{good} of {runs}'}")
    sentences.append(f"Converged without violating one by more than {of_length(NEGLIGIBLE)}: {'; '.join(texts)}.")
    if results.trials > 1:
        sentences.append("Intervals are over trials of these scenarios, not over other scenarios.")
    return " ".join(sentences)


def law_table(results: Results) -> str:
    """What matters most of each controller, best first, in at most :data:`MAX_COLUMNS` columns."""
    return _table(*law_columns(results))


def law_columns(results: Results) -> tuple[list[str], list[Column]]:
    """The controllers in the order of the first table, and its columns: header, and a text for each controller."""
    names = results.competitors
    runs = [len(results.all_runs(name)) for name in names]
    strict, tolerant = (
        [Cell(f"{n} of {of}" if first else str(n), float(n) if of else math.nan, str(n))
         for n, of in zip(counts.values(), runs, strict=True)]
        for first, counts in ((True, results.clean), (False, results.clean_tolerant))
    )  # fmt: skip
    more = _better(results, "more")
    scores = dict(_column(results, one) for one in METRICS if one.overall and one.column in FIRST)
    columns = [
        ("converged inside", marked(strict, [True] * len(names), more)),
        (f"at {of_length(TOLERANT)}", marked(tolerant, [True] * len(names), more)),
        *scores.items(),
        ("implementation", [results.implementation(name) for name in names]),
    ]
    order = sorted(range(len(names)), key=lambda i: (-results.clean[names[i]], -results.clean_tolerant[names[i]]))
    return [names[i] for i in order], [(header, [texts[i] for i in order]) for header, texts in columns]


def endings_table(results: Results) -> str:
    """How many runs of each controller, tracking alone included, ended in each status."""
    lines = {name: results.all_runs(name) for name in results.controllers}
    columns: list[Column] = [("runs", [str(len(own)) for own in lines.values()])]
    for status in STATUSES:
        columns.append((status, [str(sum(line["status"] == status for line in own)) for own in lines.values()]))
    columns.append(("diverged", [str(sum(diverged(line) for line in own)) for own in lines.values()]))
    return _table(results.controllers, columns)


def score_table(results: Results) -> str:
    """Violations, and the scores that the first table does not have."""
    lines = {name: results.all_runs(name) for name in results.competitors}
    strict, tolerant = (
        [_count(sum(bool(violated(line, column)) for line in own)) for own in lines.values()]
        for column in ("violated", "violated_tolerant")
    )
    less = _better(results, "less")
    columns: list[Column] = [
        ("runs with a violated row", marked(strict, _complete(results), less)),
        (f"beyond {of_length(TOLERANT)}", marked(tolerant, _complete(results), less)),
        ("within the sampling band", [str(sum(map(_within_band, own))) for own in lines.values()]),
    ]
    columns += [_column(results, metric) for metric in METRICS if metric.overall and metric.column not in FIRST]
    return _table(results.competitors, columns) if results.competitors else ""


def tolerance_table(results: Results) -> str:
    """How many runs of each controller are successes at each tolerance."""
    lines = []
    for name in results.competitors:
        depths = [line["violation_fraction"] for line in results.all_runs(name) if line["status"] == "converged"]
        lines.append([name, *(str(sum(depth <= tolerance for depth in depths)) for tolerance in TOLERANCES)])
    return Table(["controller", *(f"{100.0 * one:g} %" for one in TOLERANCES)], lines) if lines else ""


def violation_table(results: Results) -> str:
    """Where each controller that violates constraints does, and its deepest violation."""
    lines = []
    for name in results.competitors:
        runs = [line for line in results.all_runs(name) if violated(line)]
        if runs:
            worst = max(runs, key=lambda line: float(line["violation_depth"]))
            depth = number(100.0 * worst["violation_depth"])
            where = enumeration(shortened_list([line["scenario"] for line in runs]))
            lines.append([name, str(len(runs)), depth, _deepest_row(results, worst), worst["scenario"], where])
    header = ["controller", "runs", "worst depth [% of L]", "row", "scenario", "violates a row in"]
    return Table(header, lines, 6) if lines else ""


def _deepest_row(results: Results, run: Line) -> str:
    """The row that is violated by the greatest share of its characteristic length."""
    rows = results.rows(run["scenario"], run["controller"])
    rows = [row for row in rows if row["trial"] == run["trial"] and row["violation_depth"] > 0.0]
    worst = max(rows, key=lambda row: float(row["usage_max"]), default=None)
    return code(worst["constraint"]) if worst else DASH


def winner_table(results: Results) -> str:
    """By metric, the scenarios in which each controller is the best of those that solved it in every trial."""
    metrics = [metric for metric in METRICS if metric.finding[0]]
    won = [_won(results, metric) for metric in metrics]
    names = [name for name in results.competitors if any(name in one for one in won)]
    lines = [[name, *(enumeration(shortened_list(one.get(name, []))) or DASH for one in won)] for name in names]
    header = ["controller", *("{} [{}]".format(*metric.finding) for metric in metrics)]
    return Table(header, lines, len(header)) if lines else ""


def _won(results: Results, metric: Metric) -> dict[str, list[str]]:
    """The scenarios a controller wins, with its value; none where values are alike as printed."""
    show = FORMATS[metric.style]
    won: dict[str, list[str]] = defaultdict(list)
    for scenario in results.challenged_scenarios:
        values = {
            name: median([shown(metric, line) for line in results.runs(scenario, name)])
            for name in solvers(results, scenario)
        }
        values = {name: value for name, value in values.items() if math.isfinite(value)}
        if len({show(value) for value in values.values()}) < 2:
            continue
        top = show((max if metric.better == "more" else min)(values.values()))
        for name, value in values.items():
            if show(value) == top:
                won[name].append(f"{scenario} ({top})")
    return won


def unsolved(results: Results) -> dict[str, str]:
    """The scenarios that no controller solved, and why none can, where that is known."""
    reasons = {}
    for scenario in results.scenarios:
        lines = [line for name in results.competitors for line in results.runs(scenario, name)]
        if lines and not solvers(results, scenario):
            closed = all(UNSOLVABLE in line["reason"] for line in lines)
            reasons[scenario] = "constraints close off a marker from its goal" if closed else ""
    return reasons


def solvers(results: Results, scenario: str) -> list[str]:
    """Controllers that converged and violated nothing, in every trial."""
    runs = {name: results.runs(scenario, name) for name in results.competitors}
    return [name for name, lines in runs.items() if lines and all(map(clean, lines))]


def outcome_table(results: Results) -> str:
    """One line per scenario and one column per controller; the other way round where there are more controllers."""
    names, scenarios = results.controllers, results.scenarios
    linked = {name: f"[{name}](#{anchor(name)})" for name in scenarios}
    if len(names) > len(scenarios):
        header = ["controller", *linked.values()]
        lines = [[name, *(_scored_outcome(results, scenario, name) for scenario in scenarios)] for name in names]
    else:
        header = ["scenario", *names]
        lines = [[linked[one], *(_scored_outcome(results, one, name) for name in names)] for one in scenarios]
    return Table(header, lines, len(header))


def outcome(results: Results, scenario: str, controller: str) -> str:
    """How a controller ended on a scenario, with marks for violations; counted where there are several trials."""
    lines = results.runs(scenario, controller)
    if not lines:
        return "not run"
    endings = [f"{line['status'] or 'unknown'}{_mark(line)}" for line in lines]
    if len(lines) == 1:
        return endings[0]
    return ", ".join(f"{endings.count(ending)} {ending}" for ending in dict.fromkeys(endings))


def _scored_outcome(results: Results, scenario: str, controller: str) -> str:
    """The outcome; of a single run with its utilization [%] or, where it violated a row, its depth [% of L]."""
    lines, text = results.runs(scenario, controller), outcome(results, scenario, controller)
    if len(lines) != 1 or controller == BASELINE:
        return text
    column = "violation_depth" if violated(lines[0]) else "utilization"
    value = 100.0 * lines[0][column]
    return f"{text} {number(value)}" if math.isfinite(value) else text


def _mark(line: Line) -> str:
    return "†" if violated(line, "violated_tolerant") else "‡" if violated(line) else ""


def anchor(scenario: str) -> str:
    """Where a scenario's section is, in links."""
    return quote(f"scenario-{scenario}")


def shortened_list(names: Sequence[str]) -> list[str]:
    """Different names or, if there are more than :data:`MAX_NAMES`, the first of them and how many more there are."""
    names = list(dict.fromkeys(names))
    return names if len(names) <= MAX_NAMES else [*names[: MAX_NAMES - 1], f"{len(names) - MAX_NAMES + 1} more"]


def _within_band(line: Line) -> bool:
    """Whether a run violated rows, each by no more than its sampling band."""
    return bool(violated(line)) and violated(line) == violated(line, "within_band")


def _complete(results: Results) -> list[bool]:
    """Who converged in every run in which any competitor did; nobody if there is only one competitor."""
    solved = {
        name: {(line["scenario"], line["trial"]) for line in results.all_runs(name) if line["status"] == "converged"}
        for name in results.competitors
    }
    anyone = set().union(*solved.values())
    several = sum(bool(results.all_runs(name)) for name in results.competitors) > 1
    return [several and bool(anyone) and runs == anyone for runs in solved.values()]


def _column(results: Results, metric: Metric) -> Column:
    """A metric over all scenarios, of each competitor."""
    cells, eligible = [], []
    for name, complete in zip(results.competitors, _complete(results), strict=True):
        lines = results.all_runs(name)
        if metric.condensed != "worst" and metric.kind != "time":
            lines = [line for line in lines if line["status"] == "converged"]
        cells.append(_cell(metric, lines))
        eligible.append(complete and judged_by(metric, lines))
    return metric.overall, marked(cells, eligible, _better(results, metric.better))


def _better(results: Results, better: Better | None) -> Better | None:
    """Nothing is ranked where tracking alone violates no row."""
    return better if results.challenged_scenarios else None


def _cell(metric: Metric, lines: Sequence[Line]) -> Cell:
    """One value of several runs, with how many have a value where not all do."""
    values = [shown(metric, line) for line in lines]
    value = CONDENSED[metric.condensed](values)
    text, finite = FORMATS[metric.style](value), sum(v == v for v in values)
    return Cell(text if text == DASH or finite == len(lines) else f"{text}, {finite} of {len(lines)}", value, text)


def _count(value: int) -> Cell:
    return Cell(count(value), float(value), count(value))


def _table(names: Sequence[str], columns: Sequence[Column]) -> str:
    lines = [[name, *(texts[i] for _, texts in columns)] for i, name in enumerate(names)]
    return Table(["controller", *(header for header, _ in columns)], lines)
