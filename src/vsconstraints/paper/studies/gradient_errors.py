"""Erroneous gradients (49), for every law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import Sheet, logarithmic
from . import drawing as draw
from . import study
from .study import Numbers, Points, StudyResult, Sweep
from .summary import NOT_RUN, RunSummary, pixel_distance

PAPER = 0.3  #: c_e of the paper's experiments.


class GradientErrors(Sweep):
    """Every law with the erroneous gradient (49) in its visibility rows.

    The deviation is the greatest distance, at any time, of a marker from where it is in the run of the same law with
    exact gradients.
    """

    name = "gradient-error"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case: a scenario, a law's name, and c_e."""
        error = {"disturbances": {"gradient_error": case.gradient_error}} if case.gradient_error else {}
        return RunSpec(case.scenario, draw.LAWS[case.controller], error)

    def measure(self, results: Mapping[Any, RunSummary]) -> tuple[Points, Numbers, list[str]]:
        """Deviation, violation, settling by scenario, law and error."""
        points: Points = []
        numbers: Numbers = {}
        for case, run in results.items():
            exact = results.get(case._replace(gradient_error=0.0), NOT_RUN)
            point = study.begun(case, run) | {"deviation_px": pixel_distance(run, exact)}
            names = ("violation", "violated", "settling_time_s", "utilization", "phi_max", "longest_run")
            points.append(point | study.columns(run, *names))
            found = {column: points[-1][column] for column in self.table["measures"]}
            numbers |= study.keyed(found | {"converged": run.status == "converged"}, *case)
        sentences = []
        for scenario, own in study.grouped(points, "scenario").items():
            laws = "; ".join(f"{p['controller']} {self._outcome(p)}" for p in study.where(own, gradient_error=PAPER))
            sentences.append(self.sentence("paper", scenario=draw.sentence_start(scenario), error=PAPER, laws=laws))
            most = study.greatest(own, "gradient_error")
            arrived = [p["controller"] for p in study.where(own, gradient_error=most, status="converged")]
            sentences.append(self.sentence("largest", error=most, laws=", ".join(arrived) or "no controller"))
        return points, numbers, sentences

    def _outcome(self, point: Mapping[str, Any]) -> str:
        if study.ended_early(point):
            return f"{point['status']} ({point['reason']})"
        kind = "violates" if point["violation"] > 0.0 else "keeps"
        return self.sentence(kind, **point, depth=point["violation"] / 100.0)

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario, one row per measure."""
        laws = list(study.grouped(result.points, "controller"))
        sheet, panels = draw.scenario_grid(self.table, result.points, draw.law_entries(laws))
        for (column, scenario), ax in panels.items():
            if column != "settling_time_s":
                logarithmic(ax.yaxis, linear_below=1.0 if column == "deviation_px" else 0.01)
            for k, name in enumerate(laws):
                own, look = study.where(result.points, scenario=scenario, controller=name), draw.LOOKS[name]
                thin: dict[str, Any] = {"markersize": 4.5, "alpha": 0.9, "linewidth": 1.8 - 0.2 * k}
                draw.joined(ax, study.completed(own), "gradient_error", column, look.colour, look.marker, **thin)
                if column == "deviation_px":
                    lost = [point["gradient_error"] + 0.035 * (k - 2) for point in filter(study.ended_early, own)]
                    draw.failed_marks(ax, lost, look.colour, 0.92)
            ax.set_xlim(-0.06, 1.14)
            low, high = ax.get_ylim()
            room = 0.1 * (high - low) + 0.1
            limits = {"deviation_px": (0.0, max(10.0 * high, 10.0)), "violation": (-0.002, max(high, 1.0))}
            ax.set_ylim(*limits.get(column, (low - room, high + room)))  # the first with room for the crosses
        return sheet
