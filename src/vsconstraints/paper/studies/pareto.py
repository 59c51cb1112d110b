"""What every controller pays for using the allowed space."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from ...comparisons.runs.spec import SLIDING_MODE, ControllerSpec, RunSpec
from ...reports.numbers import number, percent
from ...reports.plots import INK, Sheet, logarithmic, symbol
from .drawing import LOOKS, controller_entries, entry, scenario_panels, sentence_start
from .laws import ACTIVE_QP, hierarchical_qp, potential_field, scaled_gains
from .points import Measured, Numbers, Points, grouped, through, under, where
from .study import Study, StudyResult, begun
from .summary import RunSummary

FACTORS = (0.25, 0.5, 1.0, 1.5, 3.0, 10.0)
"""On every u⁺, for sliding mode."""

ACTIVE_FACTORS = (0.25, 1.0, 10.0)
"""On every u⁺, for the hierarchical QP with active rows, which does almost the same."""

REGIONS = (0.5, 0.2, 0.05, 0.01, 0.003, 0.0015, 0.001)
STRENGTHS = (0.25, 0.5, 1.0)
"""Of potential fields, each region with each strength; both options change how near to the boundary they let a row."""

ALPHAS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 300.0)
"""Rate of the hierarchical QP's barrier [1/s]."""

SCENARIOS: dict[str, tuple[tuple[float, ...], ...]] = {
    "example-2d-fov": (FACTORS, ACTIVE_FACTORS, REGIONS, ALPHAS),
    "case-study-6r": ((0.5, 1.0, 1.5, 2.0, 5.0), (1.0,), REGIONS, (2.0, 5.0, 20.0, 100.0)),
}
LONGEST_POSITIVE = 2
"""Samples in a row with φ ≥ 0, at most, if a boundary is kept: in a sliding mode it is one, or two."""

MOST_EXCESS = 2.0
"""Greatest φ of a speed, whose φ is its clearance, in T_s u⁺: (43) allows one, tracking adds to it."""

LEAST_UNUSED = 1e-3
"""Allowed space left unused below which points are drawn at the edge [%]."""


class Case(NamedTuple):
    """A scenario, a controller's name, its own parameter, and of a potential field its strength."""

    scenario: str
    controller: str
    parameter: float
    strength: float | None = None


class Pareto(Study):
    """Every controller over the range of its own parameter.

    Runs are compared if they keep their boundaries: they reach the goal, no row with a σ of its own is violated, no
    speed by more than sampling explains, and φ ≥ 0 lasts for two samples at most, so that where a row acts it slides or
    stays inside. A run is on the front if it is one of these and no other both leaves less of the allowed space unused
    and varies its acceleration less. What is left unused is the least clearance of a row as a share of its
    characteristic length, averaged over the rows that tracking alone violates.
    """

    name = "pareto"
    title = "Use of the allowed space against its price"
    question = "Over the range of its own parameter, what does each controller pay for using the allowed space?"
    claims = (7,)
    figure_caption = (
        "Allowed space left unused at the challenged rows (less is better) against the variation of the commanded "
        "acceleration and the depth of violation. One line per controller, along its own parameter, and per strength "
        "of a potential field; hollow: the goal is not reached, a row was violated, or φ ≥ 0 lasts for more than two "
        "samples. Black line: the front of the others."
    )

    def runs(self, *, small: bool = False) -> dict[Case, RunSpec]:
        """Every scenario, every controller, every value of its parameter."""
        runs: dict[Case, RunSpec] = {}

        def add(
            law: ControllerSpec, parameter: float, strength: float | None = None, overrides: Mapping[str, Any] = {}
        ) -> None:
            runs[Case(scenario, law.name, parameter, strength)] = RunSpec(scenario, law, overrides)

        for scenario, (factors, active_factors, regions, alphas) in SCENARIOS.items():
            if small:
                if scenario != "example-2d-fov":
                    continue
                factors, active_factors, regions, alphas = (1.0,), (1.0,), (0.2,), (5.0, 20.0)
            strengths = (1.0,) if small else STRENGTHS
            for law, own in ((SLIDING_MODE, factors), (ACTIVE_QP, active_factors)):
                for factor in own:
                    add(law, factor, overrides=scaled_gains(scenario, factor))
            for blend, strength, region in product(("additive", "priority"), strengths, regions):
                add(potential_field(blend, region, strength), region, strength)
            for alpha in alphas:
                add(hierarchical_qp(alpha), alpha)
        return runs

    def measure(self, results: Mapping[Case, RunSummary]) -> Measured:
        """Price and use of every run, and whether it is on the front."""
        points = [
            begun(case, run)
            | {
                "unused": unused(run),
                "not_kept": not_kept(run),
                "acceleration_variation": run.value("acceleration_variation"),
                "violation": 100.0 * run.value("violation_depth"),
                "violated": run.result.get("violated", ""),
                "switching_rate": run.value("switching_rate_hz"),
                "settling_time_s": run.value("settling_time_s"),
            }
            for case, run in results.items()
        ]
        numbers: Numbers = {}
        sentences = []
        for scenario, own in grouped(points, "scenario").items():
            best, parts = front(own), []
            for point in own:
                point["front"] = point in best
            for controller, theirs in grouped(own, "controller").items():
                clean = [point for point in theirs if _clean(point)]
                least = min((point["unused"] for point in clean), default=math.nan)
                found = {"least_unused": least, "on_front": sum(point["front"] for point in clean), "kept": len(clean)}
                numbers |= under(found, scenario, controller)
                parts.append(f"{controller} {_least(clean, theirs)}")
                if controller == SLIDING_MODE.name:
                    for point in theirs:
                        if point["parameter"] == 1.0:
                            printed = {"unused": point["unused"], "kept": _clean(point)}
                            numbers |= under(printed, scenario, "printed")
            on_front = ", ".join(grouped(best, "controller")) or "nobody"
            sentences.append(
                f"{sentence_start(scenario)}, least of the allowed space left unused among the runs that reach the "
                f"goal and keep their boundaries: {'; '.join(parts)}. On the front: {on_front}."
            )
        return points, numbers, sentences

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario; acceleration variation above, violation below."""
        scenarios, controllers = list(grouped(result.points, "scenario")), list(grouped(result.points, "controller"))
        carried = through(result.points)
        deepest = max((p["violation"] for p in carried if math.isfinite(p["violation"])), default=0.0)
        sheet = Sheet(left=0.8)
        sheet.legend([*controller_entries(controllers), entry("front", INK, linewidth=1.0)])
        measures = ("acceleration variation\n[rad/s³]", "depth of violation\n[% of L]")
        below = "allowed space left unused [%] (less →)"
        panels = scenario_panels(sheet, scenarios, measures, below, height=2.1, gap=0.75)
        for scenario in scenarios:
            own = where(carried, scenario=scenario)
            upper, lower = panels[0, scenario], panels[1, scenario]
            _front_line(upper, where(own, front=True))
            for name in controllers:
                _line(upper, where(own, controller=name), "acceleration_variation", name)
                _line(lower, where(own, controller=name), "violation", name)
            logarithmic(upper.yaxis)
            logarithmic(lower.yaxis, linear_below=0.01)
            lower.set_ylim(-0.002, max(2.0 * deepest, 1.0))
            for ax in (upper, lower):
                logarithmic(ax.xaxis, ())
                ax.set_xlim(1.5 * max((_shown(point) for point in own), default=1.0), 0.7 * LEAST_UNUSED)
                ax.set_xticks([LEAST_UNUSED, 0.01, 0.1, 1.0, 10.0], ["≤ 0.001", "0.01", "0.1", "1", "10"])
        return sheet


def front(points: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The runs without violation that no other such run beats in both unused space and acceleration variation."""
    clean = [point for point in points if _clean(point)]
    chosen: list[dict[str, Any]] = []
    for point in sorted(clean, key=lambda p: (p["unused"], p["acceleration_variation"])):
        if not chosen or point["acceleration_variation"] < chosen[-1]["acceleration_variation"]:
            chosen.append(point)
    return chosen


def unused(run: RunSummary) -> float:
    """Least clearance as a share of the characteristic length, averaged over the challenged rows [%]; NaN without."""
    left = [max(0.0, 1.0 - float(row["usage_max"])) for row in run.rows.values() if row["challenged"]]
    return 100.0 * math.fsum(left) / len(left) if left else math.nan


def not_kept(run: RunSummary) -> str:
    """Why a run is not compared with those that keep their boundaries; empty if it is."""
    if run.status != "converged":
        return run.status
    for label, row in run.rows.items():
        samples = round(float(row["longest_positive_run_s"]) / run.Ts)
        if row["kind"] == "speed":
            violated = row["phi_max"] > MOST_EXCESS * run.Ts * row["switching_gain"]
        else:
            violated = row["violation_depth"] > 0.0
        if violated:
            return f"{label} is violated"
        if samples > LONGEST_POSITIVE:
            return f"{label} has φ ≥ 0 for {samples} samples in a row"
    return ""


def _clean(point: Mapping[str, Any]) -> bool:
    return not point["not_kept"] and math.isfinite(point["unused"]) and math.isfinite(point["acceleration_variation"])


def _shown(point: Mapping[str, Any]) -> float:
    return max(float(point["unused"]), LEAST_UNUSED)


def _line(ax: Any, points: Points, column: str, name: str) -> None:
    """A line for each strength, and markers that are hollow where a boundary is not kept."""
    look = LOOKS[name]
    own = [p for p in points if math.isfinite(p["unused"]) and math.isfinite(p[column])]
    # the strength of laws without one is NaN, which is not equal to itself
    for strength in dict.fromkeys(None if math.isnan(p["strength"]) else p["strength"] for p in own):
        some = own if strength is None else where(own, strength=strength)
        line = {"color": look.colour, "linewidth": 1.0, "alpha": 0.7, "zorder": 2.5}
        ax.plot([_shown(p) for p in some], [p[column] for p in some], **line)
    for face, hollow in ((look.colour, False), ("white", True)):
        some = [p for p in own if bool(p["not_kept"]) == hollow]
        mark = symbol(look.marker, face, look.colour, 5.0) | {"markeredgewidth": 1.2}
        ax.plot([_shown(p) for p in some], [p[column] for p in some], **mark, clip_on=False, zorder=3)


def _front_line(ax: Any, points: Points) -> None:
    best = sorted(points, key=lambda point: point["unused"])
    line: dict[str, Any] = {"where": "post", "color": INK, "linewidth": 1.0, "zorder": 2}
    ax.step([_shown(p) for p in best], [p["acceleration_variation"] for p in best], **line)


def _least(clean: Points, every: Points) -> str:
    """What the run that leaves least unused does; what is wrong with the shallowest violation if none counts."""
    if clean:
        least = min(clean, key=lambda point: float(point["unused"]))
        region = f", region {least['parameter']:g}, strength {least['strength']:g}"
        return (
            f"{percent(least['unused'] / 100.0)} % at an acceleration variation of "
            f"{number(least['acceleration_variation'])} rad/s³{'' if math.isnan(least['strength']) else region} "
            f"({len(clean)} of {len(every)} runs)"
        )
    arrived = [point for point in every if point["status"] == "converged"]
    best = min(arrived, key=lambda point: float(point["violation"]), default=None)
    return f"none in {len(every)} runs" + (
        f" (at best {best['not_kept']})" if best else ", which do not reach the goal"
    )
