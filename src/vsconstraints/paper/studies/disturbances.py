"""Erroneous gradients, and disturbances of actuation, measurement and model, for every law."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import DASH, number
from ...reports.plots import INK, WIDTH, Sheet, logarithmic
from ...reports.plots.style import FAINT
from ...scenarios import Scenario
from . import drawing as draw
from . import study
from .study import Numbers, Points, StudyResult, Sweep
from .summary import NOT_RUN, RunSummary, pixel_distance

PAPER = 0.3
"""c_e of the paper's experiments."""

MIN_DEPTH, MAX_DEPTH = 0.01, 10.0
"""Depths of violation at which colours begin and end [% of L]."""


class GradientErrors(Sweep):
    """Every law with the erroneous gradient (49) in its visibility rows.

    The deviation is the greatest distance, at any time, of a marker from where it is in the run of the same law with
    exact gradients.
    """

    name = "gradient-error"

    Case = study.case_type("scenario", "controller", "gradient_error")
    """A scenario, a law's name, and c_e."""

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        error = {"disturbances": {"gradient_error": case.gradient_error}} if case.gradient_error else {}
        return RunSpec(case.scenario, draw.LAWS[case.controller], error)

    def measure(self, results: Mapping[Any, RunSummary]) -> tuple[Points, Numbers, list[str]]:
        """Deviation, violation, settling by scenario, law and error."""
        points = [
            study.begun(case, run)
            | {"deviation_px": pixel_distance(run, results.get(case._replace(gradient_error=0.0), NOT_RUN))}
            | study.columns(run, "violation", "violated", "settling_time_s", "utilization", "phi_max", "longest_run")
            for case, run in results.items()
        ]
        numbers: Numbers = {}
        for point in points:
            found = {column: point[column] for column in self.table["measures"]} | {
                "converged": point["status"] == "converged"
            }
            numbers |= study.keyed(found, point["scenario"], point["controller"], point["gradient_error"])
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


class Robustness(Sweep):
    """Every disturbance at two levels with every law, on the first example, made faster so that runs are shorter."""

    name = "robustness"
    scenario = "example-2d-fov"

    Case = study.case_type("disturbance", "level", "controller")
    """A disturbance and its level, ``none`` without; and a law's name."""

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        overrides: dict[str, Any] = {"task.Kp0": 40.0, "constraints.0.switching_gain": 20.0, "duration": 5.0}
        for settings in self.table["disturbances"].get(case.disturbance, ()):
            if _level(settings) == case.level:
                overrides["disturbances"] = settings
        return RunSpec(self.scenario, draw.LAWS[case.controller], overrides)

    def runs(self, *, small: bool = False) -> dict[Any, RunSpec]:
        """No disturbance, and every disturbance at two levels, with every law."""
        disturbances = list(self.table["disturbances"].items())[: 2 if small else None]
        levels = [("none", "")]
        levels += [(name, _level(one)) for name, both in disturbances for one in both[: 1 if small else None]]
        cases = [self.Case(*level, law) for level in levels for law in draw.LAWS]
        shorter = {"duration": 3.0} if small else {}
        runs = {case: self.spec(case) for case in cases}
        return {case: replace(spec, overrides={**spec.overrides, **shorter}) for case, spec in runs.items()}

    def measure(self, results: Mapping[Any, RunSummary]) -> tuple[Points, Numbers, list[str]]:
        """Status, violation and final error by disturbance, level and law."""
        points = [
            study.begun(case, run)
            | study.columns(run, "violation", "violation_time_s")
            | {
                "final_translation_error_mm": 1e3 * run.value("final_translation_error_m"),
                "final_rotation_error_mrad": 1e3 * run.value("final_rotation_error_rad"),
            }
            | study.columns(run, "acceleration_variation")
            for case, run in results.items()
        ]
        margin = float(Scenario.load(self.scenario).tables["constraints"][0]["margin"])
        numbers: Numbers = {("margin",): 100.0 * margin / (1.0 - margin)}
        sentences = []
        for law, runs in study.grouped(points, "controller").items():
            own = [point for point in runs if point["disturbance"] != "none"]
            found = {
                "runs": len(own),
                "without_violation": sum(point["violation"] == 0.0 for point in study.completed(own)),
                "converged": len(study.where(own, status="converged")),
                "deepest_violation": study.greatest(own, "violation"),
            }
            numbers |= study.keyed(found, law)
            sentences.append(self.sentence("law", law=law, **found))
        return points, numbers, [*sentences, self.sentence("margin", margin=numbers["margin",])]

    def figure(self, result: StudyResult) -> Sheet:
        """A table of cells: one row per disturbance and level, one column per law, the final errors beside."""
        cases = list(dict.fromkeys((point["disturbance"], point["level"]) for point in result.points))
        laws = list(study.grouped(result.points, "controller"))
        sheet = Sheet(left=2.35, right=1.15)
        (ax,) = sheet.panels(1, height=0.25 * len(cases), above=0.54)
        ax.set_xlim(-0.5, len(laws) - 0.5)
        ax.set_ylim(len(cases) - 0.5, -0.5)
        last = ""
        for i, (disturbance, level) in enumerate(cases):
            own = study.where(result.points, disturbance=disturbance, level=level)
            for point in own:
                _cell(ax, laws.index(point["controller"]), i, point)
            if disturbance != last:
                sheet.name(ax, "no disturbance" if disturbance == "none" else disturbance, 1.0 - (i + 0.5) / len(cases))
                ax.axhline(i - 0.5, color=FAINT, linewidth=0.7)
            ax.text(-0.55, i, level, va="center", ha="right")
            ax.text(len(laws) - 0.4, i, _span(own), va="center")
            last = disturbance
        ax.grid(False)
        ax.set_yticks([])
        ax.xaxis.tick_top()
        ax.set_xticks(range(len(laws)), ["-\n".join(n.rsplit("-", 1)) if len(n) > 15 else n for n in laws])
        ax.tick_params(length=0.0)
        sheet.text(0.08, 0.52, "depth of violation [% of L]", va="bottom", fontweight="bold")
        sheet.at -= 0.35
        sheet.text(WIDTH - 1.05, 0.52, "final error\n[mm]", va="bottom")
        return sheet


def _level(settings: Mapping[str, Any]) -> str:
    """The value of the one disturbance that is set."""
    (value,) = settings.values()
    return f"{value[0] if isinstance(value, list) else value:g}"


def _cell(ax: Any, x: int, y: int, point: Mapping[str, Any]) -> None:
    """Pale blue where nothing was violated, else from a pale to a dark red; grey for runs that ended early."""
    lost, depth, share, colour = study.ended_early(point), point["violation"], 0.0, np.array([0.86, 0.92, 0.97])
    if depth > 0.0:
        share = float(np.clip(np.log(depth / MIN_DEPTH) / np.log(MAX_DEPTH / MIN_DEPTH), 0.06, 1.0))
        pale, dark = np.array([0.99, 0.90, 0.84]), np.array([0.65, 0.06, 0.08])
        colour = pale + share * (dark - pale)
    ax.fill_between([x - 0.5, x + 0.5], y - 0.5, y + 0.5, color="#9A9A9A" if lost else tuple(colour), linewidth=0.0)
    text = point["status"] if lost else number(depth) if depth > 0.0 else DASH
    ax.text(x, y, text, ha="center", va="center", color="white" if share > 0.6 or lost else INK)


def _span(points: Points) -> str:
    """Final errors from the least to the greatest [mm]."""
    values = [p["final_translation_error_mm"] for p in study.completed(points)]
    ends = (min(values), max(values)) if values else ()
    short = ["<0.1" if end < 0.1 else f"{end:.1f}" if end < 10.0 else f"{end:.0f}" for end in ends]
    return " to ".join(dict.fromkeys(short)) or DASH
