"""What every controller pays for using the allowed space."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..reports.numbers import number, percent
from .laws import ACTIVE_QP, SLIDING_MODE, Law, hierarchical_qp, potential_field, scaled_gains
from .panels import INK, LOOKS, Grid, handle, line_handle, logarithmic, scenario_title, sentence_start
from .study import Study, StudyResult, StudyRun
from .summary import RunSummary

FACTORS = (0.25, 0.5, 1.0, 3.0, 10.0)
"""On every u⁺, for sliding mode."""

ACTIVE_FACTORS = (0.25, 1.0, 10.0)
"""On every u⁺, for the hierarchical QP with active rows, which does almost the same."""

REGIONS = (0.5, 0.2, 0.05, 0.01, 0.003, 0.001)
"""Potential fields; chosen among those of the shrinking-region study."""

ALPHAS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 300.0)
"""Rate of the hierarchical QP's barrier [1/s]."""

SCENARIOS: dict[str, tuple[tuple[float, ...], ...]] = {
    "example-2d-fov": (FACTORS, ACTIVE_FACTORS, REGIONS, ALPHAS),
    "case-study-6r": ((0.5, 1.0, 5.0), (1.0,), REGIONS, (2.0, 5.0, 20.0, 100.0)),
}
LEAST_UNUSED = 1e-3
"""Allowed space left unused below which points are drawn at the edge [%]."""


class Pareto(Study):
    """Every controller over the range of its own parameter.

    A run is on the front if it violates nothing and no other such run of the scenario both leaves less of the allowed
    space unused and varies its acceleration less.
    """

    name = "pareto"
    title = "Use of the allowed space against its price"
    question = "Over the range of its own parameter, what does each controller pay for using the allowed space?"
    claims = (7,)
    figure_caption = (
        "Allowed space left unused at the challenged rows (less is better) against the variation of the commanded "
        "acceleration and the depth of violation. One line per controller, along its own parameter; hollow: a row was "
        "violated. Black line: the front of the runs that violate nothing."
    )

    def runs(self, *, small: bool = False) -> list[StudyRun]:
        """Every scenario, every controller, every value of its parameter."""
        runs = []
        for scenario, (factors, active_factors, regions, alphas) in SCENARIOS.items():
            if small:
                if scenario != "example-2d-fov":
                    continue
                factors, active_factors, regions, alphas = (1.0,), (1.0,), (0.2,), (5.0, 20.0)
            short = {"duration": 6.0} if small else {}
            for law, own in ((SLIDING_MODE, factors), (ACTIVE_QP, active_factors)):
                runs += [_run(scenario, law, factor, {**scaled_gains(scenario, factor), **short}) for factor in own]
            for blend in ("additive", "priority"):
                runs += [_run(scenario, potential_field(blend, region), region, short) for region in regions]
            runs += [_run(scenario, hierarchical_qp(alpha), alpha, short) for alpha in alphas]
        return runs

    def measure(self, results: Mapping[str, RunSummary]) -> tuple[list[dict[str, Any]], dict[str, float], list[str]]:
        """Price and use of every run, and whether it is on the front."""
        points: list[dict[str, Any]] = []
        for key, run in results.items():
            scenario, controller, parameter = key.split(" ")
            points.append(
                {
                    "scenario": scenario,
                    "controller": controller,
                    "parameter": float(parameter),
                    "status": run.status,
                    "reason": run.reason,
                    "unused": 100.0 * (1.0 - run.value("utilization")),
                    "acceleration_variation": run.value("acceleration_variation"),
                    "violation": 100.0 * run.value("violation_depth"),
                    "violated": run.result.get("violated", ""),
                    "switching_rate": run.value("switching_rate_hz"),
                    "settling_time_s": run.value("settling_time_s"),
                }
            )
        numbers: dict[str, float] = {}
        sentences = []
        for scenario in dict.fromkeys(point["scenario"] for point in points):
            own = [point for point in points if point["scenario"] == scenario]
            best = front(own)
            for point in own:
                point["front"] = point in best
            for controller in dict.fromkeys(point["controller"] for point in own):
                theirs = [p for p in own if p["controller"] == controller and _clean(p)]
                name = f"{scenario}.{controller}"
                numbers[f"{name}.least_unused"] = min((p["unused"] for p in theirs), default=math.nan)
                numbers[f"{name}.on_front"] = float(sum(point["front"] for point in theirs))
                numbers[f"{name}.without_violation"] = float(len(theirs))
            sentences.append(_sentence(scenario, own, best))
        return points, numbers, sentences

    def draw(self, result: StudyResult, path: Path) -> None:
        """One column per scenario; acceleration variation above, violation below."""
        scenarios = list(dict.fromkeys(point["scenario"] for point in result.points))
        controllers = list(dict.fromkeys(point["controller"] for point in result.points))
        with Grid(path, 2, len(scenarios), height=2.1, legend=0.36, left=0.8, gap=0.75) as grid:
            front_handle = handle("front", INK, linewidth=1.0)
            grid.legend([*(line_handle(name) for name in controllers), front_handle], 3)
            through = [p for p in result.points if p["status"] not in ("failed", "aborted")]
            deepest = max((p["violation"] for p in through if math.isfinite(p["violation"])), default=0.0)
            for j, scenario in enumerate(scenarios):
                own = [p for p in through if p["scenario"] == scenario]
                upper, lower = grid.axes[0][j], grid.axes[1][j]
                _front_line(upper, [point for point in own if point["front"]])
                for name in controllers:
                    theirs = [point for point in own if point["controller"] == name]
                    _line(upper, theirs, "acceleration_variation", name)
                    _line(lower, theirs, "violation", name)
                logarithmic(upper.yaxis)
                logarithmic(lower.yaxis, linear_below=0.01)
                greatest = max((_shown(point) for point in own), default=1.0)
                for ax in (upper, lower):
                    logarithmic(ax.xaxis, ())
                    ax.set_xlim(1.5 * greatest, 0.7 * LEAST_UNUSED)
                    ax.set_xticks([LEAST_UNUSED, 0.01, 0.1, 1.0, 10.0], ["≤ 0.001", "0.01", "0.1", "1", "10"])
                upper.tick_params(labelbottom=False)
                lower.set_ylim(-0.002, max(2.0 * deepest, 1.0))
                upper.set_title(scenario_title(scenario))
                lower.set_xlabel("allowed space left unused [%] (less →)")
            grid.axes[0][0].set_ylabel("acceleration variation\n[rad/s³]")
            grid.axes[1][0].set_ylabel("depth of violation\n[% of L]")


def front(points: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The runs without violation that no other such run beats in both unused space and acceleration variation."""
    clean = [point for point in points if _clean(point)]
    chosen: list[dict[str, Any]] = []
    for point in sorted(clean, key=lambda p: (p["unused"], p["acceleration_variation"])):
        if not chosen or point["acceleration_variation"] < chosen[-1]["acceleration_variation"]:
            chosen.append(point)
    return chosen


def _clean(point: Mapping[str, Any]) -> bool:
    return (
        point["status"] == "converged"
        and point["violation"] == 0.0
        and math.isfinite(point["unused"])
        and math.isfinite(point["acceleration_variation"])
    )


def _run(scenario: str, law: Law, parameter: float, overrides: dict[str, Any]) -> StudyRun:
    return StudyRun(
        f"{scenario} {law.controller} {parameter:g}", scenario, law.law, law.options, law.controller, overrides
    )


def _shown(point: Mapping[str, Any]) -> float:
    return max(float(point["unused"]), LEAST_UNUSED)


def _line(ax: Any, points: Sequence[Mapping[str, Any]], column: str, name: str) -> None:
    look = LOOKS[name]
    own = [p for p in points if math.isfinite(p["unused"]) and math.isfinite(p[column])]
    ax.plot([_shown(p) for p in own], [p[column] for p in own], color=look.colour, linewidth=1.0, alpha=0.7, zorder=2.5)
    for hollow in (False, True):
        some = [p for p in own if (p["violation"] > 0.0) == hollow]
        ax.plot(
            [_shown(p) for p in some],
            [p[column] for p in some],
            linestyle="none",
            marker=look.marker,
            markersize=5.0,
            markerfacecolor="white" if hollow else look.colour,
            markeredgecolor=look.colour,
            markeredgewidth=1.2,
            clip_on=False,
            zorder=3,
        )


def _front_line(ax: Any, points: Sequence[Mapping[str, Any]]) -> None:
    best = sorted(points, key=lambda point: point["unused"])
    ax.step(
        [_shown(p) for p in best],
        [p["acceleration_variation"] for p in best],
        where="post",
        color=INK,
        linewidth=1.0,
        zorder=2,
    )


def _sentence(scenario: str, points: Sequence[dict[str, Any]], best: Sequence[dict[str, Any]]) -> str:
    parts = []
    for controller in dict.fromkeys(point["controller"] for point in points):
        clean = [p for p in points if p["controller"] == controller and _clean(p)]
        every = sum(p["controller"] == controller for p in points)
        if not clean:
            parts.append(f"{controller} none in {every} runs{_nearest(points, controller)}")
            continue
        least = min(clean, key=lambda point: point["unused"])
        parts.append(
            f"{controller} {percent(least['unused'] / 100.0)} % at an acceleration variation of "
            f"{number(least['acceleration_variation'])} rad/s³ ({len(clean)} of {every} runs)"
        )
    on_front = ", ".join(dict.fromkeys(point["controller"] for point in best)) or "nobody"
    return (
        f"{sentence_start(scenario)}, least of the allowed space left unused among the runs that "
        f"reach the goal and violate nothing: {'; '.join(parts)}. On the front: {on_front}."
    )


def _nearest(points: Sequence[Mapping[str, Any]], controller: str) -> str:
    """What the run with the shallowest violation violates, and how deep."""
    own = [p for p in points if p["controller"] == controller and p["status"] == "converged"]
    if not own:
        return ", which do not reach the goal"
    best = min(own, key=lambda point: float(point["violation"]))
    return f" (at best {best['violated']} by {number(best['violation'])} % of L)"
