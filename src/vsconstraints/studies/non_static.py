"""What it takes to keep clear of obstacles that move, and what it costs not to know that they do."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..reports.numbers import number
from ..runs.spec import RunSpec
from ..scenarios import Scenario
from .panels import INK, REFERENCE, Grid, handle, logarithmic
from .points import Measured, Numbers, Points, grouped, smallest_enough, under
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

    def draw(self, result: StudyResult, path: Path) -> None:
        """One column per obstacle; gains above, depths below."""
        scenarios = list(dict.fromkeys(point["scenario"] for point in result.points))
        with Grid(path, 2, len(scenarios), height=2.0, legend=0.45, left=0.8, gap=0.9) as grid:
            for j, scenario in enumerate(scenarios):
                own = [point for point in result.points if point["scenario"] == scenario]
                _gains(grid.axes[0][j], own, scenario, result.numbers)
                _depths(grid.axes[1][j], own, scenario)
            marks = [handle(label, colour, marker, linestyle="none") for colour, marker, label in LOOK.values()]
            grid.legend(
                [
                    *marks[: 3 if any(point["outcome"] == "failed" for point in result.points) else 2],
                    handle("bound (12)", INK),
                    handle("velocity known", "#0072B2", "o"),
                    handle("velocity unknown", "#D55E00", "s"),
                    handle("K times the speed", INK, linestyle=REFERENCE["linestyle"]),
                ],
                3,
            )


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


def _gains(ax: Any, points: list[dict[str, Any]], scenario: str, numbers: Numbers) -> None:
    for name, (colour, marker, _) in LOOK.items():
        own = [point for point in points if point["known"] and point["outcome"] == name]
        ax.plot(
            [point["speed"] for point in own],
            [point["switching_gain"] for point in own],
            linestyle="none",
            marker=marker,
            color=colour,
            markersize=7.0,
            markeredgecolor=INK if name != "failed" else colour,
            markeredgewidth=0.5,
            zorder=3,
        )
    speeds = sorted({point["speed"] for point in points})
    bounds = [numbers.get((scenario, speed, "bound_12"), math.nan) for speed in speeds]
    ax.plot(speeds, bounds, color=INK, linewidth=1.8, zorder=4)
    logarithmic(ax.yaxis, sorted({point["switching_gain"] for point in points}))
    ax.set_title(OBSTACLES[scenario].title)
    ax.set_ylabel(f"u⁺ [{'m/s' if OBSTACLES[scenario].unit == 'mm' else '1/s'}]")
    ax.set_xlim(*_widened(speeds))
    ax.tick_params(labelbottom=False)


def _depths(ax: Any, points: list[dict[str, Any]], scenario: str) -> None:
    unknown = sorted((point for point in points if not point["known"]), key=lambda point: point["speed"])
    for colour, marker, own in (
        ("#D55E00", "s", unknown),
        ("#0072B2", "o", [p for p in points if p["known"] and any(_same(p, other) for other in unknown)]),
    ):
        ax.plot([p["speed"] for p in own], [p["depth"] for p in own], color=colour, marker=marker, markersize=5.0)
    ax.plot([0.0] + [p["speed"] for p in unknown], [0.0] + [p["depth_expected"] for p in unknown], **REFERENCE)
    ax.set_xlim(*_widened([point["speed"] for point in points]))
    ax.set_xlabel("speed of the obstacle, relative to the scenario's")
    ax.set_ylabel(f"depth of violation [{OBSTACLES[scenario].unit}]")


def _same(point: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    return bool((point["speed"], point["switching_gain"]) == (other["speed"], other["switching_gain"]))


def _widened(values: Sequence[float]) -> tuple[float, float]:
    gap = 0.08 * (max(values) - min(values)) or 0.1
    return min(values) - gap, max(values) + gap
