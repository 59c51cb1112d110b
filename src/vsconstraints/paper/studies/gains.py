"""Studies of the switching gain, with static and moving obstacles, and of the sampling time."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...scenarios import Scenario
from .study import Found, Results, Sweep
from .summary import RunSummary
from .tables import TABLES, Points, greatest, grouped, smallest_gain, where

#: Outcomes of a run, the worst first.
OUTCOMES = ("failed", "violated", "beyond band", "band, not sliding", "sliding")
#: Requirements on a switching gain, and the outcomes that fulfil each.
ENOUGH = {"allowed": OUTCOMES[2:], "in_band": OUTCOMES[3:], "sliding": OUTCOMES[4:]}
BAND_SCENARIOS = ("example-2d-fov", "example-2d-fast-high-gain")
ROW_SCENARIO = "case-study-6r"
OBSTACLES: dict[str, dict[str, Any]] = TABLES["non-static"]["obstacles"]
#: Depth, as a fraction of the obstacle's radius, up to which its boundary counts as kept.
KEPT: float = TABLES["non-static"]["limits"]["depth"]


def _gain_spec(case: Any) -> RunSpec:
    """Return the run for K_p(0) in 1/s², and u⁺."""
    overrides = {"task.Kp0": case.Kp0, "constraints.0.switching_gain": case.switching_gain}
    return RunSpec("example-2d-fov", overrides=overrides)


def _gain_lines(case: Any, run: RunSummary, results: Results) -> list[dict[str, Any]]:
    """Outcome, band, and lower bound on u⁺ for a return after one sample."""
    band = run.Ts * case.switching_gain
    outcome = "sliding" if run.longest_run <= 1 else "band, not sliding"
    if run.ended_early:
        outcome = "failed"
    elif run.value("violation_depth") > 0.0:
        outcome = "violated"
    elif run.phi_max > band:
        outcome = "beyond band"
    return [
        {
            "outcome": outcome,
            "band_bound": band,
            "bound_sampled": run.needed_gain + max(run.entry_push, 0.0),
        }
    ]


def _gain_numbers(points: Points) -> Found:
    """Bounds and smallest sufficient gains for each speed; number of runs above (12) by outcome."""
    numbers: dict[tuple[Any, ...], dict[Any, float]] = {}
    for Kp0, own in grouped(points, "Kp0").items():
        # the greatest along the sliding runs or, if none slides, along the run with the largest
        # gain
        bounding = where(own, outcome="sliding") or [
            max(own, key=lambda point: float(point["switching_gain"]))
        ]
        numbers[Kp0,] = {name: greatest(bounding, name) for name in ("bound_12", "bound_sampled")}
        numbers[Kp0,] |= {
            f"smallest_{name}": smallest_gain(own, outcomes) for name, outcomes in ENOUGH.items()
        }
    # bound along the run's own motion; without an active row there is no bound
    below = [point for point in points if point["switching_gain"] <= point["bound_12"]]
    above = [point for point in points if point not in below]
    numbers[()] = {"above_bound": len(above), "below_bound": len(below)}
    for side, own in (("above_bound", above), ("below_bound", below)):
        numbers[()] |= {
            f"{side}_{name}": len(where(own, outcome=[*good])) for name, good in ENOUGH.items()
        }
    return numbers


#: The first example with faster and faster motion, and a grid of switching gains for each speed.
#: Three requirements on a switching gain are tested, each stricter than the one before: σ ≤ 0
#: holds; φ stays within the band (43); φ returns below zero after one sample, as in a sliding mode.
#: Condition (12) guarantees that φ falls while its row is active. While it is inactive, tracking
#: moves φ at up to L_fφ + L_gφ q̈, so that one sample is enough to return if u⁺ exceeds L_fφ by as
#: much.
SWITCHING_GAIN = Sweep("switching-gain", _gain_spec, _gain_lines, _gain_numbers)


def _time_lines(case: Any, run: RunSummary, results: Results) -> list[dict[str, Any]]:
    """Measured and expected band of the run, and each active row of the case study."""
    bound = run.value("phi_band_bound")
    bands = {
        "band": run.value("phi_band"),
        "bound_43": bound,
        "band_expected": bound + run.Ts * run.entry_push,
    }
    rows = run.rows.values() if case.scenario == ROW_SCENARIO else ()
    return [{"row": "", **bands}, *(_row(row, run.Ts) for row in rows if row["active_time_s"] > 0)]


def _row(row: Mapping[str, Any], Ts: float) -> dict[str, Any]:
    step = Ts * row["switching_gain"]
    return {
        "row": row["constraint"],
        "bound_43": step,
        "phi_max": row["phi_max"],
        "relative_overshoot": row["phi_max"] / step,
        "longest_run": float(round(row["longest_positive_run_s"] / Ts)),
        "violation_depth": row["violation_depth"],
    }


def _time_numbers(points: Points) -> Found:
    """Growth of the bands in each scenario, and overshoot of the rows of the case study.

    The overshoot is given by its size and its duration.
    """
    numbers: dict[tuple[Any, ...], dict[Any, float]] = {}
    for scenario in BAND_SCENARIOS:
        if own := [p for p in where(points, scenario=scenario, row="") if math.isfinite(p["band"])]:
            numbers[scenario,] = _growth(own)
            numbers[scenario, "band"] = {point["Ts_ms"]: point["band"] for point in own}
    if rows := [point for point in points if point["row"]]:
        longest = max(rows, key=lambda point: float(point["longest_run"]))
        numbers[ROW_SCENARIO,] = {
            "longest_run": longest["longest_run"],
            "longest_run_ms": longest["longest_run"] * longest["Ts_ms"],
            "greatest_overshoot": greatest(rows, "relative_overshoot"),
        }
    return numbers


def _growth(points: Points) -> dict[str, float]:
    """Bands of a scenario relative to expected ones, and their growth with the sampling time."""
    names = ("Ts_ms", "band", "bound_43", "band_expected")
    Ts, band, bound, expected = (np.array([point[name] for point in points]) for name in names)
    found = {
        "least_excess": (band / bound).min(),
        "greatest_excess": (band / bound).max(),
        "greatest_share_of_expected": (band / expected).max(),
        "longest_run": greatest(points, "longest_run"),
    }
    return found | (
        {"exponent": np.polyfit(np.log(Ts), np.log(band), 1)[0]} if len(points) > 1 else {}
    )


#: The sliding-mode law with different sampling times and no other change. (43) bounds one step of
#: the constraint action alone: T_s u⁺. In the last sample before a row becomes active, tracking
#: moves φ by up to T_s (L_fφ + L_gφ q̈): this is the part of the band above zero, and the sum of
#: both is the expected band.
SAMPLING_TIME = Sweep(
    "sampling-time",
    lambda case: RunSpec(case.scenario, overrides={"sampling_time": case.Ts_ms / 1e3}),
    _time_lines,
    _time_numbers,
)


def _constraint(case: Any) -> dict[str, Any]:
    """Return the obstacle's table for a speed and a switching gain.

    The obstacle moves ``speed`` times as fast, and is at its usual place at the meeting time.
    """
    obstacle = OBSTACLES[case.scenario]
    table: dict[str, Any] = copy.deepcopy(Scenario.load(case.scenario).tables["constraints"][0])
    velocity = np.array(table["motion"]["velocity"])
    shape = table.get("curve", table)
    start = np.array(shape[obstacle["place"]]) + (1.0 - case.speed) * obstacle["meeting"] * velocity
    shape[obstacle["place"]] = start.round(6).tolist()
    table["motion"] = {"velocity": (case.speed * velocity).round(6).tolist(), "known": case.known}
    table["switching_gain"] = case.switching_gain
    return table


def _obstacle_spec(case: Any) -> RunSpec:
    duration = OBSTACLES[case.scenario]["duration"]
    return RunSpec(
        case.scenario, overrides={"constraints": [_constraint(case)], "duration": duration}
    )


def _obstacle_lines(case: Any, run: RunSummary, results: Results) -> list[dict[str, Any]]:
    """Outcome, depth to which the obstacle is entered, and K times its speed."""
    table = _constraint(case)
    factor = OBSTACLES[case.scenario]["factor"]
    depth = max((float(row["violation_depth"]) for row in run.rows.values()), default=math.nan)
    outcome = "kept" if run.value("violation_depth") <= KEPT else "violated"
    return [
        {
            "outcome": "failed" if run.ended_early else outcome,
            "depth": factor * depth,
            "depth_expected": factor
            * table["K"]
            * float(np.linalg.norm(table["motion"]["velocity"])),
        }
    ]


def _obstacle_numbers(points: Points) -> Found:
    """Bound, smallest sufficient gain and cost of an unknown motion, for each speed."""
    numbers: dict[tuple[Any, ...], dict[Any, float]] = {}
    above: Points = []
    for key, own in grouped(points, "scenario", "speed").items():
        known = where(own, known=True)
        unknown = next(
            iter(where(own, known=False)), {"switching_gain": math.nan, "depth": math.nan}
        )
        same = where(known, switching_gain=unknown["switching_gain"])
        # the run whose bound is used for the speed
        largest = max(known, key=lambda point: float(point["switching_gain"]))
        numbers[key] = {
            "bound_12": largest["bound_12"],
            "smallest_kept": smallest_gain(known, ["kept"]),
            "depth_known": same[0]["depth"] if same else math.nan,
            "depth_unknown": unknown["depth"],
            "depth_expected": largest["depth_expected"],
        }
        above += [
            p
            for p in known
            if p["switching_gain"] > largest["bound_12"] and p["outcome"] != "failed"
        ]
    return {
        **numbers,
        (): {"above_bound": len(above), "above_bound_kept": len(where(above, outcome="kept"))},
    }


#: The sliding-mode law with obstacles that move at different speeds, known and unknown. The
#: obstacle is the only constraint. It is displaced so that it is at the same place at one time
#: whatever its speed, and stands there if the speed is zero. Claim: ∂φ/∂t only changes the bound
#: (12) on u⁺ (section 5.4). A controller that takes the obstacle for static keeps σ + K (σ̇ −
#: ∂σ/∂t) ≤ 0, and so exceeds the boundary by up to K ∂σ/∂t: K times its speed.
NON_STATIC = Sweep("non-static", _obstacle_spec, _obstacle_lines, _obstacle_numbers)
