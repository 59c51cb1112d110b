"""Study of obstacles that move."""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from ...reports.plots import Sheet, logarithmic
from ...scenarios import Scenario
from .drawing import DASHED, SYMBOLS, Measure, add_panels, draw_line, style_of
from .study import Found, Results, Study, StudyResult
from .summary import RunSummary
from .tables import (
    Numbers,
    Points,
    about,
    grouped,
    numbers_by,
    scenario_title,
    smallest_gain,
    where,
)

#: Depth, as a fraction of the obstacle's radius, up to which its boundary counts as kept: about
#: what it moves by in a sampling period.
KEPT = 0.005


class ObstacleCase(NamedTuple):
    """Scenario, factor on the obstacle's velocity, u⁺ [φ per second], and a flag.

    The flag is True if the controller knows the velocity.
    """

    scenario: str
    speed: float
    switching_gain: float
    known: bool


class Obstacle(NamedTuple):
    """Obstacle of a scenario, and the runs with it."""

    place: str  #: Key of its table that says where it starts.
    meeting: float  #: Time at which it is at the same place whatever its speed [s].
    duration: float  #: Duration of the runs [s].
    unit: str  #: Unit of depths.
    gain_unit: str  #: Unit of u⁺.
    factor: float  #: Factor that converts depths into this unit.
    gain: float  #: u⁺ of the scenario, with which the velocity is not known.
    speeds: tuple[float, ...]  #: Factors on its velocity.
    gains: tuple[float, ...]  #: u⁺ with which the velocity is known.


OBSTACLES = {
    "moving-sphere": Obstacle(
        place="centre",
        meeting=1.3,
        duration=3.0,
        unit="mm",
        gain_unit="m/s",
        factor=1e3,
        gain=1.0,
        speeds=(0.0, 0.5, 1.0, 2.0),
        gains=(0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 1.0),
    ),
    "moving-occluder": Obstacle(
        place="centre_px",
        meeting=1.6,
        duration=5.2,
        unit="px",
        gain_unit="1/s",
        factor=1.0,
        gain=10.0,
        speeds=(0.0, 0.5, 1.0),
        gains=(0.25, 0.5, 1.0, 2.0, 4.0, 10.0),
    ),
}
SMALL_OBSTACLES = {
    "moving-sphere": OBSTACLES["moving-sphere"]._replace(speeds=(0.0, 1.0), gains=(0.0125, 1.0))
}

#: Styles of outcomes and of depths.
OUTCOMES = {
    "kept": style_of("boundary kept", "#0072B2", marker="o"),
    "violated": style_of("boundary violated", "#B2182B", marker="X"),
    "failed": style_of("failed", "#000000", marker="x"),
}
BOUND = style_of("bound (12)", linewidth=1.8, zorder=4)
DEPTHS = {
    "depth_known": style_of("velocity known", color="#0072B2", marker="o"),
    "depth_unknown": style_of("velocity unknown", color="#D55E00", marker="s"),
    "depth_expected": style_of("K times the speed", **DASHED),
}
MEASURES = {"switching_gain": Measure(), "depth": Measure(linear=True)}


class NonStatic(Study):
    """The sliding-mode law with obstacles that move at different speeds, known and unknown.

    The obstacle is the only constraint. It is displaced so that it is at the same place at one time
    whatever its speed, and stands there if the speed is zero. Claim: ∂φ/∂t only changes the bound
    (12) on u⁺ (section 5.4). A controller that takes the obstacle for static keeps
    σ + K (σ̇ − ∂σ/∂t) ≤ 0, and so exceeds the boundary by up to K ∂σ/∂t: K times its speed.
    """

    name = "non-static"
    title = "Obstacles that move"
    question = "Does the motion of obstacles change nothing but the bound on the switching gain?"
    claims = (11,)
    columns = (
        "status",
        "reason",
        "outcome",
        "depth",
        "depth_expected",
        "phi_max",
        "longest_run",
        "bound_12",
    )
    drift_noted = True
    figure_caption = (
        "Top: every marker is a run with an obstacle of known velocity; lines: the bound (12), "
        "with ∂φ/∂t in L_fφ, measured in the run with the largest u⁺. Bottom: how deep the "
        "obstacle is entered when its velocity is known and when it is not, with the shipped u⁺; "
        "line: K times its speed."
    )

    def runs(self, *, small: bool = False) -> dict[ObstacleCase, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""
        cases = []
        for scenario, obstacle in (SMALL_OBSTACLES if small else OBSTACLES).items():
            for speed in obstacle.speeds:
                cases += [ObstacleCase(scenario, speed, gain, True) for gain in obstacle.gains]
                if speed:
                    cases.append(ObstacleCase(scenario, speed, obstacle.gain, False))
        return {case: with_obstacle(case) for case in cases}

    def lines(self, case: ObstacleCase, run: RunSummary, results: Results) -> Points:
        """Outcome, depth to which the obstacle is entered, and K times its speed."""
        table = constraint_table(case)
        factor = OBSTACLES[case.scenario].factor
        depth = max((float(row["violation_depth"]) for row in run.rows.values()), default=math.nan)
        outcome = "kept" if run.value("violation_depth") <= KEPT else "violated"
        speed = float(np.linalg.norm(table["motion"]["velocity"]))
        return [
            {
                "outcome": "failed" if run.ended_early else outcome,
                "depth": factor * depth,
                "depth_expected": factor * table["K"] * speed,
            }
        ]

    def numbers(self, points: Points) -> Found:
        """Bound, smallest sufficient gain and cost of an unknown motion, for each speed."""
        numbers: dict[tuple[Any, ...], dict[Any, float]] = {}
        above: Points = []
        missing = {"switching_gain": math.nan, "depth": math.nan}
        for key, of_speed in grouped(points, "scenario", "speed").items():
            known = where(of_speed, known=True)
            unknown = next(iter(where(of_speed, known=False)), missing)
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
                point
                for point in known
                if point["switching_gain"] > largest["bound_12"] and point["outcome"] != "failed"
            ]
        kept = where(above, outcome="kept")
        numbers[()] = {"above_bound": len(above), "above_bound_kept": len(kept)}
        return numbers

    def sentences(self, points: Points, numbers: Numbers) -> list[str]:
        """Return the sentences of the result."""
        sentences = []
        for scenario, of_scenario in grouped(points, "scenario").items():
            texts = []
            for speed in grouped(of_scenario, "speed"):
                of = about(numbers, scenario, speed)
                when = f"at {speed:g} times its speed" if speed else "if it stands still"
                bound = number(of["bound_12"])
                texts.append(f"{number(of['smallest_kept'])} {when} (bound {bound})")
            sentences.append(
                f"{scenario_title(scenario).capitalize()}: the smallest u⁺ tried from which on "
                f"the boundary is kept is {'; '.join(texts)}."
            )
            if unknown := where(of_scenario, known=False):
                texts = [
                    entered(about(numbers, scenario, speed), speed, OBSTACLES[scenario].unit)
                    for speed in grouped(unknown, "speed")
                ]
                sentences.append(f"Taken for static, it is entered by {'; '.join(texts)}.")
        of = about(numbers)
        sentences.append(
            f"Of {int(of['above_bound'])} runs with u⁺ above the bound (12) of their speed, "
            f"{int(of['above_bound_kept'])} keep the boundary."
        )
        return sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Draw outcomes over speed and gain with the bound (12), and depths over the speed."""
        points = list(result.points)
        known = where(points, known=True)
        outcomes = [outcome for outcome in OUTCOMES if where(known, outcome=outcome)]
        styles = {outcome: OUTCOMES[outcome] | SYMBOLS for outcome in outcomes}
        sheet = Sheet(left=0.8)
        sheet.legend([*styles.values(), BOUND, *DEPTHS.values()])
        below = "speed of the obstacle, relative to the scenario's"
        for panel in add_panels(sheet, points, MEASURES, below, height=2.0, gap=0.9):
            obstacle = OBSTACLES[panel.scenario]
            by_speed = numbers_by(result.numbers, "speed", panel.scenario)
            panel.ax.margins(x=0.08)
            if panel.measure == "depth":
                panel.ax.set_ylabel(f"depth of violation [{obstacle.unit}]")
                for depth, style in DEPTHS.items():
                    draw_line(panel.ax, by_speed, "speed", depth, style)
                continue
            for outcome, style in styles.items():
                runs = where(panel.points, known=True, outcome=outcome)
                draw_line(panel.ax, runs, "speed", "switching_gain", style)
            draw_line(panel.ax, by_speed, "speed", "bound_12", BOUND)
            panel.ax.set_ylabel(f"u⁺ [{obstacle.gain_unit}]")
            logarithmic(panel.ax.yaxis, obstacle.gains)
        return sheet


def entered(of: dict[str | float, float], speed: float, unit: str) -> str:
    """Words for the depths to which an obstacle of a speed is entered."""
    return (
        f"{number(of['depth_unknown'])} {unit} at {speed:g} times its speed, where K times the "
        f"speed is {number(of['depth_expected'])} {unit} and {number(of['depth_known'])} {unit} "
        "are entered if it is known"
    )


def constraint_table(case: ObstacleCase) -> dict[str, Any]:
    """Return the obstacle's table for a speed and a switching gain.

    The obstacle moves ``speed`` times as fast, and is at its usual place at the meeting time.
    """
    obstacle = OBSTACLES[case.scenario]
    scenario = Scenario.load(case.scenario)
    table: dict[str, Any] = copy.deepcopy(scenario.tables["constraints"][0])
    usual_velocity = np.array(table["motion"]["velocity"])
    shape = table.get("curve", table)
    usual_start = np.array(shape[obstacle.place])
    start = usual_start + (1.0 - case.speed) * obstacle.meeting * usual_velocity
    velocity = case.speed * usual_velocity
    shape[obstacle.place] = start.round(6).tolist()
    table["motion"] = {"velocity": velocity.round(6).tolist(), "known": case.known}
    table["switching_gain"] = case.switching_gain
    return table


def with_obstacle(case: ObstacleCase) -> RunSpec:
    """Return the run with the obstacle as the only constraint."""
    duration = OBSTACLES[case.scenario].duration
    overrides = {"constraints": [constraint_table(case)], "duration": duration}
    return RunSpec(case.scenario, overrides=overrides)
