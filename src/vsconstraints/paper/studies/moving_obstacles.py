"""What it takes to keep clear of obstacles that move, and what it costs not to know that they do."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...scenarios import Scenario
from .study import Found, Results, Sweep
from .summary import RunSummary
from .tables import TABLES, Points, grouped, smallest_gain, where

OBSTACLES: dict[str, dict[str, Any]] = TABLES["non-static"]["obstacles"]
#: Depth, as a fraction of the obstacle's radius, up to which its boundary counts as kept.
KEPT: float = TABLES["non-static"]["limits"]["depth"]


def _constraint(case: Any) -> dict[str, Any]:
    """The obstacle's table: it moves ``speed`` times as fast, and is at its usual place at the meeting time."""
    obstacle = OBSTACLES[case.scenario]
    table: dict[str, Any] = copy.deepcopy(Scenario.load(case.scenario).tables["constraints"][0])
    velocity = np.array(table["motion"]["velocity"])
    shape = table.get("curve", table)
    start = np.array(shape[obstacle["place"]]) + (1.0 - case.speed) * obstacle["meeting"] * velocity
    shape[obstacle["place"]] = start.round(6).tolist()
    table["motion"] = {"velocity": (case.speed * velocity).round(6).tolist(), "known": case.known}
    table["switching_gain"] = case.switching_gain
    return table


def _spec(case: Any) -> RunSpec:
    duration = OBSTACLES[case.scenario]["duration"]
    return RunSpec(case.scenario, overrides={"constraints": [_constraint(case)], "duration": duration})


def _lines(case: Any, run: RunSummary, results: Results) -> list[dict[str, Any]]:
    """Its outcome, how deep the obstacle is entered, and K times its speed."""
    table, factor = _constraint(case), OBSTACLES[case.scenario]["factor"]
    depth = max((float(row["violation_depth"]) for row in run.rows.values()), default=math.nan)
    outcome = "kept" if run.value("violation_depth") <= KEPT else "violated"
    return [
        {
            "outcome": "failed" if run.ended_early else outcome,
            "depth": factor * depth,
            "depth_expected": factor * table["K"] * float(np.linalg.norm(table["motion"]["velocity"])),
        }
    ]


def _numbers(points: Points) -> Found:
    """For every speed the bound, the smallest gain that is enough, the cost of not knowing."""
    numbers: dict[tuple[Any, ...], dict[Any, float]] = {}
    above: Points = []
    for key, own in grouped(points, "scenario", "speed").items():
        known = where(own, known=True)
        unknown = next(iter(where(own, known=False)), {"switching_gain": math.nan, "depth": math.nan})
        same = where(known, switching_gain=unknown["switching_gain"])
        largest = max(known, key=lambda point: float(point["switching_gain"]))  # whose bound is the speed's
        numbers[key] = {
            "bound_12": largest["bound_12"],
            "smallest_kept": smallest_gain(known, ["kept"]),
            "depth_known": same[0]["depth"] if same else math.nan,
            "depth_unknown": unknown["depth"],
            "depth_expected": largest["depth_expected"],
        }
        above += [p for p in known if p["switching_gain"] > largest["bound_12"] and p["outcome"] != "failed"]
    return {**numbers, (): {"above_bound": len(above), "above_bound_kept": len(where(above, outcome="kept"))}}


#: The sliding-mode law with obstacles that move at different speeds, known and unknown. The obstacle is the only
#: constraint. It is displaced so that it is at the same place at one time whatever its speed, and stands there if the
#: speed is zero. Claim: ∂φ/∂t only changes the bound (12) on u⁺ (section 5.4). A controller that takes the obstacle for
#: static keeps σ + K (σ̇ − ∂σ/∂t) ≤ 0, and so goes up to K ∂σ/∂t too far: K times its speed.
NON_STATIC = Sweep("non-static", _spec, _lines, _numbers)
