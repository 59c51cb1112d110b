"""Erroneous gradients (49), for every law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import Sheet
from . import drawing as draw
from . import study
from .study import Numbers, Points, StudyResult, Sweep
from .summary import NOT_RUN, RunSummary, pixel_distance


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

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """How far its markers are from those of the exact run."""
        return {"deviation_px": pixel_distance(run, results.get(case._replace(gradient_error=0.0), NOT_RUN))}

    def numbers(self, points: Points) -> Numbers:
        """Deviation, violation, settling by scenario, law and error."""
        numbers: Numbers = {}
        for point in points:
            found = {column: point[column] for column in self.table["measures"]}
            case = (point[name] for name in self.Case._fields)
            numbers |= study.keyed(found | {"converged": point["status"] == "converged"}, *case)
        return numbers

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario, one row per measure."""
        laws = list(study.grouped(result.points, "controller"))
        panels = draw.Panels(self.table, result.points, draw.law_entries(laws))
        for ax, column, points in panels:
            for k, name in enumerate(laws):
                own, look = study.where(points, controller=name), draw.LOOKS[name]
                thin: dict[str, Any] = {"markersize": 4.5, "alpha": 0.9, "linewidth": 1.8 - 0.2 * k}
                draw.joined(ax, own, "gradient_error", column, look.colour, look.marker, **thin)
                if column == "deviation_px":
                    draw.failed_marks(ax, own, "gradient_error", look.colour, shift=0.035 * (k - 2))
        return panels.sheet
