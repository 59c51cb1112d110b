"""Disturbances of actuation, measurement and model, for every controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import DASH, number
from ...reports.plots import INK, WIDTH, Sheet
from ...reports.plots.style import FAINT
from ...scenarios import Scenario
from .laws import LAWS
from .points import Measured, Numbers, Points, ended_early, greatest, grouped, through, under, where
from .study import Study, StudyResult, begun
from .summary import RunSummary

SCENARIO = "example-2d-fov"
OVERRIDES = {"task.Kp0": 40.0, "constraints.0.switching_gain": 20.0, "duration": 5.0}
"""The first example, faster, with the switching gain that this needs: the runs are shorter."""

DISTURBANCES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "gradient error c_e (49)": ({"gradient_error": 0.3}, {"gradient_error": 0.6}),
    "acceleration d_c [rad/s²]": ({"acceleration": [0.02]}, {"acceleration": [0.2]}),
    "acceleration noise [rad/s²]": ({"acceleration_noise": 0.1}, {"acceleration_noise": 1.0}),
    "actuator lag C [s]": ({"time_constant": 0.02}, {"time_constant": 0.1}),
    "pixel noise [px]": ({"pixel_noise": 0.5}, {"pixel_noise": 2.0}),
    "depth factor": ({"depth_factor": 1.1}, {"depth_factor": 1.5}),
    "focal factor": ({"focal_factor": [1.02, 1.02]}, {"focal_factor": [1.1, 1.1]}),
    "principal point error [px]": ({"principal_point_error": [2.0, 2.0]}, {"principal_point_error": [10.0, 10.0]}),
    "image period [s]": ({"image_period": 0.05}, {"image_period": 0.2}),
    "delay [samples]": ({"delay": 2}, {"delay": 20}),
    "lost frames": ({"lost_frames": 0.2}, {"lost_frames": 0.8}),
}
"""Label, and the ``[disturbances]`` of two levels."""

DEEPEST = 10.0
"""Depth of violation, in per cent of L, at which the colours end."""

LEAST = 0.01
"""Depth of violation, in per cent of L, at which they begin."""


class Case(NamedTuple):
    """A disturbance and its level, ``none`` without; and a controller's name."""

    disturbance: str
    level: str
    controller: str


class Robustness(Study):
    """Every disturbance at two levels with every controller, on the first example."""

    name = "robustness"
    title = "Disturbances"
    question = "What do the controllers make of disturbances of actuation, measurement and model?"
    claims = (9,)
    figure_caption = (
        "Depth of violation in per cent of the row's characteristic length L, for every disturbance at two levels; a "
        "dash where nothing was violated. Last column: final error of the camera's position, from the least to the "
        "greatest over the controllers."
    )

    def runs(self, *, small: bool = False) -> dict[Case, RunSpec]:
        """No disturbance, and every disturbance at two levels, with every controller."""
        some = list(DISTURBANCES.items())[:2] if small else list(DISTURBANCES.items())
        levels: list[tuple[str, str, dict[str, Any]]] = [("none", "", {})]
        for disturbance, both in some:
            levels += [
                (disturbance, _level(settings), {"disturbances": settings})
                for settings in (both[:1] if small else both)
            ]
        base = {**OVERRIDES, **({"duration": 3.0} if small else {})}
        return {
            Case(disturbance, level, law.name): RunSpec(SCENARIO, law, {**base, **overrides})
            for disturbance, level, overrides in levels
            for law in LAWS
        }

    def measure(self, results: Mapping[Case, RunSummary]) -> Measured:
        """Status, violation and final error by disturbance, level and controller."""
        points = [
            begun(case, run)
            | {
                "violation": 100.0 * run.value("violation_depth"),
                "violation_time_s": run.value("violation_time_s"),
                "final_translation_error_mm": 1e3 * run.value("final_translation_error_m"),
                "final_rotation_error_mrad": 1e3 * run.value("final_rotation_error_rad"),
                "acceleration_variation": run.value("acceleration_variation"),
            }
            for case, run in results.items()
        ]
        margin = float(Scenario.load(SCENARIO).tables["constraints"][0]["margin"])
        numbers: Numbers = {("margin",): 100.0 * margin / (1.0 - margin)}
        sentences = []
        for controller in grouped(points, "controller"):
            own = [point for point in points if point["controller"] == controller and point["disturbance"] != "none"]
            kept = sum(not ended_early(point) and point["violation"] == 0.0 for point in own)
            converged, deepest = sum(point["status"] == "converged" for point in own), greatest(own, "violation")
            found = {"runs": len(own), "without_violation": kept, "converged": converged, "deepest_violation": deepest}
            numbers |= under(found, controller)
            sentences.append(
                f"{controller} violates nothing in {kept} of {len(own)} disturbed runs, reaches the goal in "
                f"{converged}, and its deepest violation is {number(deepest)} % of L."
            )
        sentences.append(f"The boundary lies {number(numbers['margin',])} % of L inside the image.")
        return points, numbers, sentences

    def figure(self, result: StudyResult) -> Sheet:
        """A table of cells: one row per disturbance and level, one column per controller, the final errors beside."""
        cases = list(dict.fromkeys((point["disturbance"], point["level"]) for point in result.points))
        controllers = list(grouped(result.points, "controller"))
        sheet = Sheet(left=2.35, right=1.15)
        (ax,) = sheet.panels(1, height=0.25 * len(cases), above=0.54)
        ax.set_xlim(-0.5, len(controllers) - 0.5)
        ax.set_ylim(len(cases) - 0.5, -0.5)
        beside = len(controllers) - 0.4
        last = ""
        for i, (disturbance, level) in enumerate(cases):
            own = where(result.points, disturbance=disturbance, level=level)
            for point in own:
                _cell(ax, controllers.index(point["controller"]), i, point)
            if disturbance != last:
                sheet.name(ax, "no disturbance" if disturbance == "none" else disturbance, 1.0 - (i + 0.5) / len(cases))
                ax.axhline(i - 0.5, color=FAINT, linewidth=0.7)
            ax.text(-0.55, i, level, va="center", ha="right")
            ax.text(beside, i, _span(own), va="center")
            last = disturbance
        ax.grid(False)
        ax.set_yticks([])
        ax.xaxis.tick_top()
        ax.set_xticks(range(len(controllers)), [_two_lines(name) for name in controllers])
        ax.tick_params(length=0.0)
        sheet.text(0.08, 0.52, "depth of violation [% of L]", va="bottom", fontweight="bold")
        sheet.at -= 0.35
        sheet.text(WIDTH - 1.05, 0.52, "final error\n[mm]", va="bottom")
        return sheet


def _level(settings: Mapping[str, Any]) -> str:
    """The value of the one disturbance that is set."""
    value = next(iter(settings.values()))
    return f"{value[0] if isinstance(value, list) else value:g}"


def _two_lines(name: str) -> str:
    head, _, tail = name.rpartition("-")
    return f"{head}-\n{tail}" if len(name) > 15 else name


def _cell(ax: Any, x: int, y: int, point: Mapping[str, Any]) -> None:
    lost = ended_early(point)
    depth = point["violation"]
    share = 0.0
    if depth > 0.0:
        share = float(np.clip(np.log(depth / LEAST) / np.log(DEEPEST / LEAST), 0.06, 1.0))
    colour = "#9A9A9A" if lost else _shade(share)
    ax.fill_between([x - 0.5, x + 0.5], y - 0.5, y + 0.5, color=colour, linewidth=0.0)
    text = point["status"] if lost else number(depth) if depth > 0.0 else DASH
    ax.text(x, y, text, ha="center", va="center", color="white" if share > 0.6 or lost else INK)


def _span(points: Points) -> str:
    """Final errors from the least to the greatest [mm]."""
    values = [p["final_translation_error_mm"] for p in through(points)]
    if not values:
        return DASH
    low, high = _short(min(values)), _short(max(values))
    return low if low == high else f"{low} to {high}"


def _short(value: float) -> str:
    return "<0.1" if value < 0.1 else f"{value:.1f}" if value < 10.0 else f"{value:.0f}"


def _shade(share: float) -> tuple[float, float, float]:
    """From a pale blue (nothing violated) through white to a dark red."""
    if share == 0.0:
        return (0.86, 0.92, 0.97)
    pale, deep = np.array([0.99, 0.90, 0.84]), np.array([0.65, 0.06, 0.08])
    mixed = pale + share * (deep - pale)
    return (float(mixed[0]), float(mixed[1]), float(mixed[2]))
