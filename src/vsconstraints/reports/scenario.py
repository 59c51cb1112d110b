"""Tables of one scenario of a comparison: metrics, rows and reasons for failures."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from ..comparisons.metrics import METRICS, Metric
from ..comparisons.suite import BASELINE
from ..scenarios import Scenario
from .markdown import Table, code, plain
from .numbers import DASH, FORMATS, error, number, over_trials
from .results import (
    Cell,
    Line,
    Results,
    columns_table,
    comparable,
    judged_by,
    marked,
    reason_kind,
    shown,
    tally,
    violated,
)  # fmt: skip

#: Finer units in which margins are printed, with their factors.
FINER = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/s": ("mrad/s", 1e3), "m/s": ("mm/s", 1e3)}
#: A row that was active within this time before the end counts as active at the end [s].
AT_THE_END = 0.5


UNUSUAL = 100.0  #: Largest acceleration below which none is out of proportion [rad/s²].
OUT_OF_PROPORTION = 10.0  #: Least ratio to the largest acceleration of any other controller.


def robot_name(scenario: Scenario) -> str:
    """Return the name of a scenario's robot."""
    robot = scenario.tables.get("robot")
    if isinstance(robot, dict):
        robot = robot.get("name") or PurePath(str(robot.get("urdf") or "own robot")).stem
    return plain(robot) if robot else ""


def metric_table(results: Results, scenario: str, group: str) -> Table:
    """Return the metrics of a group with one line per controller; empty if no run has a value."""
    names = results.controllers if group == "time" else results.competitors
    runs = [results.runs(scenario, name) for name in names]
    columns: dict[str, list[str]] = {}
    if group == "outcome":
        columns = {
            "status": [*map(status_text, runs)],
            "violated rows": [*map(violated_text, runs)],
        }
    if group == "time":
        columns = {
            "implementation": [results.implementation(name, scenario) or DASH for name in names]
        }
    text = 1 + len(columns)
    for metric in (metric for metric in METRICS if metric.group == group and metric.header):
        cells = [
            Cell.of([shown(metric, run) for run in own], FORMATS[metric.style]) for own in runs
        ]
        if any(math.isfinite(cell.value) for cell in cells):
            eligible = [
                ok and judged_by(metric, own)
                for ok, own in zip(comparable(runs), runs, strict=True)
            ]
            columns[metric.header] = marked(
                cells, eligible, metric.better if results.is_ranked(scenario) else None
            )
    empty = group != "outcome" and 1 + len(columns) == text
    return Table(["controller"], []) if empty else columns_table("controller", names, columns, text)


def acceleration_remarks(results: Results, scenario: str) -> list[str]:
    """Name controllers that command accelerations out of proportion to those of all others.

    Such commands arise where a row leaves hardly any of the task's null space: a single sample can
    then exceed what an arm can follow.
    """
    largest = {}
    for name in results.controllers:
        values = [run["acceleration_max"] for run in results.runs(scenario, name)]
        known = [value for value in values if math.isfinite(value)]
        if known:
            largest[name] = max(known)
    remarks = []
    for name, value in largest.items():
        others = max((other for own, other in largest.items() if own != name), default=math.inf)
        if value >= UNUSUAL and value > OUT_OF_PROPORTION * others:
            remarks.append(
                f"**Disproportionate command**: {plain(name)} commands up to {number(value)} "
                f"rad/s² of a joint, {number(value / others)} times as much as any other "
                "controller, which a real arm could not follow. Give the joints acceleration "
                "limits."
            )
    return remarks


def metric_text(metric: Metric, runs: Sequence[Line]) -> str:
    """Format the values of a metric in runs of a scenario."""
    return over_trials([shown(metric, run) for run in runs], FORMATS[metric.style])


def challenge_table(results: Results, scenario: str) -> Table:
    """Return least clearance and mean unused margin of each challenged row, by controller."""
    names = results.competitors
    baseline = [name for name in results.controllers if name == BASELINE]
    converged = comparable([results.runs(scenario, name) for name in names])
    columns = {}
    for label in results.challenged(scenario):
        rows = {name: results.rows(scenario, name, label) for name in results.controllers}
        unit, factor = finer_unit(next((line["unit"] for own in rows.values() for line in own), ""))
        least = {
            name: over_trials([factor * line["clearance_min"] for line in own], error)
            for name, own in rows.items()
        }
        cells = []
        eligible = []
        for name, ok in zip(names, converged, strict=True):
            margin = Cell.of([factor * line["mean_unused_margin"] for line in rows[name]], error)
            cells.append(margin._replace(before=f"{least[name]} / ") if rows[name] else Cell(DASH))
            eligible.append(
                ok
                and bool(rows[name])
                and all(line["violation_depth"] == 0.0 for line in rows[name])
            )
        # The baseline has no margin while it violates the row.
        columns[f"{code(label)} [{unit}]"] = [
            *(least[name] for name in baseline),
            *marked(cells, eligible, "less"),
        ]
    return columns_table("challenged rows", (*baseline, *names) if columns else (), columns)


def failure_table(
    results: Results, scenario: str, first_violations: Mapping[tuple[str, str], float]
) -> Table:
    """Return the failures of each controller: runs that did not converge, and violated rows.

    Lines give kind, reason and time, and are grouped by kind of failure and row.
    ``first_violations`` is the time at which a controller's shown run first violates a row [s].
    """
    lines = []
    for name in results.competitors:
        runs = results.runs(scenario, name)
        rows = results.rows(scenario, name)
        kinds = defaultdict[Any, list[Line]](list)
        depths = defaultdict[str, list[Line]](list)
        for run in (run for run in runs if run["status"] != "converged"):
            kinds[run["status"], reason_kind(run["reason"])].append(run)
        for row in (row for row in rows if row["violation_depth"] > 0.0):
            depths[row["constraint"]].append(row)

        def trials(alike: Sequence[Line], one: Line, of: int = len(runs)) -> str:
            return f"{len(alike)} of {of} ({one['trial']:.0f})"

        for alike in kinds.values():
            first = alike[0]
            reason = plain(first["reason"]) or DASH
            late = [
                code(row["constraint"])
                for row in rows
                if row["last_active_s"] >= first["duration_s"] - AT_THE_END
            ]
            if len(runs) == 1 and late:
                reason += f"; acting in the last {AT_THE_END:g} s: {', '.join(late)}"
            lines.append(
                [name, str(first["status"] or "unknown"), reason, DASH, DASH, trials(alike, first)]
            )
        for label, alike in depths.items():
            worst = max(alike, key=lambda row: float(row["violation_depth"]))
            unit, factor = finer_unit(worst["unit"])
            seconds = (
                number(worst["violation_time_s"])
                if worst["violation_time_s"] > 0.0
                else "between samples"
            )
            if len(runs) == 1 and (name, label) in first_violations:
                seconds += f", from {first_violations[name, label]:.3f}"
            depth = f"{number(factor * worst['violation_depth'])} {unit}"
            lines.append([name, "violates", code(label), depth, seconds, trials(alike, worst)])
    header = [
        "controller",
        "failure",
        "reason or row",
        "depth",
        "time [s]",
        "trials (first or worst)",
    ]
    count = 6 if results.trials > 1 else 5
    return Table(header[:count], [line[:count] for line in lines], count)


def finer_unit(unit: str) -> tuple[str, float]:
    """Return the unit in which a margin is printed, and the factor to it."""
    return FINER.get(unit, (plain(unit), 1.0))


def status_text(runs: Sequence[Line]) -> str:
    """Format the status of runs.

    A run that ended early is shown with its time, several trials with the count of each status.
    """
    if (
        len(runs) == 1
        and runs[0]["status"] in ("aborted", "failed")
        and math.isfinite(runs[0]["duration_s"])
    ):
        return f"{runs[0]['status']} at {number(runs[0]['duration_s'])} s"
    return tally([str(run["status"] or "unknown") for run in runs])


def violated_text(runs: Sequence[Line]) -> str:
    """Format the rows that runs violated; those violated only by the strict standard come last."""
    if all(not math.isfinite(run["violation_depth"]) for run in runs):
        return DASH
    beyond = Counter(label for run in runs for label in violated(run, "violated_tolerant"))
    slight = Counter(label for run in runs for label in violated(run)) - beyond
    texts = []
    for counts, mark in ((beyond, ""), (slight, " ‡")):
        for label, times in counts.items():
            texts.append(
                f"{code(label)}{f' ({times} of {len(runs)})' if len(runs) > 1 else ''}{mark}"
            )
    return ", ".join(texts) or "none"
