"""Time before the first step: start-up, imports, first compilation; and whole processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from .part import Effort, Part, Table, digits

TEXT = """
Whole processes, from start to end, in turn; medians and the longest. `python -c pass` is Python \
alone.
"""

FIRST = """
The first step of a fresh process on the case study. *compiling*: with an empty folder for \
compiled code, as everybody
meets it: a second process compiles in the meantime what may be needed next; *alone*: without \
that. *cached*: with the
folder filled. Times in ms; imports are those of NumPy, Pinocchio and this package.
"""

DEFAULT = """
`vsconstraints compare` without arguments: the whole process, report included, on all cores. \
*first ever*: with an empty
folder for compiled code; *alone*: likewise, without a second process that compiles in the \
meantime; *cached*: with the
folder that this filled. CPU times are of all processes, of *alone* beyond those of *cached* what \
compiling takes; those
of the second process of *first ever* are not known.
"""

HERE = Path(__file__).resolve().parent
LAWS = ("sliding-mode", "potential-field", "tracking", "hierarchical-qp")
COMMAND = "import sys; from vsconstraints.cli import main; sys.argv[0] = 'vsconstraints'; main()"


def command(*arguments: str) -> list[str]:
    """Return the command line of this environment."""
    script = Path(sys.executable).with_name("vsconstraints")
    return [*([str(script)] if script.exists() else [sys.executable, "-c", COMMAND]), *arguments]


def run(
    arguments: Sequence[str], environment: dict[str, str] | None = None, folder: Path | None = None
) -> str:
    """Return the output of a process; raises RuntimeError with the last of it on failure."""
    ended = subprocess.run(
        arguments,
        capture_output=True,
        text=True,
        env={**os.environ, **(environment or {})},
        cwd=folder,
        timeout=600,
        check=False,
    )
    if ended.returncode:
        raise RuntimeError(
            f"{' '.join(arguments)}: {(ended.stderr or ended.stdout).strip()[-500:]}"
        )
    return ended.stdout


def measure(effort: Effort) -> Part:
    """Measure the start-up of processes."""
    part = Part("Start-up", TEXT)
    subjects = {
        "`python -c pass`": [sys.executable, "-c", "pass"],
        "`vsconstraints --help`": command("--help"),
        "`from vsconstraints.controllers import SlidingMode`": [
            sys.executable,
            "-c",
            "from vsconstraints.controllers import SlidingMode",
        ],
        "`import vsconstraints`": [sys.executable, "-c", "import vsconstraints"],
        "`import numpy`": [sys.executable, "-c", "import numpy"],
    }
    times: dict[str, list[float]] = {name: [] for name in subjects}
    for arguments in subjects.values():
        run(arguments)
    for _ in range(effort.repeats):
        for name, arguments in subjects.items():
            started = perf_counter()
            run(arguments)
            times[name].append(perf_counter() - started)
    lines = []
    for name, found in times.items():
        part.numbers[f"{name.strip('`')}: median"] = float(np.median(found))
        lines.append([name, digits(float(np.median(found))), digits(max(found))])
    part.tables.append(Table(["process", "median s", "longest s"], lines))
    return part


def measure_first_calls(effort: Effort) -> Part:
    """Measure first calls, compiling and cached."""
    part = Part("First call", FIRST)
    kinds: dict[str, dict[str, float]] = {}
    # a second process may still be compiling when the folder is removed
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        for kind in ("compiling alone", "compiling", "cached") if effort.long else ("cached",):
            environment = {}
            if effort.long:
                cache = "alone" if kind == "compiling alone" else "shared"
                environment["NUMBA_CACHE_DIR"] = str(Path(folder) / cache)
            if kind == "compiling alone":
                environment["VSCONSTRAINTS_COMPILE"] = "alone"
            kinds[kind] = json.loads(
                run([sys.executable, str(HERE / "first_call.py"), *LAWS], environment)
            )
    steps = ["rows", *LAWS]
    for kind, found in kinds.items():
        part.numbers[f"{kind}: all first calls"] = sum(found[name] for name in steps)
    names = ["imports", "setup", *steps, "rows again"]
    titles = {"rows": "first rows and task", "rows again": "second rows and task"}
    lines = [
        [titles.get(name, name), *(digits(1e3 * found[name]) for found in kinds.values())]
        for name in names
    ]
    total = [
        "all first calls",
        *(digits(1e3 * part.numbers[f"{kind}: all first calls"]) for kind in kinds),
    ]
    part.tables.append(Table(["ms", *kinds], [*lines, total]))
    return part


def measure_default_comparison(effort: Effort) -> Part:
    """Measure the default comparison as a whole process."""
    part = Part("Default comparison", DEFAULT)
    if not effort.long:
        part.text += "\nNot measured in the quick form.\n"
        return part
    lines = []
    cpu = {}
    # a second process may still be compiling when the folder is removed
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        for kind in ("first ever", "alone", "cached"):
            environment = {
                "NUMBA_CACHE_DIR": str(Path(folder) / ("first" if kind == "first ever" else "code"))
            }
            environment |= {"VSCONSTRAINTS_COMPILE": "alone"} if kind == "alone" else {}
            started = perf_counter()
            before = _cpu_of_children()
            run(command("compare", "--out", kind), environment, Path(folder))
            wall = perf_counter() - started
            cpu[kind] = _cpu_of_children() - before
            manifest = json.loads(
                (Path(folder) / kind / "manifest.json").read_text(encoding="utf-8")
            )
            simulating = manifest["wall_time_s"]
            part.numbers[f"whole process, {kind}"] = wall
            lines.append([kind, *map(digits, (wall, simulating, wall - simulating, cpu[kind]))])
    part.numbers.update({"runs": manifest["runs"], "compiling: CPU": cpu["alone"] - cpu["cached"]})
    part.text += f"\nRuns: {manifest['runs']}; cores: {os.cpu_count() or 1}.\n"
    header = [
        "code",
        "whole process s",
        "simulating and scoring s",
        "start, report and figures s",
        "CPU s",
    ]
    part.tables.append(Table(header, lines))
    return part


def _cpu_of_children() -> float:
    """CPU time [s] of ended child processes that were waited for, and of their children."""
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
