"""Erroneous gradients, for every controller."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number, percent
from ...reports.plots import Sheet, logarithmic
from ...scenarios import shipped_scenarios
from .drawing import LOOKS, controller_entries, failed_marks, joined, scenario_panels, sentence_start
from .laws import LAWS
from .points import Measured, Numbers, Points, ended_early, greatest, grouped, through, under, where
from .study import Study, StudyResult, begun
from .summary import NOT_RUN, RunSummary, pixel_distance

ERRORS = {
    "example-2d-fov": (0.0, 0.1, 0.3, 0.6, 1.0),
    "case-study-6r": (0.0, 0.3, 1.0),
    "experiment-1-pbvs": (0.0, 0.3, 0.6, 1.0),
    "experiment-2-ibvs": (0.0, 0.3, 0.6, 1.0),
}
"""c_e by scenario."""

PAPER = 0.3
"""c_e of the paper's experiments."""

ROWS = (
    ("deviation_px", "deviation of a\nmarker [px]", 1.0),
    ("violation", "depth of violation\n[% of L]", 0.01),
    ("settling_time_s", "settling time [s]", None),
)
"""Column, label, and where a logarithmic axis becomes linear; None for a linear axis."""


class Case(NamedTuple):
    """A scenario, a controller's name, and c_e."""

    scenario: str
    controller: str
    gradient_error: float


class GradientErrors(Study):
    """Every controller with the erroneous gradient (49) in its visibility rows.

    The deviation is the greatest distance, at any time, of a marker from where it is in the run of the same controller
    with exact gradients.
    """

    name = "gradient-error"
    title = "Erroneous gradients"
    question = "How much does an error of the gradients change, for every controller?"
    claims = (6, 9)
    figure_caption = (
        "Every controller with the gradient error c_e of (49). Top: greatest distance of a marker from the same "
        "controller's run with exact gradients. A cross marks a run that failed or was aborted."
    )

    def runs(self, *, small: bool = False) -> dict[Case, RunSpec]:
        """Every scenario that is shipped, every controller, every error."""
        runs = {}
        for scenario, errors in ERRORS.items():
            if scenario not in shipped_scenarios() or (small and scenario != "example-2d-fov"):
                continue
            for law in LAWS:
                for error in (0.0, PAPER) if small else errors:
                    overrides: dict[str, Any] = {"disturbances": {"gradient_error": error}} if error else {}
                    if small:
                        overrides["duration"] = 6.0
                    runs[Case(scenario, law.name, error)] = RunSpec(scenario, law, overrides)
        return runs

    def measure(self, results: Mapping[Case, RunSummary]) -> Measured:
        """Deviation, violation, settling by scenario, controller and error."""
        points = [
            begun(case, run)
            | {
                "deviation_px": pixel_distance(run, results.get(case._replace(gradient_error=0.0), NOT_RUN)),
                "violation": 100.0 * run.value("violation_depth"),
                "violated": run.result.get("violated", ""),
                "settling_time_s": run.value("settling_time_s"),
                "utilization": run.value("utilization"),
                "phi_max": run.phi_max,
                "longest_run": float(run.longest_run),
            }
            for case, run in results.items()
        ]
        numbers: Numbers = {}
        for point in points:
            found = {column: point[column] for column, _, _ in ROWS} | {"converged": point["status"] == "converged"}
            numbers |= under(found, point["scenario"], point["controller"], point["gradient_error"])
        return points, numbers, _sentences(points)

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario; rows as in :data:`ROWS`."""
        controllers = list(grouped(result.points, "controller"))
        sheet = Sheet(left=0.9)
        sheet.legend(controller_entries(controllers))
        labels = [label for _, label, _ in ROWS]
        scenarios = list(grouped(result.points, "scenario"))
        panels = scenario_panels(sheet, scenarios, labels, "gradient error cₑ", height=1.4, gap=0.6)
        for (i, scenario), ax in panels.items():
            column, _, linear_below = ROWS[i]
            if linear_below is not None:
                logarithmic(ax.yaxis, linear_below=linear_below)
            for k, name in enumerate(controllers):
                own, look = where(result.points, scenario=scenario, controller=name), LOOKS[name]
                thin: dict[str, Any] = {"markersize": 4.5, "alpha": 0.9, "linewidth": 1.8 - 0.2 * k}
                joined(ax, through(own), "gradient_error", column, look.colour, look.marker, **thin)
                if i == 0:
                    lost = [point["gradient_error"] + 0.035 * (k - 2) for point in filter(ended_early, own)]
                    failed_marks(ax, lost, look.colour, 0.92)
            ax.set_xlim(-0.06, 1.14)
            _limits(ax, column)
        return sheet


def _limits(ax: Any, column: str) -> None:
    """Room for the crosses above; settling times need not begin at zero."""
    low, high = ax.get_ylim()
    if column == "deviation_px":
        ax.set_ylim(0.0, max(10.0 * high, 10.0))
    elif column == "violation":
        ax.set_ylim(-0.002, max(high, 1.0))
    else:
        ax.set_ylim(low - 0.1 * (high - low) - 0.1, high + 0.1 * (high - low) + 0.1)


def _sentences(points: Points) -> list[str]:
    sentences = []
    for scenario, own in grouped(points, "scenario").items():
        parts = [f"{p['controller']} {_outcome(p)}" for p in own if math.isclose(p["gradient_error"], PAPER)]
        sentences.append(f"{sentence_start(scenario)}, c_e = {PAPER:g}: {'; '.join(parts)}.")
        worst = greatest(own, "gradient_error")
        kept = [p["controller"] for p in own if p["gradient_error"] == worst and p["status"] == "converged"]
        sentences.append(f"With c_e = {worst:g} the goal is reached by {', '.join(kept) or 'no controller'}.")
    return sentences


def _outcome(point: Mapping[str, Any]) -> str:
    if ended_early(point):
        return f"{point['status']} ({point['reason']})"
    depth = percent(point["violation"] / 100.0)
    violation = f"violates {point['violated']} by {depth} % of L" if point["violation"] > 0.0 else "violates nothing"
    return f"deviates {number(point['deviation_px'])} px and {violation}"
