"""Potential fields that become the sliding-mode law, and what each law pays for using the allowed space."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from ...comparisons.runs.spec import SLIDING_MODE, RunSpec
from ...reports.plots import INK, REFERENCE, Sheet, line, logarithmic, symbol
from ...scenarios import Scenario
from . import drawing as draw
from . import study
from .study import Numbers, Points, StudyResult, Sweep
from .summary import NOT_RUN, RunSummary, clearance_distance, joint_distance

BLENDS = ("priority", "additive")

#: Greatest number of samples in a row with φ ≥ 0 if a boundary is kept: in a sliding mode it is one, or two.
MAX_POSITIVE_SAMPLES = 2
MAX_EXCESS = 2.0  #: Greatest φ of a speed, whose φ is its clearance, in T_s u⁺: (43) allows one, tracking adds to it.
MIN_UNUSED = 1e-3  #: Allowed space left unused below which points are drawn at the edge [%].


class ShrinkingRegion(Sweep):
    """Potential fields with ever smaller regions beside the sliding-mode law.

    The distance to sliding mode is the root mean square of ‖q − q_SM‖ over time. How far the sliding-mode law is from
    itself at half the sampling time is the scale of what sampling alone changes: no distance below it means anything.
    """

    name = "shrinking-region"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        return RunSpec(case.scenario, draw.potential_field(case.law, case.region) if case.region else SLIDING_MODE)

    def measure(self, results: Mapping[Any, RunSummary]) -> tuple[Points, Numbers, list[str]]:
        """Distances to the sliding-mode law, by scenario, blend and region."""
        points: Points = []
        for case, run in results.items():
            reference = results.get(self.Case(case.scenario, "sliding-mode"), NOT_RUN)
            # what one sample of a row's action moves φ by, relative to its allowed range
            steps = [run.Ts * row["switching_gain"] / row["scale"] for row in run.rows.values() if row["challenged"]]
            points.append(
                study.begun(case, run)
                | {
                    "joint_distance": joint_distance(run, reference),
                    "clearance_distance": clearance_distance(run, reference),
                    "unused": 100.0 * (1.0 - run.value("utilization")),
                    "step": max(steps, default=math.nan),
                    "switching_rate": run.value("switching_rate_hz"),
                }
                | study.columns(run, "acceleration_variation", "violation_depth")
            )
        numbers: Numbers = {}
        sentences = []
        for scenario, own in study.grouped(points, "scenario").items():
            by_law = {point["law"]: point for point in own}
            floor = by_law["halved"]["joint_distance"] if "halved" in by_law else math.nan
            sliding = by_law["sliding-mode"]["unused"] if "sliding-mode" in by_law else math.nan
            numbers |= study.keyed({"sampling_distance": floor, "sliding_unused": sliding}, scenario)
            for blend in BLENDS:
                found = _shrinking([point for point in own if point["law"] == blend], floor)
                numbers |= study.keyed(found, scenario, blend)
                if "region_largest" in found:
                    sentences.append(self._blend(draw.sentence_start(scenario), blend, sliding, found))
            sentences.append(self.sentence("sampling", distance=floor))
        return points, numbers, sentences

    def _blend(self, scenario: str, blend: str, sliding: float, found: Mapping[str, float]) -> str:
        kept = not found["violation_depth"] > 0.0
        violation = self.sentence("kept" if kept else "violation", **found, depth=100.0 * found["violation_depth"])
        failed = self.sentence("failed", **found) if found["failed"] else ""
        return (
            self.sentence("blend", scenario=scenario, blend=blend, sliding=sliding, **found) + violation + failed + "."
        )

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario, one row per measure."""
        looks = {blend: draw.LOOKS[draw.potential_field(blend).name] for blend in BLENDS}
        entries = draw.law_entries(draw.potential_field(blend).name for blend in BLENDS)
        entries.append(line("sliding-mode", **REFERENCE))
        sheet, panels = draw.scenario_grid(self.table, result.points, entries)
        for (column, scenario), ax in panels.items():
            points, first = study.where(result.points, scenario=scenario), column == "joint_distance"
            by_law = {point["law"]: point for point in points}
            if math.isfinite(step := by_law.get("sliding-mode", {}).get("step", math.nan)):
                ax.axvspan(step, 1e-9, color="#F6F0DC", linewidth=0.0, zorder=0.5)
            reference = by_law.get("halved" if first else "sliding-mode", {}).get(column, math.nan)
            if math.isfinite(reference):
                ax.axhline(reference, **REFERENCE, zorder=2)
            for blend, look in looks.items():
                own = study.where(points, law=blend)
                draw.joined(ax, study.completed(own), "region", column, look.colour, look.marker)
                if first:
                    draw.failed_marks(ax, [p["region"] for p in filter(study.ended_early, own)], look.colour, 0.93)
            logarithmic(ax.xaxis, (1e-4, 1e-3, 1e-2, 1e-1))
            logarithmic(ax.yaxis, linear_below=1.0 if column == "switching_rate" else None)
            ax.set_xlim(0.8, 0.6e-4)
            if column == "switching_rate":
                ax.set_ylim(-0.1, 2.0 * ax.get_ylim()[1])
        return sheet


def _shrinking(points: Points, floor: float) -> dict[str, float]:
    """Numbers about the runs of one blend, from the largest to the smallest region."""
    own = sorted(study.completed(points), key=lambda point: -point["region"])
    found: dict[str, float] = {"runs": len(points), "failed": len(points) - len(own)}
    if not own:
        return found
    for place, point in (("largest", own[0]), ("smallest", own[-1])):
        found[f"region_{place}"] = point["region"]
        found[f"distance_{place}_region"] = point["joint_distance"]
        found[f"unused_{place}_region"] = point["unused"]
    # a rise below what sampling alone changes is none
    falls = all(b["joint_distance"] <= max(a["joint_distance"], floor) for a, b in pairwise(own))
    deepest = max(own, key=lambda point: point["violation_depth"])
    found |= {"distance_falls": falls and len(own) == len(points)}
    return found | {"violation_depth": deepest["violation_depth"], "violation_region": deepest["region"]}


class Pareto(Sweep):
    """Every law over the range of its own parameter: a factor on every u⁺, a region, or the rate α of a barrier.

    Runs are compared if they keep their boundaries: they reach the goal, no row with a σ of its own is violated, no
    speed by more than sampling explains, and φ ≥ 0 lasts for two samples at most, so that where a row acts it slides or
    stays inside. A run is on the front if it is one of these and no other both leaves less of the allowed space unused
    and varies its acceleration less. What is left unused is the least clearance of a row as a share of its
    characteristic length, averaged over the rows that tracking alone violates.
    """

    name = "pareto"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        if case.controller == "hierarchical-qp":
            return RunSpec(case.scenario, draw.hierarchical_qp(case.parameter))
        if case.strength is not None:
            blend = "additive" if case.controller == "potential-field" else "priority"
            return RunSpec(case.scenario, draw.potential_field(blend, case.parameter, case.strength))
        return RunSpec(case.scenario, draw.LAWS[case.controller], scaled_gains(case.scenario, case.parameter))

    def measure(self, results: Mapping[Any, RunSummary]) -> tuple[Points, Numbers, list[str]]:
        """Price and use of every run, and whether it is on the front."""
        points = [
            study.begun(case, run)
            | {"unused": unused(run), "not_kept": not_kept(run)}
            | study.columns(run, "acceleration_variation", "violation", "violated")
            | {"switching_rate": run.value("switching_rate_hz"), "settling_time_s": run.value("settling_time_s")}
            for case, run in results.items()
        ]
        numbers: Numbers = {}
        sentences = []
        for scenario, own in study.grouped(points, "scenario").items():
            best, laws = front(own), []
            for point in own:
                point["front"] = point in best
            for law, runs in study.grouped(own, "controller").items():
                kept = list(filter(_kept, runs))
                least = min((point["unused"] for point in kept), default=math.nan)
                found = {"least_unused": least, "on_front": sum(point["front"] for point in kept), "kept": len(kept)}
                numbers |= study.keyed(found, scenario, law)
                laws.append(f"{law} {self._least(kept, runs)}")
            for point in study.where(own, controller="sliding-mode", parameter=1.0):
                numbers |= study.keyed({"unused": point["unused"], "kept": _kept(point)}, scenario, "printed")
            on_front = ", ".join(study.grouped(best, "controller")) or "nobody"
            title = draw.sentence_start(scenario)
            sentences.append(self.sentence("scenario", scenario=title, laws="; ".join(laws), front=on_front))
        return points, numbers, sentences

    def _least(self, kept: Points, runs: Points) -> str:
        """The run that leaves least unused; if no boundary was kept, what was wrong with the shallowest violation."""
        if kept:
            best = min(kept, key=lambda point: float(point["unused"]))
            field = "" if math.isnan(best["strength"]) else self.sentence("field", **best)
            return self.sentence("least", **best | {"unused": best["unused"] / 100.0}, field=field) + (
                f" ({len(kept)} of {len(runs)} runs)"
            )
        arrived = [point for point in runs if point["status"] == "converged"]
        best = min(arrived, key=lambda point: float(point["violation"]), default={})
        why = f" (at best {best['not_kept']})" if best else ", which do not reach the goal"
        return f"none in {len(runs)} runs{why}"

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario; acceleration variation above, violation below."""
        laws = list(study.grouped(result.points, "controller"))
        points = study.completed(result.points)
        deepest = max((p["violation"] for p in points if math.isfinite(p["violation"])), default=0.0)
        entries = [*draw.law_entries(laws), draw.entry("front", INK, linewidth=2.0)]
        sheet, panels = draw.scenario_grid(self.table, result.points, entries)
        for (column, scenario), ax in panels.items():
            own = study.where(points, scenario=scenario)
            for name in laws:
                _draw_law(ax, study.where(own, controller=name), column, name)
            if column == "violation":
                logarithmic(ax.yaxis, linear_below=0.01)
                ax.set_ylim(-0.002, max(2.0 * deepest, 1.0))
            else:
                best = sorted(study.where(own, front=True), key=lambda point: point["unused"])
                steps: dict[str, Any] = {"where": "post", "color": INK, "linewidth": 2.0, "zorder": 3}
                ax.step([_x(p) for p in best], [p[column] for p in best], **steps)
                logarithmic(ax.yaxis)
            logarithmic(ax.xaxis, ())
            ax.set_xlim(1.5 * max(map(_x, own), default=1.0), 0.7 * MIN_UNUSED)
            ax.set_xticks([MIN_UNUSED, 0.01, 0.1, 1.0, 10.0], ["≤ 0.001", "0.01", "0.1", "1", "10"])
        return sheet


def scaled_gains(scenario: str, factor: float) -> dict[str, float]:
    """Overrides that multiply every u⁺ of a shipped scenario; none for the factor 1."""
    constraints = Scenario.load(scenario).tables["constraints"]
    if factor == 1.0:
        return {}
    return {f"constraints.{i}.switching_gain": factor * table["switching_gain"] for i, table in enumerate(constraints)}


def front(points: Sequence[dict[str, Any]]) -> Points:
    """The runs without violation that no other such run beats in both unused space and acceleration variation."""
    chosen: Points = []
    for point in sorted(filter(_kept, points), key=lambda p: (p["unused"], p["acceleration_variation"])):
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
            violated = row["phi_max"] > MAX_EXCESS * run.Ts * row["switching_gain"]
        else:
            violated = row["violation_depth"] > 0.0
        if violated:
            return f"{label} is violated"
        if samples > MAX_POSITIVE_SAMPLES:
            return f"{label} has φ ≥ 0 for {samples} samples in a row"
    return ""


def _kept(point: Mapping[str, Any]) -> bool:
    return not point["not_kept"] and math.isfinite(point["unused"]) and math.isfinite(point["acceleration_variation"])


def _x(point: Mapping[str, Any]) -> float:
    return max(float(point["unused"]), MIN_UNUSED)


def _draw_law(ax: Any, points: Points, column: str, name: str) -> None:
    """Large markers of the runs that keep their boundaries; the others stand behind them, small and pale."""
    look = draw.LOOKS[name]
    own = [p for p in points if math.isfinite(p["unused"]) and math.isfinite(p[column])]
    kept = symbol(look.marker, look.colour, "white", 7.0, zorder=3.5)
    others = symbol(look.marker, "none", look.colour, 3.5, alpha=0.45, zorder=2.5)
    for which, mark in ((True, kept), (False, others)):
        some = [p for p in own if bool(p["not_kept"]) != which]
        ax.plot([_x(p) for p in some], [p[column] for p in some], **mark, clip_on=False)
