"""Potential fields that become the sliding-mode law, and what each law pays for using the allowed space."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, ClassVar

from ...comparisons.runs.spec import SLIDING_MODE, RunSpec
from ...scenarios import Scenario
from . import points as data
from .drawing import LAWS, hierarchical_qp, potential_field
from .points import Numbers, Points
from .study import Sweep
from .summary import NOT_RUN, RunSummary, clearance_distance, joint_distance

BLENDS = ("priority", "additive")

#: Greatest number of samples in a row with φ ≥ 0 if a boundary is kept: in a sliding mode it is one, or two.
MAX_POSITIVE_SAMPLES = 2
MAX_EXCESS = 2.0  #: Greatest φ of a speed, whose φ is its clearance, in T_s u⁺: (43) allows one, tracking adds to it.


class ShrinkingRegion(Sweep):
    """Potential fields with ever smaller regions beside the sliding-mode law.

    The distance to sliding mode is the root mean square of ‖q − q_SM‖ over time. How far the sliding-mode law is from
    itself at half the sampling time is the scale of what sampling alone changes: no distance below it means anything.
    """

    name = "shrinking-region"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        return RunSpec(case.scenario, potential_field(case.law, case.region) if case.region else SLIDING_MODE)

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """Its distances to the sliding-mode law, and what one sample of a row's action moves φ by in its range."""
        reference = results.get(self.Case(case.scenario, "sliding-mode"), NOT_RUN)
        steps = [run.Ts * row["switching_gain"] / row["scale"] for row in run.rows.values() if row["challenged"]]
        return {
            "joint_distance": joint_distance(run, reference),
            "clearance_distance": clearance_distance(run, reference),
            "unused": 100.0 * (1.0 - run.value("utilization")),
            "step": max(steps, default=math.nan),
        }

    def numbers(self, points: Points) -> Numbers:
        """Distances to the sliding-mode law, by scenario, blend and region."""
        numbers: Numbers = {}
        for scenario, own in data.grouped(points, "scenario").items():
            by_law = data.grouped(own, "law")
            floor = _only(by_law, "halved", "joint_distance")
            found = {"sampling_distance": floor, "sliding_unused": _only(by_law, "sliding-mode", "unused")}
            numbers |= data.keyed(found, scenario)
            for blend in BLENDS:
                numbers |= data.keyed(_shrinking(by_law.get(blend, []), floor), scenario, blend)
        return numbers


def _only(by_law: Mapping[str, Points], law: str, column: str) -> float:
    """What the only run of a law has in a column; NaN if there is no such run."""
    return float(by_law[law][0][column]) if law in by_law else math.nan


def _shrinking(points: Points, floor: float) -> dict[str, float]:
    """Numbers about the runs of one blend, from the largest to the smallest region."""
    own = sorted([point for point in points if not data.ended_early(point)], key=lambda point: -point["region"])
    found: dict[str, float] = {"runs": len(points), "failed": len(points) - len(own)}
    if not own:
        return found
    for place, point in (("largest", own[0]), ("smallest", own[-1])):
        found[f"region_{place}"] = point["region"]
        found[f"distance_{place}_region"] = point["joint_distance"]
        found[f"unused_{place}_region"] = point["unused"]
    # a rise below what sampling alone changes is none
    falls = all(b["joint_distance"] <= max(a["joint_distance"], floor) for a, b in pairwise(own))
    deepest = max(own, key=lambda point: point["violation_depth"])
    found |= {"distance_falls": falls and len(own) == len(points)}
    return found | {"violation_depth": deepest["violation_depth"], "violation_region": deepest["region"]}


def kept(points: Iterable[dict[str, Any]]) -> Points:
    """Points of runs that keep their boundaries, and have both what is compared."""
    return [p for p in points if not p["not_kept"] and math.isfinite(p["unused"] + p["acceleration_variation"])]


class Pareto(Sweep):
    """Every law over the range of its own parameter: a factor on every u⁺, a region, or the rate α of a barrier.

    Runs are compared if they keep their boundaries: they reach the goal, no row with a σ of its own is violated, no
    speed by more than sampling explains, and φ ≥ 0 lasts for two samples at most, so that where a row acts it slides or
    stays inside. A run is on the front if it is one of these and no other both leaves less of the allowed space unused
    and varies its acceleration less. What is left unused is the least clearance of a row as a share of its
    characteristic length, averaged over the rows that tracking alone violates.
    """

    name = "pareto"
    helpers: ClassVar[dict[str, Any]] = {"kept": kept}

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        if case.controller == "hierarchical-qp":
            return RunSpec(case.scenario, hierarchical_qp(case.parameter))
        if case.strength is not None:
            blend = "additive" if case.controller == "potential-field" else "priority"
            return RunSpec(case.scenario, potential_field(blend, case.parameter, case.strength))
        return RunSpec(case.scenario, LAWS[case.controller], scaled_gains(case.scenario, case.parameter))

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """What it leaves unused, and why it is not compared."""
        return {"unused": unused(run), "not_kept": not_kept(run)}

    def points(self, results: Mapping[Any, RunSummary]) -> Points:
        """Price and use of every run, and whether it is on the front."""
        points = super().points(results)
        best = [point for own in data.grouped(points, "scenario").values() for point in front(own)]
        return [point | {"front": point in best} for point in points]

    def numbers(self, points: Points) -> Numbers:
        """What each law leaves unused at best, and how many of its runs are compared, and on the front."""
        numbers: Numbers = {}
        for scenario, own in data.grouped(points, "scenario").items():
            for law, runs in data.grouped(own, "controller").items():
                compared = kept(runs)
                least = min((point["unused"] for point in compared), default=math.nan)
                found = {"least_unused": least, "on_front": sum(p["front"] for p in compared), "kept": len(compared)}
                numbers |= data.keyed(found, scenario, law)
            for point in data.where(own, controller="sliding-mode", parameter=1.0):
                numbers |= data.keyed({"unused": point["unused"], "kept": bool(kept([point]))}, scenario, "printed")
        return numbers


def scaled_gains(scenario: str, factor: float) -> dict[str, float]:
    """Overrides that multiply every u⁺ of a shipped scenario; none for the factor 1."""
    constraints = Scenario.load(scenario).tables["constraints"]
    if factor == 1.0:
        return {}
    return {f"constraints.{i}.switching_gain": factor * table["switching_gain"] for i, table in enumerate(constraints)}


def front(points: Sequence[dict[str, Any]]) -> Points:
    """The runs without violation that no other such run beats in both unused space and acceleration variation."""
    chosen: Points = []
    for point in sorted(kept(points), key=lambda p: (p["unused"], p["acceleration_variation"])):
        if not chosen or point["acceleration_variation"] < chosen[-1]["acceleration_variation"]:
            chosen.append(point)
    return chosen


def unused(run: RunSummary) -> float:
    """Least clearance as a share of the characteristic length, averaged over the challenged rows [%]; NaN without."""
    left = [max(0.0, 1.0 - float(row["usage_max"])) for row in run.rows.values() if row["challenged"]]
    return 100.0 * math.fsum(left) / len(left) if left else math.nan


def not_kept(run: RunSummary) -> str:
    """Why a run is not compared with those that keep their boundaries; empty if it is."""
    if run.status != "converged":
        return run.status
    for label, row in run.rows.items():
        samples = round(float(row["longest_positive_run_s"]) / run.Ts)
        if row["kind"] == "speed":
            violated = row["phi_max"] > MAX_EXCESS * run.Ts * row["switching_gain"]
        else:
            violated = row["violation_depth"] > 0.0
        if violated:
            return f"{label} is violated"
        if samples > MAX_POSITIVE_SAMPLES:
            return f"{label} has φ ≥ 0 for {samples} samples in a row"
    return ""
