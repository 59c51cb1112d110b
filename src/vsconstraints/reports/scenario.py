"""Tables of one scenario of a comparison: metrics, rows and reasons for failures."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from ..comparisons.metrics import Metric, run_metrics
from ..comparisons.suite import BASELINE
from ..scenarios import Scenario
from .markdown import Table, code, plain
from .numbers import DASH, FORMATS, error, largest, number, over_trials
from .results import (
    Cell,
    Line,
    Results,
    columns_table,
    comparable,
    judged_by,
    marked,
    never_outside,
    reason_kind,
    shown_values,
    tally,
    violated,
)

#: Finer units in which margins are printed, with their factors.
FINER = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/s": ("mrad/s", 1e3), "m/s": ("mm/s", 1e3)}
#: A row that was active within this time before the end counts as active at the end [s].
AT_THE_END = 0.5
UNUSUAL = 100.0  #: Largest acceleration below which none is out of proportion [rad/s²].
OUT_OF_PROPORTION = 10.0  #: Least ratio to the largest acceleration of any other controller.


def takes(scenario: Scenario) -> str:
    """Return what the arm of a scenario takes: acceleration, velocity or position."""
    arm = scenario.tables.get("arm")
    command = arm.get("command") if isinstance(arm, dict) else None
    return str(command or "acceleration")


def is_ideal(scenario: Scenario) -> bool:
    """True if commanded accelerations are integrated exactly: no low-level loop, mass or errors."""
    tables = scenario.tables
    has_errors = bool(tables.get("plant") or tables.get("disturbances"))
    return takes(scenario) == "acceleration" and not has_errors


def robot_name(scenario: Scenario) -> str:
    """Return the name of a scenario's robot."""
    robot = scenario.tables.get("robot")
    if isinstance(robot, dict):
        file = PurePath(str(robot.get("urdf") or "own robot"))
        robot = robot.get("name") or file.stem
    return plain(robot) if robot else ""


def metric_table(results: Results, scenario: str, group: str) -> Table:
    """Return the metrics of a group with one line per controller; empty if no run has a value."""
    names = results.controllers if group == "time" else results.competitors
    runs = [results.runs(scenario, name) for name in names]
    texts: dict[str, list[str]] = {}
    if group == "outcome":
        texts["status"] = [status_text(trials) for trials in runs]
        texts["violated rows"] = [violated_text(trials) for trials in runs]
    if group == "time":
        texts["implementation"] = [results.implementation(name, scenario) or DASH for name in names]
    is_ranked = results.is_ranked(scenario)
    are_comparable = comparable(runs)
    numbers = {}
    for metric in run_metrics():
        if metric.group != group or not metric.header:
            continue
        cells = []
        eligible = []
        for trials, is_comparable in zip(runs, are_comparable, strict=True):
            cells.append(Cell.of(shown_values(metric, trials), FORMATS[metric.style]))
            eligible.append(is_comparable and judged_by(metric, trials))
        has_values = any(math.isfinite(cell.value) for cell in cells)
        if has_values:
            better = metric.better if is_ranked else None
            numbers[metric.header] = marked(cells, eligible, better)
    if group != "outcome" and not numbers:
        return Table(["controller"], [])
    columns = texts | numbers
    text_columns = 1 + len(texts)
    return columns_table("controller", names, columns, text_columns)


def acceleration_remarks(results: Results, scenario: str) -> list[str]:
    """Name controllers that command accelerations out of proportion to those of all others.

    Such commands arise where a row leaves hardly any of the task's null space: a single sample can
    then exceed what an arm can follow.
    """
    accelerations = {}
    for name in results.controllers:
        largest_of_runs = [run["acceleration_max"] for run in results.runs(scenario, name)]
        value = largest(largest_of_runs)
        if math.isfinite(value):
            accelerations[name] = value
    if len(accelerations) < 2:
        return []
    # Only the largest acceleration can be out of proportion to all others.
    second, value = sorted(accelerations.values())[-2:]
    is_unusual = value >= UNUSUAL
    is_out_of_proportion = second != 0.0 and value > OUT_OF_PROPORTION * second
    if not (is_unusual and is_out_of_proportion):
        return []
    name = max(accelerations, key=accelerations.__getitem__)
    return [
        f"**Disproportionate command**: {plain(name)} commands up to {number(value)} "
        f"rad/s² of a joint, {number(value / second)} times as much as any other "
        "controller, which a real arm could not follow. Give the joints acceleration "
        "limits."
    ]


def metric_text(metric: Metric, runs: Sequence[Line]) -> str:
    """Format the values of a metric in runs of a scenario."""
    return over_trials(shown_values(metric, runs), FORMATS[metric.style])


def challenge_table(results: Results, scenario: str) -> Table:
    """Return least clearance and mean unused margin of each challenged row, by controller."""
    names = results.competitors
    converged = comparable([results.runs(scenario, name) for name in names])
    baseline = [BASELINE] if BASELINE in results.controllers else []
    columns = {}
    for label in results.challenged(scenario):
        rows_of = {name: results.rows(scenario, name, label) for name in results.controllers}
        first = next(row for rows in rows_of.values() for row in rows)
        unit, factor = finer_unit(first["unit"])
        cells = []
        eligible = []
        for name, is_comparable in zip(names, converged, strict=True):
            rows = rows_of[name]
            cell = Cell(DASH)
            if rows:
                margins = [factor * row["mean_unused_margin"] for row in rows]
                clearance = _least_clearance(rows, factor)
                cell = Cell.of(margins, error)._replace(before=f"{clearance} / ")
            cells.append(cell)
            eligible.append(is_comparable and never_outside(rows))
        # The baseline has no margin while it violates the row.
        column = [_least_clearance(rows_of[name], factor) for name in baseline]
        columns[f"{code(label)} [{unit}]"] = column + marked(cells, eligible, "less")
    controllers = [*baseline, *names] if columns else []
    return columns_table("challenged rows", controllers, columns)


def _least_clearance(rows: Sequence[Line], factor: float) -> str:
    clearances = [factor * row["clearance_min"] for row in rows]
    return over_trials(clearances, error)


def failure_table(
    results: Results, scenario: str, first_violations: Mapping[tuple[str, str], float]
) -> Table:
    """Return the failures of each controller: runs that did not converge, and violated rows.

    Lines give kind, reason and time, and are grouped by kind of failure and row.
    ``first_violations`` is the time at which a controller's shown run first violates a row [s].
    """
    header = [
        "controller",
        "failure",
        "reason or row",
        "depth",
        "time [s]",
        "trials (first or worst)",
    ]
    lines = []
    for name in results.competitors:
        runs = results.runs(scenario, name)
        rows = results.rows(scenario, name)
        failed = defaultdict[Any, list[Line]](list)
        for run in runs:
            if run["status"] != "converged":
                failed[run["status"], reason_kind(run["reason"])].append(run)
        for alike in failed.values():
            first = alike[0]
            status = str(first["status"] or "unknown")
            reason = plain(first["reason"]) or DASH
            if len(runs) == 1:
                reason += _rows_at_the_end(first, rows)
            trials = _trials_text(alike, first, len(runs))
            lines.append([name, status, reason, DASH, DASH, trials])
        violations = defaultdict[str, list[Line]](list)
        for row in rows:
            if _natural_depth(row) > 0.0:
                violations[row["constraint"]].append(row)
        for label, alike in violations.items():
            worst = max(alike, key=_natural_depth)
            unit, factor = finer_unit(worst["unit"])
            depth = number(factor * _natural_depth(worst))
            seconds = "between samples"
            if worst["violation_time_s"] > 0.0:
                seconds = number(worst["violation_time_s"])
            if len(runs) == 1 and (name, label) in first_violations:
                seconds += f", from {first_violations[name, label]:.3f}"
            trials = _trials_text(alike, worst, len(runs))
            lines.append([name, "violates", code(label), f"{depth} {unit}", seconds, trials])
    if results.trials == 1:
        header = header[:-1]
        lines = [line[:-1] for line in lines]
    return Table(header, lines, text_columns=len(header))


def _natural_depth(row: Line) -> float:
    """Return the violation depth of a line of constraints.csv, in the unit of the row."""
    return float(row["violation_depth"])


def _rows_at_the_end(run: Line, rows: Sequence[Line]) -> str:
    """Return the rows that were active shortly before the end of a run, to be added to a text."""
    begin = run["duration_s"] - AT_THE_END
    late = [code(row["constraint"]) for row in rows if row["last_active_s"] >= begin]
    if not late:
        return ""
    return f"; acting in the last {AT_THE_END:g} s: {', '.join(late)}"


def _trials_text(alike: Sequence[Line], example: Line, trials: int) -> str:
    return f"{len(alike)} of {trials} ({example['trial']:.0f})"


def finer_unit(unit: str) -> tuple[str, float]:
    """Return the unit in which a margin is printed, and the factor to it."""
    return FINER.get(unit, (plain(unit), 1.0))


def status_text(runs: Sequence[Line]) -> str:
    """Format the status of runs.

    A run that ended early is shown with its time, several trials with the count of each status.
    """
    statuses = [str(run["status"] or "unknown") for run in runs]
    if len(runs) == 1 and statuses[0] in ("aborted", "failed"):
        duration = runs[0]["duration_s"]
        if math.isfinite(duration):
            return f"{statuses[0]} at {number(duration)} s"
    return tally(statuses)


def violated_text(runs: Sequence[Line]) -> str:
    """Format the rows that runs violated; those violated only by the strict standard come last."""
    if all(not math.isfinite(run["violation_depth"]) for run in runs):
        return DASH
    strict = Counter[str]()
    tolerant = Counter[str]()
    for run in runs:
        strict.update(violated(run))
        tolerant.update(violated(run, "violated_tolerant"))
    texts = []
    for counts, mark in ((tolerant, ""), (strict - tolerant, " ‡")):
        for label, count in counts.items():
            text = code(label)
            if len(runs) > 1:
                text += f" ({count} of {len(runs)})"
            texts.append(text + mark)
    return ", ".join(texts) or "none"
