"""What laws do: with erroneous gradients, as potential fields become the sliding mode, and for
using allowed space.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from ...comparisons.runs.spec import ControllerSpec, RunSpec
from ...scenarios import Scenario
from .study import Found, Results, Sweep
from .summary import NOT_RUN, RunSummary, clearance_distance, joint_distance, pixel_distance
from .tables import TABLES, Points, ended_early, grouped, where

#: Every law that studies compare with its usual options, by name.
LAWS = {name: ControllerSpec.from_table(name, table) for name, table in TABLES["laws"].items()}
#: Greatest number of samples in a row with φ ≥ 0 if a boundary is kept; and greatest φ of a speed
#: in T_s u⁺.
MAX_POSITIVE_SAMPLES: int = TABLES["pareto"]["limits"]["samples"]
MAX_EXCESS: float = TABLES["pareto"]["limits"]["excess"]


def _error_spec(case: Any) -> RunSpec:
    error = {"disturbances": {"gradient_error": case.gradient_error}} if case.gradient_error else {}
    return RunSpec(case.scenario, LAWS[case.controller], error)


def _error_lines(case: Any, run: RunSummary, results: Results) -> list[dict[str, Any]]:
    exact = results.get(case._replace(gradient_error=0.0), NOT_RUN)
    return [{"deviation_px": pixel_distance(run, exact)}]


def _error_numbers(points: Points) -> Found:
    names = ("deviation_px", "violation", "settling_time_s")
    return {
        (point["scenario"], point["controller"], point["gradient_error"]): {
            name: point[name] for name in names
        }
        | {"converged": point["status"] == "converged"}
        for point in points
    }


#: Every law with the erroneous gradient (49) in its visibility rows. The deviation is the greatest
#: distance, at any time, of a marker from where it is in the run of the same law with exact
#: gradients.
GRADIENT_ERROR = Sweep("gradient-error", _error_spec, _error_lines, _error_numbers)


def _region_spec(case: Any) -> RunSpec:
    if case.region is None:
        return RunSpec(case.scenario)
    law = LAWS[TABLES["shrinking-region"]["looks"][case.law]["law"]]
    return RunSpec(case.scenario, law.changed("region", case.region))


def _region_lines(case: Any, run: RunSummary, results: Results) -> list[dict[str, Any]]:
    """Its distances to the sliding-mode law, and what one sample of a row's action moves φ by in
    its range.
    """
    reference = results.get(case._replace(law="sliding-mode", region=None), NOT_RUN)
    steps = [
        run.Ts * row["switching_gain"] / row["scale"]
        for row in run.rows.values()
        if row["challenged"]
    ]
    return [
        {
            "joint_distance": joint_distance(run, reference),
            "clearance_distance": clearance_distance(run, reference),
            "unused": 100.0 * (1.0 - run.value("utilization")),
            "step": max(steps, default=math.nan),
        }
    ]


def _region_numbers(points: Points) -> Found:
    """Distances to the sliding-mode law, by scenario, blend and region."""
    numbers: dict[tuple[Any, ...], Mapping[Any, float]] = {}
    for scenario, own in grouped(points, "scenario").items():
        by_law = grouped(own, "law")
        floor, unused = (
            float(by_law[law][0][column]) if law in by_law else math.nan
            for law, column in (("halved", "joint_distance"), ("sliding-mode", "unused"))
        )
        numbers[scenario,] = {"sampling_distance": floor, "sliding_unused": unused}
        for blend in ("priority", "additive"):
            numbers[scenario, blend] = _shrinking(by_law.get(blend, []), floor)
    return numbers


def _shrinking(points: Points, floor: float) -> dict[str, float]:
    """Numbers about the runs of one blend, from the largest to the smallest region."""
    own = sorted(
        [point for point in points if not ended_early(point)], key=lambda point: -point["region"]
    )
    found: dict[str, float] = {"runs": len(points), "failed": len(points) - len(own)}
    if not own:
        return found
    for place, point in (("largest", own[0]), ("smallest", own[-1])):
        found[f"region_{place}"] = point["region"]
        found[f"distance_{place}_region"] = point["joint_distance"]
        found[f"unused_{place}_region"] = point["unused"]
    # a rise below what sampling alone changes is none
    falls = all(b["joint_distance"] <= max(a["joint_distance"], floor) for a, b in pairwise(own))
    deepest = max(own, key=lambda point: float(point["violation_depth"]))
    found |= {"distance_falls": falls and len(own) == len(points)}
    return found | {
        "violation_depth": deepest["violation_depth"],
        "violation_region": deepest["region"],
    }


#: Potential fields with ever smaller regions beside the sliding-mode law. The distance to sliding
#: mode is the root mean square of ‖q − q_SM‖ over time. How far the sliding-mode law is from itself
#: at half the sampling time is the scale of what sampling alone changes: no distance below it means
#: anything.
SHRINKING_REGION = Sweep("shrinking-region", _region_spec, _region_lines, _region_numbers)


def kept(points: Iterable[dict[str, Any]]) -> Points:
    """Points of runs that keep their boundaries, and have both what is compared."""
    return [
        p
        for p in points
        if not p["not_kept"] and math.isfinite(p["unused"] + p["acceleration_variation"])
    ]


def _pareto_spec(case: Any) -> RunSpec:
    law = LAWS[case.controller]
    if "region" in law.options:
        return RunSpec(
            case.scenario, law.changed("region", case.parameter).changed("strength", case.strength)
        )
    if "alpha" in law.options:
        return RunSpec(case.scenario, law.changed("alpha", case.parameter))
    return RunSpec(case.scenario, law, scaled_gains(case.scenario, case.parameter))


def _pareto_numbers(points: Points) -> Found:
    """What each law leaves unused at best, and how many of its runs are compared, and on the
    front.
    """
    numbers: dict[tuple[Any, ...], Mapping[Any, float]] = {}
    for key, runs in grouped(points, "scenario", "controller").items():
        compared = kept(runs)
        least = min((point["unused"] for point in compared), default=math.nan)
        numbers[key] = {
            "least_unused": least,
            "on_front": len(where(compared, front=True)),
            "kept": len(compared),
        }
    for point in where(points, controller="sliding-mode", parameter=1.0):
        numbers[point["scenario"], "printed"] = {
            "unused": point["unused"],
            "kept": bool(kept([point])),
        }
    return numbers


def scaled_gains(scenario: str, factor: float) -> dict[str, float]:
    """Overrides that multiply every u⁺ of a shipped scenario; none for the factor 1."""
    constraints = Scenario.load(scenario).tables["constraints"] if factor != 1.0 else ()
    return {
        f"constraints.{i}.switching_gain": factor * table["switching_gain"]
        for i, table in enumerate(constraints)
    }


def front(points: Sequence[dict[str, Any]]) -> Points:
    """The runs without violation that no other such run beats in both unused space and acceleration
    variation.
    """
    chosen: Points = []
    for point in sorted(kept(points), key=lambda p: (p["unused"], p["acceleration_variation"])):
        if not chosen or point["acceleration_variation"] < chosen[-1]["acceleration_variation"]:
            chosen.append(point)
    return chosen


def unused(run: RunSummary) -> float:
    """Least clearance as a share of the characteristic length, averaged over the challenged rows
    [%]; NaN without.
    """
    left = [
        max(0.0, 1.0 - float(row["usage_max"])) for row in run.rows.values() if row["challenged"]
    ]
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


#: Every law over the range of its own parameter: a factor on every u⁺, a region, or the rate α of a
#: barrier. Runs are compared if they keep their boundaries: they reach the goal, no row with a σ of
#: its own is violated, no speed by more than sampling explains, and φ ≥ 0 lasts for two samples at
#: most, so that where a row acts it slides or stays inside. A run is on the front if it is one of
#: these and no other both leaves less of the allowed space unused and varies its acceleration less.
#: What is left unused is the least clearance of a row as a share of its characteristic length,
#: averaged over the rows that tracking alone violates.
PARETO = Sweep(
    "pareto",
    _pareto_spec,
    lambda case, run, results: [{"unused": unused(run), "not_kept": not_kept(run)}],
    _pareto_numbers,
    lambda points: [
        p | {"front": p in front(where(points, scenario=p["scenario"]))} for p in points
    ],
    helpers={"kept": kept},
)
