"""How large the switching gain must be, and how the chattering band shrinks with the sampling time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from ...comparisons.runs.spec import RunSpec
from . import points as data
from .points import Numbers, Points
from .study import Sweep
from .summary import RunSummary

OUTCOMES = ("failed", "violated", "beyond band", "band, not sliding", "sliding")  #: Of a run, the worst first.
#: What can be required of a switching gain, and the outcome that is enough for it.
ENOUGH = {"allowed": "beyond band", "in_band": "band, not sliding", "sliding": "sliding"}
BAND_SCENARIOS = ("example-2d-fov", "example-2d-fast-high-gain")
ROW_SCENARIO = "case-study-6r"


class SwitchingGain(Sweep):
    """The first example with ever faster motion, and a grid of switching gains for each speed.

    Three things can be required of a switching gain, each more than the one before: that σ ≤ 0 holds, that φ stays
    within the band (43), and that φ is back below zero after one sample, as in a sliding mode. Condition (12) promises
    that φ falls while its row is active. While it is inactive, tracking moves φ at up to L_fφ + L_gφ q̈, so that one
    sample is enough to come back if u⁺ exceeds L_fφ by as much.
    """

    name = "switching-gain"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case: K_p(0) [1/s²], and u⁺."""
        overrides = {"task.Kp0": case.Kp0, "constraints.0.switching_gain": case.switching_gain}
        return RunSpec("example-2d-fov", overrides=overrides)

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """Its outcome, the band, and what u⁺ must exceed to be back after one sample."""
        band = run.Ts * case.switching_gain
        outcome = "sliding" if run.longest_run <= 1 else "band, not sliding"
        if run.ended_early:
            outcome = "failed"
        elif run.value("violation_depth") > 0.0:
            outcome = "violated"
        elif run.phi_max > band:
            outcome = "beyond band"
        bound = run.needed_gain + max(run.entry_push, 0.0)
        return {"outcome": outcome, "band_bound": band, "bound_sampled": bound}

    def numbers(self, points: Points) -> Numbers:
        """For every speed the bounds and the smallest gains that are enough; and how many runs above (12) are so."""
        numbers: Numbers = {}
        for Kp0, own in data.grouped(points, "Kp0").items():
            numbers |= data.keyed({name: _bound(own, name) for name in ("bound_12", "bound_sampled")}, Kp0)
            for name, outcome in ENOUGH.items():
                smallest = data.smallest_enough(own, "switching_gain", partial(_reaches, outcome=outcome))
                numbers[Kp0, f"smallest_{name}"] = smallest
        # along its own motion; without an active row there is no bound to exceed
        below = [point for point in points if point["switching_gain"] <= point["bound_12"]]
        above = [point for point in points if point not in below]
        for side, own in (("above_bound", above), ("below_bound", below)):
            count = {f"{side}_{name}": sum(_reaches(p, outcome) for p in own) for name, outcome in ENOUGH.items()}
            numbers |= data.keyed({side: len(own), **count})
        return numbers


def _reaches(point: Mapping[str, Any], outcome: str) -> bool:
    """Whether a run's outcome is this one or better."""
    return OUTCOMES.index(point["outcome"]) >= OUTCOMES.index(outcome)


def _bound(points: Points, column: str) -> float:
    """Greatest value along the runs that slide, or along the one with the largest gain if none does."""
    sliding = data.where(points, outcome="sliding")
    return data.greatest(sliding or [max(points, key=lambda point: point["switching_gain"])], column)


class SamplingTime(Sweep):
    """The sliding-mode law with different sampling times, nothing else changed.

    (43) bounds one step of the constraint action alone: T_s u⁺. In the last sample before a row becomes active,
    tracking moves φ by up to T_s (L_fφ + L_gφ q̈): that is what the band has above zero, and the sum is what to expect.
    """

    name = "sampling-time"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        return RunSpec(case.scenario, overrides={"sampling_time": case.Ts_ms / 1e3})

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """Its band and what is expected of it."""
        bound = run.value("phi_band_bound")
        bands = {"band": run.value("phi_band"), "bound_43": bound, "band_expected": bound + run.Ts * run.entry_push}
        return {"row": "", **bands}

    def points(self, results: Mapping[Any, RunSummary]) -> Points:
        """A line of data for each run, and for each row of the case study that was active."""
        points: Points = []
        for case, run in results.items():
            points.append(self.point(case, run, self.line(case, run, results)))
            if case.scenario == ROW_SCENARIO:
                rows = [row for row in run.rows.values() if row["active_time_s"] > 0]
                points += [self.point(case, run, _row(row, run.Ts)) for row in rows]
        return points

    def numbers(self, points: Points) -> Numbers:
        """How bands grow, for each scenario; how far and how long the rows of the case study are above zero."""
        numbers: Numbers = {}
        for scenario in BAND_SCENARIOS:
            own = [p for p in data.where(points, scenario=scenario, row="") if math.isfinite(p["band"])]
            if own:
                numbers |= data.keyed(_growth(own), scenario)
                numbers |= {(scenario, "band", point["Ts_ms"]): point["band"] for point in own}
        if rows := [point for point in points if point["row"]]:
            longest = max(rows, key=lambda point: point["longest_run"])
            found = {"longest_run": longest["longest_run"]}
            found["longest_run_ms"] = longest["longest_run"] * longest["Ts_ms"]
            found["greatest_overshoot"] = data.greatest(rows, "relative_overshoot")
            numbers |= data.keyed(found, ROW_SCENARIO)
        return numbers


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


def _growth(points: Points) -> dict[str, float]:
    """The bands of a scenario beside what is expected of them, and how they grow with the sampling time."""
    names = ("Ts_ms", "band", "bound_43", "band_expected")
    Ts, band, bound, expected = (np.array([point[name] for point in points]) for name in names)
    found = {
        "least_excess": (band / bound).min(),
        "greatest_excess": (band / bound).max(),
        "greatest_share_of_expected": (band / expected).max(),
        "longest_run": data.greatest(points, "longest_run"),
    }
    return found | ({"exponent": np.polyfit(np.log(Ts), np.log(band), 1)[0]} if len(points) > 1 else {})
