"""Benchmark report: targets, and a section for each part."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from vsconstraints import __version__
from vsconstraints.comparisons.runs.machine import git_commit, machine, package_versions
from vsconstraints.reports.markdown import Table as MarkdownTable
from vsconstraints.reports.markdown import plain

from .figures import draw
from .part import Part, Table
from .targets import judged
from .timing import UNIT

HOW = f"""
Times are divided by that of the *unit*, `{UNIT}`, since machines differ. The subjects of a table \
and
the unit take turns in one process: one call of the first, one of the second, and so on, then \
again from the first. So
whatever else the machine does hits all alike, and every call, the unit's too, is cold: it comes \
after the work of
others, as a control step does that is called every few milliseconds; the same call repeated at \
once takes 10 to
20 % less. Every call is timed by itself. Each subject has one unmeasured turn first. Linear \
algebra libraries use one
thread. Garbage is collected as usual, but objects that existed before are not searched. The unit \
is not the same
everywhere, nor always on one machine: where a ratio decides, the time in µs stands beside it.
"""


def write(
    parts: Mapping[str, Part], failures: Mapping[str, str], out: Path, command: str, wall: float
) -> Path:
    """Write ``benchmarks.md`` and its folder to ``out``."""
    folder = out / "benchmarks"
    folder.mkdir(parents=True, exist_ok=True)
    where = machine()
    load = " ".join(f"{value:.2f}" for value in os.getloadavg())
    packages = package_versions()
    sections = [
        "# Benchmarks",
        f"Made by `{command}` in {wall:.0f} s, {datetime.now(UTC):%Y-%m-%d}, vsconstraints "
        f"{__version__} "
        f"({git_commit() or 'no commit'}), {where['processor']}, {where['cores']} cores, "
        f"{where['system']}, "
        f"{where['python']}, NumPy {packages['numpy']}, load at the end {load}.",
        "## What it must show",
        _table(judged(parts)),
        _unit(parts),
        "## How it is measured",
        HOW.strip(),
    ]
    for name, part in parts.items():
        sections += [f"## {part.title}", part.text.strip(), *(_table(one) for one in part.tables)]
        try:
            draw(name, part, folder)
        except Exception as error:  # a figure that fails must not lose the tables
            sections.append(f"No figure: {plain(f'{type(error).__name__}: {error}')}")
            continue
        if part.figure:
            sections.append(f"![{part.title}](benchmarks/{part.figure})")
    if failures:
        sections += [
            "## What failed",
            *(f"- {name}: {plain(why)}" for name, why in failures.items()),
        ]
    report = out / "benchmarks.md"
    report.write_text("\n\n".join(filter(None, sections)) + "\n", encoding="utf-8")
    numbers = {name: part.numbers for name, part in parts.items()}
    (folder / "numbers.json").write_text(
        json.dumps(numbers, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    return report


def _table(one: Table) -> str:
    return MarkdownTable(one.header, one.lines, one.text_columns)


def _unit(parts: Mapping[str, Part]) -> str:
    numbers = parts["steps"].numbers if "steps" in parts else {}
    if "unit: median" not in numbers:
        return ""
    return (
        f"The unit took {1e6 * numbers['unit: median']:.1f} µs (median on the case study); its "
        f"own p99 was "
        f"{numbers['unit: p99/median']:.2f} times that, which on an idle machine is below 1.5."
    )
