"""What it takes to keep clear of obstacles that move, and what it costs not to know that they do."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...scenarios import Scenario
from . import points as data
from .points import Numbers, Points
from .study import Sweep
from .summary import RunSummary

#: Depth, as a fraction of the obstacle's radius, up to which its boundary counts as kept: about what it moves by in a
#: sampling period.
KEPT = 0.005


class NonStatic(Sweep):
    """The sliding-mode law with obstacles that move at different speeds, known and unknown.

    The obstacle is the only constraint. It is displaced so that it is at the same place at one time whatever its speed,
    and stands there if the speed is zero. Claim: ∂φ/∂t only changes the bound (12) on u⁺ (section 5.4). A controller
    that takes the obstacle for static keeps σ + K (σ̇ − ∂σ/∂t) ≤ 0, and so goes up to K ∂σ/∂t too far: K times its
    speed.
    """

    name = "non-static"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        duration = self.table["obstacles"][case.scenario]["duration"]
        return RunSpec(case.scenario, overrides={"constraints": [self._constraint(case)], "duration": duration})

    def _constraint(self, case: Any) -> dict[str, Any]:
        """The obstacle's table: it moves ``speed`` times as fast, and is at its usual place at the meeting time."""
        obstacle = self.table["obstacles"][case.scenario]
        table: dict[str, Any] = copy.deepcopy(Scenario.load(case.scenario).tables["constraints"][0])
        velocity = np.array(table["motion"]["velocity"])
        shape = table.get("curve", table)
        start = np.array(shape[obstacle["place"]]) + (1.0 - case.speed) * obstacle["meeting"] * velocity
        shape[obstacle["place"]] = start.round(6).tolist()
        table["motion"] = {"velocity": (case.speed * velocity).round(6).tolist(), "known": case.known}
        table["switching_gain"] = case.switching_gain
        return table

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """Its outcome, how deep the obstacle is entered, and K times its speed."""
        table, factor = self._constraint(case), self.table["obstacles"][case.scenario]["factor"]
        depth = max((float(row["violation_depth"]) for row in run.rows.values()), default=math.nan)
        outcome = "kept" if run.value("violation_depth") <= KEPT else "violated"
        return {
            "outcome": "failed" if run.ended_early else outcome,
            "depth": factor * depth,
            "depth_expected": factor * table["K"] * float(np.linalg.norm(table["motion"]["velocity"])),
        }

    def numbers(self, points: Points) -> Numbers:
        """For every speed the bound, the smallest gain that is enough, the cost of not knowing."""
        numbers: Numbers = {}
        above: Points = []
        for scenario, at_all in data.grouped(points, "scenario").items():
            for speed, own in data.grouped(at_all, "speed").items():
                found = _at_speed(own)
                numbers |= data.keyed(found, scenario, speed)
                above += [p for p in data.where(own, known=True) if p["switching_gain"] > found["bound_12"]]
        above = [point for point in above if point["outcome"] != "failed"]
        kept = data.where(above, outcome="kept")
        return numbers | data.keyed({"above_bound": len(above), "above_bound_kept": len(kept)})


def _at_speed(points: Points) -> dict[str, float]:
    """Numbers about one obstacle at one speed; the bound (12) is that of the known run with the largest gain."""
    known = data.where(points, known=True)
    unknown = next(iter(data.where(points, known=False)), {"switching_gain": math.nan, "depth": math.nan})
    same = data.where(known, switching_gain=unknown["switching_gain"])
    largest = max(known, key=lambda point: float(point["switching_gain"]))
    return {
        "bound_12": largest["bound_12"],
        "smallest_kept": data.smallest_enough(known, "switching_gain", lambda point: point["outcome"] == "kept"),
        "depth_known": same[0]["depth"] if same else math.nan,
        "depth_unknown": unknown["depth"],
        "depth_expected": largest["depth_expected"],
    }
