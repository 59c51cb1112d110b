"""Step time of this package compared with other packages on the same arm."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.metadata import distribution
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
Ours: everything from state to command on the scenario `ur5-fov`, along its runs. Peers: the same \
UR5 and their own
standard step with joint range and speed limits and one frame task, in a process each, which takes \
the unit in turn with
them; what they solve is not the same problem, but what one would put in its place. Pink and TSID \
raise or fail where
limits are violated already; TSID solves inverse dynamics, and placo velocities, both in C++.
"""

PYTHON = "VSCONSTRAINTS_PEERS_PYTHON"
"""Environment variable with other interpreters, separated as in PATH.

Each peer runs in the first interpreter that has it. TSID and placo require other versions of
Pinocchio than this package.
"""

UR5 = "cmeel.prefix/share/example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"


def measure(effort: Effort) -> Part:
    """Measure this part; see the module."""
    part = Part("Beside other packages", TEXT)
    scenario = shortened(Scenario.load("ur5-fov"), effort.duration)
    walks = {}
    for law in (SlidingMode(), HierarchicalQP()):
        setup = scenario.setup()
        walks[law.name] = Walk(setup, law, simulate(setup, law), effort.turns)
    times = in_turn({name: walk.in_one for name, walk in walks.items()}, effort.turns)
    unit = float(np.median(times[UNIT]))
    lines = []
    for name in walks:
        total = Times(times[name], unit)
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
            lines.append(
                [
                    f"{name}, {what}",
                    microseconds(median, p99, longest),
                    shares,
                    f"version {found['version']}",
                ]
            )
    table = Table(["step", "µs: median / p99 / max", "ratio", "note"], lines)
    part.tables.append(table)
    return part


def peer(name: str, turns: int) -> dict[str, Any]:
    """Return the output of :mod:`benchmarks.peers`.

    Raises RuntimeError with the reasons if no interpreter could measure.
    """
    reasons = []
    for python in (sys.executable, *filter(None, os.environ.get(PYTHON, "").split(os.pathsep))):
        try:
            return _measured(python, name, turns)
        except RuntimeError as error:
            reasons.append(str(error))
    raise RuntimeError("; ".join(dict.fromkeys(reasons)))


def _measured(python: str, name: str, turns: int) -> dict[str, Any]:
    urdf = str(distribution("example-robot-data").locate_file(UR5))
    try:
        ended = subprocess.run(
            [python, "-m", "benchmarks.peers", name, str(turns), urdf],
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
            last
            if ended.returncode > 0
            else f"its process was ended by signal {-ended.returncode}: {last}"
        )
    return dict(json.loads(ended.stdout.strip().splitlines()[-1]))
