"""Studies that compare laws.

They cover erroneous gradients, potential fields with shrinking regions, and use of the allowed
space.
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

#: Laws that studies compare, with their usual options, by name.
LAWS = {name: ControllerSpec.from_table(name, table) for name, table in TABLES["laws"].items()}
#: Greatest number of consecutive samples with φ ≥ 0 if a boundary is kept, and greatest φ of a
#: speed in units of T_s u⁺.
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


#: All laws with the erroneous gradient (49) in their visibility rows. The deviation is the greatest
#: distance, at any time, of a marker from its position in the run of the same law with exact
#: gradients.
GRADIENT_ERROR = Sweep("gradient-error", _error_spec, _error_lines, _error_numbers)


def _region_spec(case: Any) -> RunSpec:
    if case.region is None:
        return RunSpec(case.scenario)
    law = LAWS[TABLES["shrinking-region"]["looks"][case.law]["law"]]
    return RunSpec(case.scenario, law.changed("region", case.region))


def _region_lines(case: Any, run: RunSummary, results: Results) -> list[dict[str, Any]]:
    """Distances of the run to the sliding-mode law, and greatest step of φ relative to its range.

    The step is the change of φ by one sample of a row's action.
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
    # a rise smaller than the effect of sampling alone does not count
    falls = all(b["joint_distance"] <= max(a["joint_distance"], floor) for a, b in pairwise(own))
    deepest = max(own, key=lambda point: float(point["violation_depth"]))
    found |= {"distance_falls": falls and len(own) == len(points)}
    return found | {
        "violation_depth": deepest["violation_depth"],
        "violation_region": deepest["region"],
    }


#: Potential fields with smaller and smaller regions, compared with the sliding-mode law. The
#: distance to sliding mode is the root mean square of ‖q − q_SM‖ over time. The distance of the
#: sliding-mode law to itself at half the sampling time is the effect of sampling alone: smaller
#: distances are not significant.
SHRINKING_REGION = Sweep("shrinking-region", _region_spec, _region_lines, _region_numbers)


def kept(points: Iterable[dict[str, Any]]) -> Points:
    """Return points of runs that keep their boundaries and have finite values of both measures."""
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
    """Smallest unused space of each law, and numbers of its runs compared and on the front."""
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
    """Return overrides that multiply every u⁺ of a shipped scenario; none for the factor 1."""
    constraints = Scenario.load(scenario).tables["constraints"] if factor != 1.0 else ()
    return {
        f"constraints.{i}.switching_gain": factor * table["switching_gain"]
        for i, table in enumerate(constraints)
    }


def front(points: Sequence[dict[str, Any]]) -> Points:
    """Return the Pareto front of runs that keep their boundaries.

    The two criteria are unused space and acceleration variation.
    """
    chosen: Points = []
    for point in sorted(kept(points), key=lambda p: (p["unused"], p["acceleration_variation"])):
        if not chosen or point["acceleration_variation"] < chosen[-1]["acceleration_variation"]:
            chosen.append(point)
    return chosen


def unused(run: RunSummary) -> float:
    """Smallest clearance as a share of the characteristic length [%].

    It is averaged over the challenged rows; NaN without challenged rows.
    """
    left = [
        max(0.0, 1.0 - float(row["usage_max"])) for row in run.rows.values() if row["challenged"]
    ]
    return 100.0 * math.fsum(left) / len(left) if left else math.nan


def not_kept(run: RunSummary) -> str:
    """Reason why a run does not keep its boundaries, so that it is not compared; else empty."""
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


#: All laws over the range of their own parameter: a factor on every u⁺, a region, or the rate α of
#: a barrier. Runs are compared if they keep their boundaries: they reach the goal, no row with a
#: separate σ is violated, no speed exceeds its limit by more than sampling explains, and φ ≥ 0
#: lasts for at most two samples, so that an active row slides or stays inside. A compared run is on
#: the front if no other compared run has both less unused space and less variation of acceleration.
#: Unused space is the smallest clearance of a row as a share of its characteristic length, averaged
#: over the rows that the unconstrained baseline violates.
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
