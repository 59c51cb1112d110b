"""The part of a report about one scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any
from urllib.parse import quote

from ..comparisons.metrics import METRICS, NEGLIGIBLE, TOLERANT
from ..comparisons.suite import BASELINE
from ..scenarios import Scenario
from .best import Cell, comparable, judged_by, marked, shown
from .challenges import challenges, held_rows, shares_to_hold
from .drawing import Drawn
from .figures import DISTURBANCE, FIGURES
from .headlines import anchor
from .markdown import bullets, code, plain, tables
from .numbers import DASH, FORMATS, number, of_length, over_trials
from .opening import robot_name
from .results import Line, Results, tolerated, violated
from .rows_shown import lanes_left_out

GROUPS = ("outcome", "task", "chattering", "time")
"""Of metrics: a table each."""

ALL_FIGURES = "`vsconstraints report FOLDER --all-figures`."
"""What draws those that a report of a large suite leaves out."""

HOW_TO_READ = (
    "**Bold** is the best of a column, judged by the digits shown; ties are all bold. Nothing is bold where another "
    "value of the column is better, nor where all are alike, nor where tracking alone violates no row. More "
    "utilization is better, of everything else less. In parentheses is what is not compared: values of controllers "
    "that did not converge; in the columns other than depth and time outside also of those that violated a row, and "
    "φ bands of those that lost a sliding mode. Times are not judged: they differ from run to run as much as between "
    f"laws, and those of NumPy stand beside those of compiled code. {DASH} stands where there is no value.",
    f"**Violated rows** were deeper outside than {of_length(NEGLIGIBLE)}, the strict standard, by which values are "
    f"compared; ‡ marks those that were never deeper than {of_length(TOLERANT)}, the tolerant one.",
    "**Challenged rows**: least clearance / mean unused margin. The mean is over the time in which tracking alone is "
    "outside. A negative clearance is how far the row was outside, which counts from "
    f"{of_length(NEGLIGIBLE)} on. The mean is judged, among the controllers that converged and did not violate "
    "the row.",
    "**Rows that held the arm back**: usage [%] of the room that was left at the arm's speed, while the row did, and "
    "for how long.",
)

HOLDING = (
    "**What holding takes**: where a row first comes to φ = 0, or tracking alone would bring it there, the share [%] "
    "of what the limits of acceleration allow that it takes to hold it there. Above 100 no law could have held the row "
    "from then on; 0 or less is a row that falls by itself."
)
"""How to read what scenarios with limits have besides."""


def scenarios_section(results: Results, drawn: Mapping[str, Drawn]) -> str:
    """How to read tables and figures, then one part per scenario."""
    reading = list(HOW_TO_READ)
    if any(shares_to_hold(results, name) for name in results.scenarios):
        reading.append(HOLDING)
    if any(one.files for one in drawn.values()):
        reading += [*(figure.reading for figure in FIGURES), "Dashed vertical lines: the goal changes."]
    if results.trials > 1:
        reading.append(
            "Each scenario was run several times: values are the median of the trials, with the least and the greatest "
            "in brackets where they differ; figures show the first trial."
        )
    parts = ["## Scenarios", bullets(reading)]
    if len(results.groups) > 1:
        listed = bullets([f"{group.listed}." for group in results.groups])
        parts.append(f"Figures show laws by the last of these that they use:\n\n{listed}")
    return "\n\n".join([*parts, *(scenario_section(results, name, drawn.get(name)) for name in results.scenarios)])


def scenario_section(results: Results, name: str, drawn: Drawn | None) -> str:
    """Title, tables and figures of a scenario."""
    scenario = results.stored.scenarios[name]
    parts = [f'<a id="{anchor(name)}"></a>\n\n### {name}: {plain(scenario.title)}']
    parts += [text for text in (plain(scenario.description), _facts(scenario)) if text]
    if not any(results.runs(name, controller) for controller in results.controllers):
        return "\n\n".join([*parts, "No run of this scenario finished."])
    parts += [_alone(results, name), *(metric_table(results, name, group) for group in GROUPS)]
    parts += [challenges(results, name), held_rows(results, name), shares_to_hold(results, name)]
    if drawn is None:
        return "\n\n".join([*(part for part in parts if part), f"Its figures: {ALL_FIGURES}"])
    for figure, group in product((*FIGURES, DISTURBANCE), results.groups):
        if file := drawn.files.get((figure.name, group.suffix)):
            caption = f"{figure.caption}{group.sentence}{_addition(results, name, figure.name)}"
            parts.append(f"![{name}: {figure.name}](figures/{quote(file)})\n\n*{caption}*")
    parts.append(drawn.replay)
    if drawn.problems:
        parts.append(bullets([plain(problem) for problem in drawn.problems]))
    return "\n\n".join(part for part in parts if part)


def _addition(results: Results, name: str, kind: str) -> str:
    left_out = lanes_left_out(results, name)
    if kind == "phi" and left_out:
        return f" {left_out} further rows acted for a shorter time and are not shown."
    return ""


def _facts(scenario: Scenario) -> str:
    """What the scenario's tables say about robot, time and task, as far as they do."""
    keys = scenario.tables
    task, robot = keys.get("task"), robot_name(scenario)
    facts = [f"Robot: {robot}"] if robot else []
    if isinstance(task, dict):
        goals = task.get("goals")
        number_of = f", {len(goals)} goals" if isinstance(goals, list) and len(goals) > 1 else ""
        facts.append(f"task: {plain(str(task.get('feature', '?')))}{number_of}")
    facts += _unusual(keys)
    if keys.get("limits"):
        facts.append(f"limits: {_limits(keys['limits'])}")
    if isinstance(keys.get("sampling_time"), (int, float)):
        facts.append(f"T_s = {1e3 * keys['sampling_time']:g} ms")
    if isinstance(keys.get("duration"), (int, float)):
        facts.append(f"{keys['duration']:g} s")
    return "; ".join(facts) + "." if facts else ""


def _limits(given: Any) -> str:
    """What limits of actuators are stated: those of the robot, or a table."""
    if not isinstance(given, dict):
        return f"those of the {plain(str(given))}'s actuators"
    return ", ".join(f"{plain(str(key))} {plain(str(value))}" for key, value in given.items())


def _unusual(keys: Mapping[str, Any]) -> list[str]:
    """What is otherwise than with a still target, a camera on the arm and everything as the control assumes."""
    parts = [keys.get("target"), *keys.get("constraints", [])]
    facts = []
    for part in parts:
        motion = part.get("motion") if isinstance(part, dict) else None
        if isinstance(motion, dict):
            what = plain(str(part.get("name") or part.get("type") or "target"))
            facts.append(f"the {what} moves, {'' if motion.get('known', True) else 'un'}known to the controllers")
    camera, disturbances = keys.get("camera"), keys.get("disturbances")
    if isinstance(camera, dict) and "fixed" in camera:
        facts.append("fixed camera")
    if isinstance(keys.get("plant"), dict):
        settings = ", ".join(f"{key} {value}" for key, value in keys["plant"].items() if key != "type")
        facts.append(f"an arm with mass ({plain(settings)})" if settings else "an arm with mass")
    if keys.get("actuation") == "position":
        facts.append("position-controlled")
    if isinstance(disturbances, dict):
        facts += [plain(f"{key} {value}") for key, value in disturbances.items()]
    return facts


def _alone(results: Results, scenario: str) -> str:
    """What tracking alone does, in a sentence: it is not compared, and stands in no column with those that are."""
    lines = results.runs(scenario, BASELINE)
    if not lines:
        return ""
    facts = [_status(lines), f"violated rows: {_violated(lines)}"]
    for metric in METRICS:
        if metric.header and metric.better and metric.group != "time" and metric.judged != "sliding":
            text = over_trials([shown(metric, line) for line in lines], FORMATS[metric.style])
            what, _, unit = metric.header.removesuffix("]").partition(" [")
            facts += [f"{what} {text} {unit}"] if text != DASH else []
    return f"Tracking alone: {'; '.join(facts)}."


def metric_table(results: Results, scenario: str, group: str) -> str:
    """One of a scenario's tables of metrics, with one line per controller; empty if no run has a value."""
    names = results.controllers if group == "time" else results.competitors
    runs = {name: results.runs(scenario, name) for name in names}
    apart, may = results.tells_apart(scenario), comparable([[line["status"] for line in own] for own in runs.values()])
    header, parts = ["controller"], [list(runs)]
    if group == "outcome":
        header += ["status", "violated rows"]
        parts += [[_status(own) for own in runs.values()], [_violated(own) for own in runs.values()]]
    if group == "time":
        header, parts = [*header, "form"], [*parts, [results.form(name, scenario) or DASH for name in names]]
    first = len(header)
    for metric in METRICS:
        if metric.group != group or not metric.header:
            continue
        cells = [Cell.of([shown(metric, line) for line in own], FORMATS[metric.style]) for own in runs.values()]
        if all(not math.isfinite(cell.value) for cell in cells):
            continue
        judged = [ok and judged_by(metric, own) for ok, own in zip(may, runs.values(), strict=True)]
        header.append(metric.header)
        parts.append(marked(cells, judged, metric.better if apart else None))
    lines = [[part[i] for part in parts] for i in range(len(runs))]
    return tables(header, lines, first) if lines and (group == "outcome" or len(header) > first) else ""


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
    listed = [_often(label, names.count(label), len(lines)) for label in dict.fromkeys(names)]
    listed += [f"{_often(label, slight.count(label), len(lines))} ‡" for label in dict.fromkeys(slight)]
    return ", ".join(listed) if listed else "none"


def _often(label: str, times: int, runs: int) -> str:
    return f"{code(label)} ({times} of {runs})" if runs > 1 else code(label)
