"""What a report says of one scenario: its settings, tables of metrics and rows, and why runs failed."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from ..comparisons.metrics import METRICS
from ..comparisons.suite import BASELINE
from ..scenarios import Scenario
from .best import Cell, comparable, judged_by, marked, shown
from .markdown import Table, code, plain
from .numbers import DASH, FORMATS, error, median, number, over_trials, percent
from .results import Line, Results, reason_kind, tolerated, violated
from .selection import lane_rows

DETAIL_GROUPS = ("task", "chattering", "time")
"""Groups of metrics that have a table each in the details; that of the outcome stands above."""

FINER = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/s": ("mrad/s", 1e3), "m/s": ("mm/s", 1e3)}
"""Units in which margins are printed instead of the stored ones."""

AT_THE_END = 0.5
"""A row that acted within this time before the end counts as acting at the end [s]."""


def robot_name(scenario: Scenario) -> str:
    """The name of a scenario's robot."""
    robot = scenario.tables.get("robot")
    if isinstance(robot, dict):
        robot = robot.get("name") or PurePath(str(robot.get("urdf") or "own robot")).stem
    return plain(str(robot)) if robot else ""


def settings(scenario: Scenario) -> str:
    """What the scenario's tables say about robot, time and task, as far as they do."""
    keys = scenario.tables
    task, robot = keys.get("task"), robot_name(scenario)
    facts = [f"Robot: {robot}"] if robot else []
    if isinstance(task, dict):
        goals = task.get("goals")
        several = f", {len(goals)} goals" if isinstance(goals, list) and len(goals) > 1 else ""
        facts.append(f"task: {plain(str(task.get('feature', '?')))}{several}")
    facts += _deviations(keys)
    limits = keys.get("limits")
    if isinstance(limits, dict):
        facts.append(f"limits: {', '.join(plain(f'{key} {value}') for key, value in limits.items())}")
    elif limits:
        facts.append(f"limits: those of the {plain(str(limits))}'s actuators")
    if isinstance(keys.get("sampling_time"), (int, float)):
        facts.append(f"T_s = {1e3 * keys['sampling_time']:g} ms")
    if isinstance(keys.get("duration"), (int, float)):
        facts.append(f"{keys['duration']:g} s")
    return "; ".join(facts) + "." if facts else ""


def _deviations(keys: Mapping[str, Any]) -> list[str]:
    """What differs from a still target, a camera on the arm and a plant as the controllers assume it."""
    facts = []
    for part in (keys.get("target"), *keys.get("constraints", [])):
        motion = part.get("motion") if isinstance(part, dict) else None
        if isinstance(part, dict) and isinstance(motion, dict):
            what = plain(str(part.get("name") or part.get("type") or "target"))
            facts.append(f"the {what} moves, {'' if motion.get('known', True) else 'un'}known to the controllers")
    camera, plant, disturbances = (keys.get(name) for name in ("camera", "plant", "disturbances"))
    if isinstance(camera, dict) and "fixed" in camera:
        facts.append("fixed camera")
    if isinstance(plant, dict):
        options = ", ".join(f"{key} {value}" for key, value in plant.items() if key != "type")
        facts.append(f"an arm with mass ({plain(options)})" if options else "an arm with mass")
    if keys.get("actuation") == "position":
        facts.append("position-controlled")
    if isinstance(disturbances, dict):
        facts += [plain(f"{key} {value}") for key, value in disturbances.items()]
    return facts


def baseline_summary(results: Results, scenario: str) -> str:
    """What unconstrained tracking does: it is not ranked, and stands in no column with those that are."""
    lines = results.runs(scenario, BASELINE)
    if not lines:
        return ""
    facts = [_status(lines), f"violated rows: {_violated(lines)}"]
    for metric in METRICS:
        if metric.header and metric.better and metric.group != "time" and metric.judged != "sliding":
            text = over_trials([shown(metric, line) for line in lines], FORMATS[metric.style])
            what, _, unit = metric.header.removesuffix("]").partition(" [")
            facts += [f"{what} {text} {unit}"] if text != DASH else []
    return f"Unconstrained tracking: {'; '.join(facts)}."


def metric_table(results: Results, scenario: str, group: str) -> str:
    """One of a scenario's tables of metrics, with one line per controller; empty if no run has a value."""
    names = results.controllers if group == "time" else results.competitors
    runs = {name: results.runs(scenario, name) for name in names}
    ranked = results.is_ranked(scenario)
    converged = comparable([[line["status"] for line in own] for own in runs.values()])
    header, columns = ["controller"], [list(runs)]
    if group == "outcome":
        header += ["status", "violated rows"]
        columns += [[_status(own) for own in runs.values()], [_violated(own) for own in runs.values()]]
    if group == "time":
        header.append("implementation")
        columns.append([results.implementation(name, scenario) or DASH for name in names])
    first = len(header)
    for metric in METRICS:
        if metric.group != group or not metric.header:
            continue
        cells = [Cell.of([shown(metric, line) for line in own], FORMATS[metric.style]) for own in runs.values()]
        if any(math.isfinite(cell.value) for cell in cells):
            eligible = [ok and judged_by(metric, own) for ok, own in zip(converged, runs.values(), strict=True)]
            header.append(metric.header)
            columns.append(marked(cells, eligible, metric.better if ranked else None))
    lines = [list(line) for line in zip(*columns, strict=True)]
    return Table(header, lines, first) if lines and (group == "outcome" or len(header) > first) else ""


def challenge_table(results: Results, scenario: str) -> str:
    """Least clearance and mean unused margin of each challenged row, one line per controller."""
    labels = results.challenged(scenario)
    if not labels:
        if not results.labels(scenario):
            return "This scenario has no constraint rows that could be scored."
        return "Unconstrained tracking violates no row: none is challenged."
    names = results.competitors
    converged = comparable(results.statuses(scenario))
    header, columns = [], []
    for label in labels:
        rows = {name: results.rows(scenario, name, label) for name in results.controllers}
        unit, factor = finer_unit(next((line["unit"] for own in rows.values() for line in own), ""))
        header.append(f"{code(label)} [{unit}]")
        eligible = [
            ok and bool(rows[name]) and all(line["violation_depth"] == 0.0 for line in rows[name])
            for ok, name in zip(converged, names, strict=True)
        ]
        cells = marked([_margin_cell(rows[name], factor) for name in names], eligible, "less")
        # tracking alone has no margin while it violates the row
        baseline = [_clearance(rows[BASELINE], factor) or DASH] if BASELINE in rows else []
        columns.append([*baseline, *cells])
    order = [*([BASELINE] if BASELINE in results.controllers else []), *names]
    lines = [[name, *cells] for name, *cells in zip(order, *columns, strict=True)]
    return Table(["challenged rows", *header], lines)


def usage_table(results: Results, scenario: str) -> str:
    """Usage of each row that limited the arm, and for how long; empty if none did."""
    labels = lane_rows(results, scenario)
    lines = [[name, *(_usage(results.rows(scenario, name, label)) for label in labels)] for name in results.competitors]
    return Table(["rows that limited the arm", *map(code, labels)], lines) if labels else ""


def effort_table(results: Results, scenario: str) -> str:
    """The share of the acceleration limits that satisfying each row takes; empty where no limits are stated."""
    names = results.controllers
    shares = {
        label: [[line["share_to_hold"] for line in results.rows(scenario, name, label)] for name in names]
        for label in results.labels(scenario)
    }
    shares = {label: own for label, own in shares.items() if any(share > 0.0 for lines in own for share in lines)}
    lines = [[name, *(over_trials(own[i], percent) for own in shares.values())] for i, name in enumerate(names)]
    return Table(["required acceleration", *map(code, shares)], lines) if shares else ""


def failure_table(results: Results, scenario: str, first_violations: Mapping[tuple[str, str], float]) -> str:
    """Runs that did not converge, or violated rows: how, why and when.

    One line per run and violated row or, where there are several trials, per controller and kind of failure.

    Parameters
    ----------
    first_violations
        When a controller's shown run first violates a row [s].
    """
    lines = []
    for name in results.competitors:
        runs, rows = results.runs(scenario, name), results.rows(scenario, name)
        kinds: dict[tuple[str, str], list[Line]] = defaultdict(list)
        for run in runs:
            if run["status"] != "converged":
                kinds[run["status"], reason_kind(run["reason"])].append(run)
        for (status, _), alike in kinds.items():
            first = alike[0]
            reason = plain(str(first["reason"])) or DASH
            if len(runs) == 1 and (acting := [code(row["constraint"]) for row in rows if _acts_at_end(row, first)]):
                reason += f"; acting in the last {AT_THE_END:g} s: {', '.join(acting)}"
            lines.append([name, str(status or "unknown"), reason, DASH, DASH, _trials(alike, runs, first)])
        for label in dict.fromkeys(row["constraint"] for row in rows if row["violation_depth"] > 0.0):
            alike = [row for row in rows if row["constraint"] == label and row["violation_depth"] > 0.0]
            worst = max(alike, key=lambda row: float(row["violation_depth"]))
            unit, factor = finer_unit(worst["unit"])
            seconds = number(worst["violation_time_s"]) if worst["violation_time_s"] > 0.0 else "between samples"
            first_s = first_violations.get((name, label)) if len(runs) == 1 else None
            seconds += f", from {first_s:.3f}" if first_s is not None else ""
            depth = f"{number(factor * worst['violation_depth'])} {unit}"
            lines.append([name, "violates", code(label), depth, seconds, _trials(alike, runs, worst)])
    if not lines:
        return ""
    header = ["controller", "failure", "reason or row", "depth", "time [s]"]
    if results.trials > 1:
        return Table([*header, "trials (first or worst)"], lines, 6)
    return Table(header, [line[:-1] for line in lines], 5)


def finer_unit(unit: str) -> tuple[str, float]:
    """The unit in which a margin is printed, and the factor to it."""
    return FINER.get(unit, (plain(unit), 1.0))


def _trials(alike: Sequence[Line], runs: Sequence[Line], example: Line) -> str:
    return f"{len(alike)} of {len(runs)} ({example['trial']:.0f})"


def _acts_at_end(row: Line, run: Line) -> bool:
    return bool(row["trial"] == run["trial"] and row["last_active_s"] >= run["duration_s"] - AT_THE_END)


def _usage(lines: Sequence[Line]) -> str:
    usage, seconds = [line["usage_held"] for line in lines], median([line["held_time_s"] for line in lines])
    return f"{over_trials(usage, percent)} / {number(seconds)} s" if math.isfinite(median(usage)) else DASH


def _clearance(lines: Sequence[Line], factor: float) -> str:
    """The least clearance, violations between samples included."""
    return over_trials([factor * line["clearance_min"] for line in lines], error) if lines else ""


def _margin_cell(lines: Sequence[Line], factor: float) -> Cell:
    """Least clearance, and the mean unused margin, which is ranked."""
    if not lines:
        return Cell(DASH)
    margin = [factor * line["mean_unused_margin"] for line in lines]
    middle = median(margin)
    return Cell(over_trials(margin, error), middle, error(middle), f"{_clearance(lines, factor)} / ")


def _status(lines: Sequence[Line]) -> str:
    """Status with its time where the run ended early; counts where there are several trials."""
    if not lines:
        return "not run"
    if len(lines) > 1:
        statuses = [line["status"] for line in lines]
        return ", ".join(f"{statuses.count(status)} {status}" for status in dict.fromkeys(statuses))
    status, end = lines[0]["status"] or "unknown", lines[0]["duration_s"]
    early = status in ("aborted", "failed") and math.isfinite(end)
    return f"{status} at {number(end)} s" if early else str(status)


def _violated(lines: Sequence[Line]) -> str:
    if not lines or all(not math.isfinite(line["violation_depth"]) for line in lines):
        return DASH
    slight = [label for line in lines for label in tolerated(line)]
    names = [label for line in lines for label in violated(line, "violated_tolerant")]
    listed = [_counted(label, names.count(label), len(lines)) for label in dict.fromkeys(names)]
    listed += [f"{_counted(label, slight.count(label), len(lines))} ‡" for label in dict.fromkeys(slight)]
    return ", ".join(listed) if listed else "none"


def _counted(label: str, times: int, runs: int) -> str:
    return f"{code(label)} ({times} of {runs})" if runs > 1 else code(label)
