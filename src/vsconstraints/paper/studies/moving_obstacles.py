"""What it takes to keep clear of obstacles that move, and what it costs not to know that they do."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import INK, REFERENCE, Sheet, line, logarithmic
from ...scenarios import Scenario
from . import drawing as draw
from . import study
from .study import Numbers, Points, StudyResult, Sweep
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
        overrides = {"constraints": [self._constraint(case)], "duration": self._obstacle(case.scenario)["duration"]}
        return RunSpec(case.scenario, overrides=overrides)

    def runs(self, *, small: bool = False) -> dict[Any, RunSpec]:
        """Every speed with every gain, and with the shipped gain and unknown velocity."""
        cases = []
        for table in self.table["small" if small else "runs"]:
            scenario = table["scenario"]
            shipped = float(Scenario.load(scenario).tables["constraints"][0]["switching_gain"])
            for speed in table["speed"]:
                cases += [self.Case(scenario, speed, gain, True) for gain in table["switching_gain"]]
                cases += [self.Case(scenario, speed, shipped, False)] * (speed > 0.0)
        return {case: self.spec(case) for case in cases}

    def _obstacle(self, scenario: str) -> dict[str, Any]:
        obstacle: dict[str, Any] = self.table["obstacles"][scenario]
        return obstacle

    def _constraint(self, case: Any) -> dict[str, Any]:
        """The obstacle's table: it moves ``speed`` times as fast, and is at its usual place at the meeting time."""
        obstacle = self._obstacle(case.scenario)
        table: dict[str, Any] = copy.deepcopy(Scenario.load(case.scenario).tables["constraints"][0])
        velocity = np.array(table["motion"]["velocity"])
        shape = table.get("curve", table)
        start = np.array(shape[obstacle["place"]]) + (1.0 - case.speed) * obstacle["meeting"] * velocity
        shape[obstacle["place"]] = start.round(6).tolist()
        table["motion"] = {"velocity": (case.speed * velocity).round(6).tolist(), "known": case.known}
        table["switching_gain"] = case.switching_gain
        return table

    def measure(self, results: Mapping[Any, RunSummary]) -> tuple[Points, Numbers, list[str]]:
        """Depth of every run; for every speed the bound, the smallest gain that is enough, the cost of not knowing."""
        points = [self._point(case, run) for case, run in results.items()]
        numbers: Numbers = {}
        sentences = []
        above: Points = []
        for scenario, at_all in study.grouped(points, "scenario").items():
            obstacle, gains, costs = self._obstacle(scenario), [], []
            for speed, own in study.grouped(at_all, "speed").items():
                found = _at_speed(own)
                numbers |= study.keyed(found, scenario, speed)
                above += [p for p in study.where(own, known=True) if p["switching_gain"] > found["bound_12"]]
                times = f"at {speed:g} times its speed" if speed else "if it stands still"
                gains.append(self.sentence("gain", times=times, **found))
                if speed > 0.0:
                    costs.append(self.sentence("cost", times=times, unit=obstacle["unit"], **found))
            title = obstacle["title"].capitalize()
            sentences.append(self.sentence("gains", title=title, gains="; ".join(gains)))
            sentences += [self.sentence("costs", costs="; ".join(costs))] if costs else []
        above = [point for point in above if point["outcome"] != "failed"]
        count = {"above_bound": len(above), "above_bound_kept": len(study.where(above, outcome="kept"))}
        return points, numbers | study.keyed(count), [*sentences, self.sentence("bound", **count)]

    def _point(self, case: Any, run: RunSummary) -> dict[str, Any]:
        table, factor = self._constraint(case), 1e3 if self._obstacle(case.scenario)["unit"] == "mm" else 1.0
        depth = max((float(row["violation_depth"]) for row in run.rows.values()), default=math.nan)
        outcome = "kept" if run.value("violation_depth") <= KEPT else "violated"
        own = {
            "outcome": "failed" if run.ended_early else outcome,
            "depth": factor * depth,
            "depth_expected": factor * table["K"] * float(np.linalg.norm(table["motion"]["velocity"])),
        }
        return study.begun(case, run) | own | study.columns(run, "phi_max", "longest_run", "bound_12")

    def figure(self, result: StudyResult) -> Sheet:
        """One column per obstacle; gains above, depths below."""
        outcomes = self.table["outcomes"]
        scenarios = list(study.grouped(result.points, "scenario"))
        known, unknown = draw.entry("velocity known", "#0072B2", "o"), draw.entry("velocity unknown", "#D55E00", "s")
        marks = draw.outcome_entries([*result.points, {"outcome": "kept"}, {"outcome": "violated"}], outcomes)
        entries = [*marks, draw.entry("bound (12)", INK), known, unknown, line("K times the speed", **REFERENCE)]
        sheet, panels = draw.scenario_grid(self.table, result.points, entries)
        for scenario in scenarios:
            own, obstacle = study.where(result.points, scenario=scenario), self._obstacle(scenario)
            speeds = sorted(study.grouped(own, "speed"))
            gap = 0.08 * (speeds[-1] - speeds[0]) or 0.1
            upper, lower = panels["switching_gain", scenario], panels["depth", scenario]
            for ax in (upper, lower):
                ax.set_xlim(speeds[0] - gap, speeds[-1] + gap)
            upper.set_title(obstacle["title"])
            upper.set_ylabel(f"u⁺ [{'m/s' if obstacle['unit'] == 'mm' else '1/s'}]")
            lower.set_ylabel(f"depth of violation [{obstacle['unit']}]")
            bounds = [result.numbers.get((scenario, speed, "bound_12"), math.nan) for speed in speeds]
            draw.by_outcome(upper, study.where(own, known=True), "speed", "switching_gain", outcomes)
            upper.plot(speeds, bounds, color=INK, linewidth=1.8, zorder=4)
            logarithmic(upper.yaxis, sorted(study.grouped(own, "switching_gain")))
            _depths(lower, own)
        return sheet


def _at_speed(points: Points) -> dict[str, float]:
    """Numbers about one obstacle at one speed; the bound (12) is that of the known run with the largest gain."""
    known = study.where(points, known=True)
    unknown = next(iter(study.where(points, known=False)), {"switching_gain": math.nan, "depth": math.nan})
    same = study.where(known, switching_gain=unknown["switching_gain"])
    largest = max(known, key=lambda point: float(point["switching_gain"]))
    return {
        "bound_12": largest["bound_12"],
        "smallest_kept": study.smallest_enough(known, "switching_gain", lambda point: point["outcome"] == "kept"),
        "depth_known": same[0]["depth"] if same else math.nan,
        "depth_unknown": unknown["depth"],
        "depth_expected": largest["depth_expected"],
    }


def _depths(ax: Any, points: Points) -> None:
    unknown = sorted(study.where(points, known=False), key=lambda point: point["speed"])
    tried = {(point["speed"], point["switching_gain"]) for point in unknown}
    known = [p for p in study.where(points, known=True) if (p["speed"], p["switching_gain"]) in tried]
    draw.joined(ax, unknown, "speed", "depth", "#D55E00", "s")
    draw.joined(ax, known, "speed", "depth", "#0072B2", "o")
    draw.joined(ax, [{"speed": 0.0, "depth_expected": 0.0}, *unknown], "speed", "depth_expected", INK, **REFERENCE)
