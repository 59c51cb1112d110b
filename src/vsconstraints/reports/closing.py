"""The last parts of a report: definitions, fairness, limitations, machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..comparisons.metrics import DEFINITIONS
from .groups import uses
from .markdown import bullets, code, enumeration, plain, table, tables
from .numbers import DASH, number
from .results import Results

FAIR = (
    "Every controller gets the same rows φ ≤ 0 and the same task, evaluated by the same code, and nothing else: it "
    "knows no robot, no camera and no scenario.",
    "The same start, the same goals, the same exact double integration of the command and, in further trials, the same "
    "random deviations of the start (seed below) for all.",
    "What counts as challenged is decided by tracking alone, which is not compared.",
    "Status, violations, errors, and which rows act are measured on the motion and the command; no controller's own "
    "word is used, except that a run ends where its controller has no command, or reports lost rank that rows confirm.",
    "Every law, shipped or own, is timed by the same call, controller.command(rows, task), apart from the rows and the "
    "task, in processes that use one thread each.",
    "Options are those of the suite, the same in every scenario, listed below and in [manifest.json](manifest.json).",
)

LIMITATIONS = (
    "Simulation only: images without a camera, and arms whose mass counts only where a scenario's facts say so. What "
    "else is disturbed they say, too; in all others commands are carried out exactly, and perception is perfect and "
    "immediate.",
    "No controller's options are tuned to a scenario; another choice can change the order. A few scenarios are no "
    "sample of all tasks, and medians over them weigh each alike.",
    "Switching gains u⁺ and approach times K belong to a scenario and are the same for every law. Those of scenarios "
    "that come with the package are the sliding-mode law's own or were chosen by watching it; other laws might choose "
    "others.",
    "Times are those of Python calls, of compiled functions where *form* says so, while other runs use the machine's "
    "other cores; they differ somewhat from run to run. A law in NumPy would be faster compiled; by how much is open.",
    "Which row holds the arm back is worked out, not known: of the rows that the command slows, the nearest. A law "
    "that departs from tracking for a reason of its own is taken to do so for that row. Utilization averages over "
    "rows, however different they are; the mean unused margin compares equal times, at which runs may be at different "
    "places.",
    "Inside sampling periods clearances are looked at where, at the rate seen in this period and those beside it, they "
    "could come to zero: what comes and goes within one period, and faster than that, can be missed.",
    "The φ band mixes what switching causes with what tracking, drift and lost sliding modes cause. A large ratio is a "
    "reason to look at the figure, not a measure of switching alone; it has no value where no row comes to its "
    "boundary, which is no merit by itself.",
    "Acceleration variation and jerk add rad and m where an arm has prismatic joints.",
    "Where runs end in different places (slow, trapped, unfinished), their other values are not values of the same "
    "motion.",
)


def closing(results: Results) -> str:
    """Everything that a reader needs to judge or repeat the comparison."""
    manifest = results.stored.manifest
    parts = [
        "## Definitions",
        bullets([f"**{name}**: {text}" for name, text in DEFINITIONS.items()]),
        "## What makes the comparison fair",
        bullets(FAIR),
        _options(results, manifest),
        "## Known limitations",
        bullets(LIMITATIONS),
        "## Machine and versions",
        _machine(results, manifest),
    ]
    return "\n\n".join(parts)


def _options(results: Results, manifest: Mapping[str, Any]) -> str:
    lines = []
    for name, entry in manifest["configuration"]["controllers"].items():
        options = [f"{key} = {value}" for key, value in entry.items() if key != "type"]
        kind = str(entry.get("type", name))
        used = uses(name, entry)
        told = "said by its code" if used is None else ", ".join(used) or "no more"
        form = results.form(name) or DASH
        lines.append([name, plain(kind), plain(", ".join(options)) or "defaults", plain(told), form])
    text = (
        "*Uses* is what a law needs beside φ, L_gφ, u⁺ and the scale of rows, and J and b of the task. *Form*: whether "
        "its calls were answered by compiled code or by NumPy, which takes longer."
    )
    return tables(["controller", "type", "options", "uses", "form"], lines, text_columns=5) + f"\n\n{text}"


def _forms(results: Results) -> str:
    """In which form the runs ran."""
    lines = [line for line in results.stored.results if line["duration_s"] >= 0.0]
    compiled = sum(bool(line.get("compiled")) for line in lines)
    if compiled in (0, len(lines)):
        return "" if not lines else "compiled" if compiled else "NumPy"
    names = [name for name in results.controllers if not all(line.get("compiled") for line in results.all_runs(name))]
    return f"compiled in {compiled} of {len(lines)} runs; in NumPy, in whole or in part, some of {enumeration(names)}"


def _machine(results: Results, manifest: Mapping[str, Any]) -> str:
    wall = manifest.get("wall_time_s")
    kept = manifest.get("stored_before") or 0
    facts = {
        **machine_of(manifest),
        **manifest.get("packages", {}),
        "control step": _forms(results),
        **command_of(manifest),
        "seed": manifest.get("seed"),
        "wall time [s]": None if wall is None else number(float(wall)),
        "runs": f"{results.finished} of {results.planned}" + (f", {kept} of them stored before" if kept else ""),
    }
    return facts_table(facts)


def machine_of(manifest: Mapping[str, Any]) -> dict[str, object]:
    """The facts on the machine."""
    machine = manifest.get("machine", {})
    return {name: machine.get(name) for name in ("processor", "cores", "system", "python")}


def command_of(manifest: Mapping[str, Any]) -> dict[str, object]:
    """The facts on the code, and on how and when it was called."""
    return {
        "version": manifest.get("version"),
        "git commit": manifest.get("git_commit"),
        "command": code(" ".join(manifest["command"])) if manifest.get("command") else None,
        "started": manifest.get("started"),
    }


def facts_table(facts: Mapping[str, object]) -> str:
    """What a result was made by and with, by name; a command is Markdown already."""
    lines = [
        [plain(name), DASH if value in (None, "") else str(value) if name == "command" else plain(str(value))]
        for name, value in facts.items()
    ]
    return table(["what", "value"], lines, text_columns=2)
