"""Our step beside other packages' on the same arm."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

import numpy as np

from vsconstraints.controllers import HierarchicalQP, SlidingMode
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

from .part import Effort, Part, Table, digits, median_p99_max, microseconds, ratios
from .peers import PEERS
from .startup import HERE
from .steps import Walk, shortened
from .timing import UNIT, Times, in_turn

TEXT = """
Ours: everything from state to command on the scenario `ur5-fov`, along its runs. Peers: the same UR5 and their own
standard step with joint range and speed limits and one frame task, in a process each, which takes the unit in turn with
them; what they solve is not the same problem, but what one would put in its place. Pink and TSID raise or fail where
limits are violated already; TSID solves inverse dynamics.
"""

PYTHON = "VSCONSTRAINTS_PEERS_PYTHON"
"""Environment variable: the interpreter that has the peers, if it is another one."""


def measure(effort: Effort) -> Part:
    """See the module."""
    part = Part("Beside other packages", TEXT)
    scenario = shortened(Scenario.load("ur5-fov"), effort)
    walks = {}
    for law in (SlidingMode(), HierarchicalQP()):
        setup = scenario.setup()
        walks[law.name] = Walk(setup, law, simulate(setup, law), effort.turns)
    times = in_turn(walks, effort.turns)
    unit = float(np.median(times[UNIT]))
    lines = []
    for name in walks:
        total = Times(times[name][:, 2], unit)
        part.keep(name, total)
        lines.append([f"vsconstraints, {name}", median_p99_max(total), ratios(total), ""])
    for name in PEERS:
        try:
            found = peer(name, effort.turns)
        except RuntimeError as error:
            lines.append([name, "–", "–", f"not measured: {error}"])
            continue
        for what, (median, p99, longest, its_unit) in found["times"].items():
            part.numbers[f"{name}, {what}: ratio"] = median / its_unit
            shares = " / ".join(digits(value / its_unit) for value in (median, p99, longest))
            lines.append([f"{name}, {what}", microseconds(median, p99, longest), shares, f"version {found['version']}"])
    table = Table(["step", "µs: median / p99 / max", "ratio", "note"], lines)
    part.tables.append(table)
    return part


def peer(name: str, turns: int) -> dict[str, Any]:
    """What :mod:`benchmarks.peers` printed; RuntimeError with the reason if it could not measure."""
    python = os.environ.get(PYTHON) or sys.executable
    try:
        ended = subprocess.run(
            [python, "-m", "benchmarks.peers", name, str(turns)],
            capture_output=True,
            text=True,
            cwd=HERE.parent,
            timeout=120,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise RuntimeError(str(error)) from error
    if ended.returncode:
        words = ended.stderr.strip().splitlines()
        last = words[-1] if words else "no message"
        raise RuntimeError(
            last if ended.returncode > 0 else f"its process was ended by signal {-ended.returncode}: {last}"
        )
    return dict(json.loads(ended.stdout.strip().splitlines()[-1]))
