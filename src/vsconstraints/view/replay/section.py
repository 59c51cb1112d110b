"""Section of a scenario in the report of a comparison: a replay of two of its runs."""

from __future__ import annotations

from urllib.parse import quote

import numpy as np

from ...comparisons.suite import BASELINE
from ...reports.drawing import TRIAL_SHOWN
from ...reports.markdown import code
from ...reports.results import Results, clean
from .page import write_replay
from .runs import run_of

REPLAYS = "replays"  # folder below that of the comparison


def replayed_runs(results: Results, scenario: str) -> tuple[str, ...]:
    """Return the controllers that the replay of a scenario shows.

    These are the controller with the deepest violation, or the unconstrained baseline if none
    violates a row, and the controller with the greatest utilization among the clean ones.
    """
    lines = {}
    for name in results.controllers:
        for line in results.runs(scenario, name):
            if line["trial"] == TRIAL_SHOWN and line["duration_s"] > 0.0:
                lines[name] = line
    depths = {}
    used = {}
    for name in results.competitors:
        if name not in lines:
            continue
        line = lines[name]
        depth = float(line["violation_depth"])
        if depth > 0.0:
            depths[name] = depth
        if clean(line):
            used[name] = float(np.nan_to_num(line["utilization"], nan=-1.0))
    worst = max(depths, key=depths.__getitem__, default=BASELINE)
    best = max(used, key=used.__getitem__, default=worst)
    return tuple(name for name in dict.fromkeys((worst, best)) if name in lines)


def replay_section(results: Results, scenario: str) -> str:
    """Write the replay page of a scenario, and return a link to it; empty without a run."""
    controllers = replayed_runs(results, scenario)
    runs = [run_of(results.stored, scenario, name, TRIAL_SHOWN) for name in controllers]
    if not runs:
        return ""
    write_replay(runs, results.stored.folder / REPLAYS / f"{scenario}.html")
    link = f"[Replay in a browser]({REPLAYS}/{quote(scenario)}.html)"
    return f"{link}: {' and '.join(map(code, controllers))}."
