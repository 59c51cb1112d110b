"""What it takes to keep clear of obstacles that move, and what it costs not to know that they do."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from ...reports.plots import INK, REFERENCE, Sheet, line, logarithmic
from ...scenarios import Scenario
from .drawing import by_outcome, entry, joined, outcome_entries, scenario_panels
from .points import Measured, Numbers, Points, grouped, smallest_enough, under, where
from .study import Study, StudyResult, begun
from .summary import RunSummary

KEPT = 0.005
"""Depth, as a fraction of the obstacle's radius, up to which its boundary counts as kept: about what it moves by in a
sampling period."""

LOOK = {
    "kept": ("#0072B2", "o", "boundary kept"),
    "violated": ("#B2182B", "X", "boundary violated"),
    "failed": ("#000000", "x", "failed"),
}


@dataclass(frozen=True)
class Obstacle:
    """A shipped scenario's moving obstacle, its first constraint, and how it is varied.

    Attributes
    ----------
    title, unit
        For the figure; of lengths.
    place
        Where its table says where it starts.
    meeting
        Time at which it is at the same place whatever its speed [s].
    duration
        Of the runs [s].
    speeds
        Factors of its velocity.
    gains
        u⁺ in units of φ per second.
    """

    title: str
    unit: str
    place: tuple[str, ...]
    meeting: float
    duration: float
    speeds: tuple[float, ...]
    gains: tuple[float, ...]

    def constraint(self, scenario: str, speed: float, gain: float, *, known: bool) -> dict[str, Any]:
        """The obstacle's table: it moves ``speed`` times as fast, and is at its usual place at the meeting."""
        table: dict[str, Any] = copy.deepcopy(Scenario.load(scenario).tables["constraints"][0])
        velocity = np.array(table["motion"]["velocity"])
        holder = table
        for key in self.place[:-1]:
            holder = holder[key]
        start = np.array(holder[self.place[-1]]) + (1.0 - speed) * self.meeting * velocity
        holder[self.place[-1]] = start.round(6).tolist()
        table["motion"] = {"velocity": (speed * velocity).round(6).tolist(), "known": known}
        table["switching_gain"] = gain
        return table


OBSTACLES = {
    "moving-sphere": Obstacle(
        "moving sphere", "mm", ("centre",), 1.3, 3.0, (0.0, 0.5, 1.0, 2.0), (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 1.0)
    ),
    "moving-occluder": Obstacle(
        "moving occluder",
        "px",
        ("curve", "centre_px"),
        1.6,
        5.2,
        (0.0, 0.5, 1.0),
        (0.25, 0.5, 1.0, 2.0, 4.0, 10.0),
    ),
}
SMALL = {"moving-sphere": ((0.0, 1.0), (0.0125, 1.0))}
"""Scenarios, speeds and gains of the small form; the shipped gain is among the gains of both forms."""


class Case(NamedTuple):
    """A scenario, the obstacle's speed as a factor, u⁺, and whether its motion is known."""

    scenario: str
    speed: float
    switching_gain: float
    known: bool


class NonStatic(Study):
    """The sliding-mode law with obstacles that move at different speeds, known and unknown.

    The obstacle is the only constraint. It is displaced so that it is at the same place at one time whatever its speed,
    and stands there if the speed is zero. Claim: ∂φ/∂t only changes the bound (12) on u⁺ (section 5.4). A controller
    that takes the obstacle for static keeps σ + K (σ̇ − ∂σ/∂t) ≤ 0, and so goes up to K ∂σ/∂t too far: K times its
    speed.
    """

    name = "non-static"
    title = "Obstacles that move"
    question = "Does the motion of obstacles change nothing but the bound on the switching gain?"
    claims = (11,)
    drift_noted = True
    figure_caption = (
        "Top: every marker is a run with an obstacle of known velocity; lines: the bound (12), with ∂φ/∂t in L_fφ, "
        "measured in the run with the largest u⁺. Bottom: how deep the obstacle is entered when its velocity is known "
        "and when it is not, with the shipped u⁺; line: K times its speed."
    )

    def runs(self, *, small: bool = False) -> dict[Case, RunSpec]:
        """Every speed with every gain, and with the shipped gain and unknown velocity."""
        runs = {}
        for scenario, obstacle in OBSTACLES.items():
            if small and scenario not in SMALL:
                continue
            speeds, gains = SMALL[scenario] if small else (obstacle.speeds, obstacle.gains)
            shipped = float(Scenario.load(scenario).tables["constraints"][0]["switching_gain"])
            for speed in speeds:
                cases = [(gain, True) for gain in gains] + [(shipped, False)] * (speed > 0.0)
                for gain, known in cases:
                    table = obstacle.constraint(scenario, speed, gain, known=known)
                    overrides = {"constraints": [table], "duration": obstacle.duration}
                    runs[Case(scenario, speed, gain, known)] = RunSpec(scenario, overrides=overrides)
        return runs

    def measure(self, results: Mapping[Case, RunSummary]) -> Measured:
        """Depth of every run; for every speed the bound, the smallest gain that is enough, the cost of not knowing."""
        points = [_point(case, run) for case, run in results.items()]
        numbers: Numbers = {}
        sentences = []
        above: Points = []
        for scenario, at_all in grouped(points, "scenario").items():
            unit, parts, costs = OBSTACLES[scenario].unit, [], []
            for speed, own in grouped(at_all, "speed").items():
                found = _findings(own)
                numbers |= under(found, scenario, speed)
                above += [p for p in own if p["known"] and p["switching_gain"] > found["bound_12"]]
                shown = {name: number(value) for name, value in found.items()}
                times = f"at {speed:g} times its speed" if speed else "if it stands still"
                parts.append(f"{shown['smallest_kept']} {times} (bound {shown['bound_12']})")
                if speed > 0.0:
                    costs.append(
                        f"{shown['depth_unknown']} {unit} {times}, where K times the speed is "
                        f"{shown['depth_expected']} {unit} and {shown['depth_known']} {unit} are entered if it is known"
                    )
            sentences.append(
                f"{OBSTACLES[scenario].title.capitalize()}: the smallest u⁺ tried from which on the boundary is kept "
                f"is {'; '.join(parts)}."
            )
            if costs:
                sentences.append(f"Taken for static, it is entered by {'; '.join(costs)}.")
        above = [point for point in above if point["outcome"] != "failed"]
        kept = sum(point["outcome"] == "kept" for point in above)
        sentences.append(f"Of {len(above)} runs with u⁺ above the bound (12) of their speed, {kept} keep the boundary.")
        return points, numbers | under({"above_bound": len(above), "above_bound_kept": kept}), sentences

    def figure(self, result: StudyResult) -> Sheet:
        """One column per obstacle; gains above, depths below."""
        scenarios = list(grouped(result.points, "scenario"))
        known, unknown = entry("velocity known", "#0072B2", "o"), entry("velocity unknown", "#D55E00", "s")
        marks = outcome_entries([*result.points, {"outcome": "kept"}, {"outcome": "violated"}], LOOK)
        sheet = Sheet(left=0.8)
        sheet.legend([*marks, entry("bound (12)", INK), known, unknown, line("K times the speed", **REFERENCE)])
        below = "speed of the obstacle, relative to the scenario's"
        panels = scenario_panels(sheet, scenarios, ("", ""), below, height=2.0, gap=0.9)
        for scenario in scenarios:
            own = where(result.points, scenario=scenario)
            _gains(panels[0, scenario], own, scenario, result.numbers)
            _depths(panels[1, scenario], own, scenario)
        return sheet


def _point(case: Case, run: RunSummary) -> dict[str, Any]:
    obstacle = OBSTACLES[case.scenario]
    table = obstacle.constraint(case.scenario, case.speed, case.switching_gain, known=case.known)
    factor = 1e3 if obstacle.unit == "mm" else 1.0
    depth = max((float(row["violation_depth"]) for row in run.rows.values()), default=math.nan)
    outcome = "kept" if run.value("violation_depth") <= KEPT else "violated"
    return {
        **begun(case, run),
        "outcome": "failed" if run.ended_early else outcome,
        "depth": factor * depth,
        "depth_expected": factor * table["K"] * float(np.linalg.norm(table["motion"]["velocity"])),
        "phi_max": run.phi_max,
        "longest_run": run.longest_run,
        "bound_12": run.needed_gain,
    }


def _findings(points: Points) -> dict[str, float]:
    """What the runs of one obstacle at one speed say; the bound (12) is that of the known run with the largest gain."""
    known = [point for point in points if point["known"]]
    unknown = next((point for point in points if not point["known"]), None)
    same = [point for point in known if unknown is not None and point["switching_gain"] == unknown["switching_gain"]]
    largest = max(known, key=lambda point: float(point["switching_gain"]))
    return {
        "bound_12": largest["bound_12"],
        "smallest_kept": smallest_enough(known, "switching_gain", lambda point: point["outcome"] == "kept"),
        "depth_known": same[0]["depth"] if same else math.nan,
        "depth_unknown": math.nan if unknown is None else unknown["depth"],
        "depth_expected": largest["depth_expected"],
    }


def _gains(ax: Any, points: Points, scenario: str, numbers: Numbers) -> None:
    by_outcome(ax, where(points, known=True), "speed", "switching_gain", LOOK)
    speeds = sorted({point["speed"] for point in points})
    bounds = [numbers.get((scenario, speed, "bound_12"), math.nan) for speed in speeds]
    ax.plot(speeds, bounds, color=INK, linewidth=1.8, zorder=4)
    logarithmic(ax.yaxis, sorted({point["switching_gain"] for point in points}))
    ax.set_title(OBSTACLES[scenario].title)
    ax.set_ylabel(f"u⁺ [{'m/s' if OBSTACLES[scenario].unit == 'mm' else '1/s'}]")
    ax.set_xlim(*_widened(speeds))


def _depths(ax: Any, points: Points, scenario: str) -> None:
    unknown = sorted(where(points, known=False), key=lambda point: point["speed"])
    tried = {(point["speed"], point["switching_gain"]) for point in unknown}
    known = [p for p in where(points, known=True) if (p["speed"], p["switching_gain"]) in tried]
    joined(ax, unknown, "speed", "depth", "#D55E00", "s")
    joined(ax, known, "speed", "depth", "#0072B2", "o")
    joined(ax, [{"speed": 0.0, "depth_expected": 0.0}, *unknown], "speed", "depth_expected", INK, **REFERENCE)
    ax.set_xlim(*_widened([point["speed"] for point in points]))
    ax.set_ylabel(f"depth of violation [{OBSTACLES[scenario].unit}]")


def _widened(values: Sequence[float]) -> tuple[float, float]:
    gap = 0.08 * (max(values) - min(values)) or 0.1
    return min(values) - gap, max(values) + gap
