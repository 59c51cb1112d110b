"""Study of the use of the allowed space against its price."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number, percent
from ...reports.plots import Sheet, logarithmic
from ...scenarios import Scenario
from .drawing import Measure, add_panels, draw_line, law_style, style_of
from .laws import LAWS
from .study import Found, Results, Study, StudyResult
from .summary import RunSummary
from .tables import Numbers, Point, Points, grouped, sentence_start, where

#: Greatest number of consecutive samples with φ ≥ 0 if a boundary is kept: one or two in a sliding
#: mode.
MAX_POSITIVE_SAMPLES = 2
#: Greatest φ of a speed, which is its clearance, if its limit is kept, in units of T_s u⁺: (43)
#: allows one, tracking adds to it.
MAX_EXCESS = 2.0


class ParetoCase(NamedTuple):
    """Scenario, law, parameter of the law, and strength of a field.

    The parameter is a factor on every u⁺ of the sliding mode and of active rows, the region of a
    field, or α of a barrier [1/s].
    """

    scenario: str
    controller: str
    parameter: float
    strength: float | None = None


class Range(NamedTuple):
    """Parameters of a law, and strengths of a field."""

    controller: str
    parameters: tuple[float, ...]
    strengths: tuple[float | None, ...] = (None,)


FIELD_RANGE = ((0.5, 0.2, 0.05, 0.01, 0.003, 0.0015, 0.001), (0.25, 0.5, 1.0))
#: Ranges of the laws by scenario.
RANGES = {
    "example-2d-fov": (
        Range("sliding-mode", (0.25, 0.5, 1.0, 1.5, 3.0, 10.0)),
        Range("hierarchical-qp-active", (0.25, 1.0, 10.0)),
        Range("potential-field", *FIELD_RANGE),
        Range("potential-field-priority", *FIELD_RANGE),
        Range("hierarchical-qp", (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 300.0)),
    ),
    "case-study-6r": (
        Range("sliding-mode", (0.5, 1.0, 1.5, 2.0, 5.0)),
        Range("hierarchical-qp-active", (1.0,)),
        Range("potential-field", *FIELD_RANGE),
        Range("potential-field-priority", *FIELD_RANGE),
        Range("hierarchical-qp", (2.0, 5.0, 20.0, 100.0)),
    ),
}
SMALL_RANGES = {
    "example-2d-fov": (
        Range("sliding-mode", (1.0,)),
        Range("hierarchical-qp-active", (1.0,)),
        Range("potential-field", (0.2,), (1.0,)),
        Range("potential-field-priority", (0.2,), (1.0,)),
        Range("hierarchical-qp", (5.0, 20.0)),
    )
}

LEAST = 1e-3  #: Smaller unused space is drawn here [%].
#: Ticks of the unused space [%], with their texts.
TICKS = {LEAST: "≤ 0.001", 0.01: "0.01", 0.1: "0.1", 1.0: "1", 10.0: "10"}
MEASURES = {
    "acceleration_variation": Measure(label="acceleration variation\n[rad/s³]"),
    "violation": Measure(
        label="depth of violation\n[% of L]", linear_below=0.01, low=-0.002, top=1.0, headroom=2.0
    ),
}
#: Styles of runs that keep their boundaries, and of the others.
KEPT: dict[str, Any] = {
    "linestyle": "none",
    "markersize": 7.0,
    "markeredgecolor": "white",
    "markeredgewidth": 0.9,
    "zorder": 3.5,
    "clip_on": False,
}
NOT_KEPT: dict[str, Any] = {
    "linestyle": "none",
    "markersize": 3.5,
    "markerfacecolor": "none",
    "alpha": 0.45,
    "zorder": 2.5,
    "clip_on": False,
}
FRONT = style_of("front", drawstyle="steps-post") | {"linewidth": 2.0, "zorder": 3}


class Pareto(Study):
    """All laws over the range of their own parameter.

    The parameter is a factor on every u⁺, a region, or the rate α of a barrier. Runs are compared
    if they keep their boundaries: they reach the goal, no row with a separate σ is violated, no
    speed exceeds its limit by more than sampling explains, and φ ≥ 0 lasts for at most two samples,
    so that an active row slides or stays inside. A compared run is on the front if no other
    compared run has both less unused space and less variation of acceleration. Unused space is the
    smallest clearance of a row as a share of its characteristic length, averaged over the rows that
    the unconstrained baseline violates.
    """

    name = "pareto"
    title = "Use of the allowed space against its price"
    question = (
        "Over the range of its own parameter, what does each controller pay for using the allowed "
        "space?"
    )
    claims = (7,)
    columns = (
        "status",
        "reason",
        "unused",
        "not_kept",
        "acceleration_variation",
        "violation",
        "violated",
        "switching_rate",
        "settling_time_s",
    )
    figure_caption = (
        "Allowed space left unused at the challenged rows (less is better) against the variation "
        "of the commanded acceleration and the depth of violation. Small and hollow: the goal is "
        "not reached, a row was violated, or φ ≥ 0 lasts for more than two samples. Black line: "
        "the front of all others."
    )

    def runs(self, *, small: bool = False) -> dict[ParetoCase, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""
        cases = [
            ParetoCase(scenario, controller, parameter, strength)
            for scenario, ranges in (SMALL_RANGES if small else RANGES).items()
            for controller, parameters, strengths in ranges
            for strength in strengths
            for parameter in parameters
        ]
        return {case: with_parameter(case) for case in cases}

    def lines(self, case: ParetoCase, run: RunSummary, results: Results) -> Points:
        """Unused space, and the reason why the run is not compared."""
        return [{"unused": unused(run), "not_kept": not_kept(run)}]

    def completed(self, points: Points) -> Points:
        """Return the points with the column ``front``: True on the front of their scenario."""
        return [
            {**point, "front": point in front(where(points, scenario=point["scenario"]))}
            for point in points
        ]

    def numbers(self, points: Points) -> Found:
        """Smallest unused space of each law, and numbers of its runs compared and on the front."""
        numbers: dict[tuple[Any, ...], Mapping[Any, float]] = {}
        for key, runs in grouped(points, "scenario", "controller").items():
            compared = kept(runs)
            numbers[key] = {
                "least_unused": min((point["unused"] for point in compared), default=math.nan),
                "on_front": len(where(compared, front=True)),
                "kept": len(compared),
            }
        for point in where(points, controller="sliding-mode", parameter=1.0):
            numbers[point["scenario"], "printed"] = {
                "unused": point["unused"],
                "kept": bool(kept([point])),
            }
        return numbers

    def sentences(self, points: Points, numbers: Numbers) -> list[str]:
        """Return the sentences of the result."""
        sentences = []
        for scenario, of_scenario in grouped(points, "scenario").items():
            texts = [
                f"{law} {described(runs)}"
                for law, runs in grouped(of_scenario, "controller").items()
            ]
            on_front = sorted(
                where(of_scenario, front=True),
                key=lambda p: (p["unused"], p["acceleration_variation"]),
            )
            laws = ", ".join(grouped(on_front, "controller")) or "nobody"
            sentences.append(
                f"{sentence_start(scenario)}, least of the allowed space left unused among the "
                "runs that reach the goal and keep their boundaries: "
                f"{'; '.join(texts)}. On the front: {laws}."
            )
        return sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Draw both prices over the unused space, with the front of the first one."""
        points = list(result.points)
        styles = {law: law_style(law) for law in grouped(points, "controller")}
        sheet = Sheet(left=0.8)
        sheet.legend([*(style | KEPT for style in styles.values()), FRONT])
        below = "allowed space left unused [%] (less →)"
        panels = add_panels(sheet, points, MEASURES, below, height=2.1, gap=0.75)
        for panel in panels:
            for shown, runs in ((KEPT, where(panel.points, not_kept="")), (NOT_KEPT, panel.points)):
                for law, of_law in grouped(runs, "controller").items():
                    draw_line(panel.ax, of_law, "unused", panel.measure, styles[law] | shown, LEAST)
            if panel.measure == "acceleration_variation":
                on_front = where(panel.points, front=True)
                draw_line(panel.ax, on_front, "unused", panel.measure, FRONT, LEAST)
            logarithmic(panel.ax.xaxis, list(TICKS))
            panel.ax.set_xticks(list(TICKS), list(TICKS.values()))
            MEASURES[panel.measure].finish(panel.ax)
            panel.ax.set_xlim(panel.ax.get_xlim()[1], 0.7e-3)
        depths = [panel.ax for panel in panels if panel.measure == "violation"]
        highest = max(ax.get_ylim()[1] for ax in depths)
        for ax in depths:
            ax.set_ylim(top=highest)
        return sheet


def with_parameter(case: ParetoCase) -> RunSpec:
    """Return the run of a law with its parameter."""
    law = LAWS[case.controller]
    if "region" in law.options:
        law = law.changed("region", case.parameter).changed("strength", case.strength)
        return RunSpec(case.scenario, law)
    if "alpha" in law.options:
        return RunSpec(case.scenario, law.changed("alpha", case.parameter))
    return RunSpec(case.scenario, law, scaled_gains(case.scenario, case.parameter))


def scaled_gains(scenario: str, factor: float) -> dict[str, float]:
    """Return overrides that multiply every u⁺ of a shipped scenario; none for the factor 1."""
    constraints = Scenario.load(scenario).tables["constraints"] if factor != 1.0 else ()
    return {
        f"constraints.{i}.switching_gain": factor * table["switching_gain"]
        for i, table in enumerate(constraints)
    }


def described(runs: Points) -> str:
    """Words for the runs of a law in a scenario."""
    count = len(runs)
    if compared := kept(runs):
        best = min(compared, key=lambda point: point["unused"])
        field = ""
        if best["strength"] > 0:
            field = f", region {best['parameter']:g}, strength {best['strength']:g}"
        return (
            f"{percent(best['unused'] / 100)} % at an acceleration variation of "
            f"{number(best['acceleration_variation'])} rad/s³{field} "
            f"({len(compared)} of {count} runs)"
        )
    if arrived := where(runs, status="converged"):
        best = min(arrived, key=lambda point: point["violation"])
        return f"none in {count} runs (at best {best['not_kept']})"
    return f"none in {count} runs, which do not reach the goal"


def kept(points: Iterable[Point]) -> Points:
    """Return points of runs that keep their boundaries and have finite values of both measures."""
    return [
        p
        for p in points
        if not p["not_kept"] and math.isfinite(p["unused"] + p["acceleration_variation"])
    ]


def front(points: Sequence[Point]) -> Points:
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
