"""Erroneous gradients (49), for every law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...comparisons.runs.spec import RunSpec
from .drawing import LAWS
from .points import Numbers, Points, keyed
from .study import Sweep
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
        return RunSpec(case.scenario, LAWS[case.controller], error)

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """How far its markers are from those of the exact run."""
        return {"deviation_px": pixel_distance(run, results.get(case._replace(gradient_error=0.0), NOT_RUN))}

    def numbers(self, points: Points) -> Numbers:
        """Deviation, violation, settling by scenario, law and error."""
        numbers: Numbers = {}
        for point in points:
            found = {column: point[column] for column in self.table["measures"]}
            case = (point[name] for name in self.Case._fields)
            numbers |= keyed(found | {"converged": point["status"] == "converged"}, *case)
        return numbers
