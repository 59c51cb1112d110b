"""Potential fields that become the sliding-mode law, and what each law pays for using the allowed space."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, ClassVar

from ...comparisons.runs.spec import SLIDING_MODE, RunSpec
from ...reports.plots import INK, REFERENCE, Look, Sheet, line, symbol
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

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """Its distances to the sliding-mode law, and what one sample of a row's action moves φ by in its range."""
        reference = results.get(self.Case(case.scenario, "sliding-mode"), NOT_RUN)
        steps = [run.Ts * row["switching_gain"] / row["scale"] for row in run.rows.values() if row["challenged"]]
        return {
            "joint_distance": joint_distance(run, reference),
            "clearance_distance": clearance_distance(run, reference),
            "unused": 100.0 * (1.0 - run.value("utilization")),
            "step": max(steps, default=math.nan),
        }

    def numbers(self, points: Points) -> Numbers:
        """Distances to the sliding-mode law, by scenario, blend and region."""
        numbers: Numbers = {}
        for scenario, own in study.grouped(points, "scenario").items():
            by_law = study.grouped(own, "law")
            floor = _only(by_law, "halved", "joint_distance")
            found = {"sampling_distance": floor, "sliding_unused": _only(by_law, "sliding-mode", "unused")}
            numbers |= study.keyed(found, scenario)
            for blend in BLENDS:
                numbers |= study.keyed(_shrinking(by_law.get(blend, []), floor), scenario, blend)
        return numbers

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario, one row per measure."""
        looks = {blend: draw.LOOKS[draw.potential_field(blend).name] for blend in BLENDS}
        entries = draw.law_entries(draw.potential_field(blend).name for blend in BLENDS)
        panels = draw.Panels(self.table, result.points, [*entries, line("sliding-mode", **REFERENCE)])
        for ax, column, points in panels:
            by_law, distance = study.grouped(points, "law"), column == "joint_distance"
            if math.isfinite(step := _only(by_law, "sliding-mode", "step")):
                ax.axvspan(step, 1e-9, color="#F6F0DC", linewidth=0.0, zorder=0.5)
            if math.isfinite(reference := _only(by_law, "halved" if distance else "sliding-mode", column)):
                ax.axhline(reference, **REFERENCE, zorder=2)
            for blend, look in looks.items():
                draw.joined(ax, by_law.get(blend, []), "region", column, look.colour, look.marker)
                if distance:
                    draw.failed_marks(ax, by_law.get(blend, []), "region", look.colour)
        return panels.sheet


def _only(by_law: Mapping[str, Points], law: str, column: str) -> float:
    """What the only run of a law has in a column; NaN if there is no such run."""
    return float(by_law[law][0][column]) if law in by_law else math.nan


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


def kept(points: Iterable[dict[str, Any]]) -> Points:
    """Points of runs that keep their boundaries, and have both what is compared."""
    return [p for p in points if not p["not_kept"] and math.isfinite(p["unused"] + p["acceleration_variation"])]


class Pareto(Sweep):
    """Every law over the range of its own parameter: a factor on every u⁺, a region, or the rate α of a barrier.

    Runs are compared if they keep their boundaries: they reach the goal, no row with a σ of its own is violated, no
    speed by more than sampling explains, and φ ≥ 0 lasts for two samples at most, so that where a row acts it slides or
    stays inside. A run is on the front if it is one of these and no other both leaves less of the allowed space unused
    and varies its acceleration less. What is left unused is the least clearance of a row as a share of its
    characteristic length, averaged over the rows that tracking alone violates.
    """

    name = "pareto"
    helpers: ClassVar[dict[str, Any]] = {"kept": kept}

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        if case.controller == "hierarchical-qp":
            return RunSpec(case.scenario, draw.hierarchical_qp(case.parameter))
        if case.strength is not None:
            blend = "additive" if case.controller == "potential-field" else "priority"
            return RunSpec(case.scenario, draw.potential_field(blend, case.parameter, case.strength))
        return RunSpec(case.scenario, draw.LAWS[case.controller], scaled_gains(case.scenario, case.parameter))

    def line(self, case: Any, run: RunSummary, results: Mapping[Any, RunSummary]) -> dict[str, Any]:
        """What it leaves unused, and why it is not compared."""
        return {"unused": unused(run), "not_kept": not_kept(run)}

    def points(self, results: Mapping[Any, RunSummary]) -> Points:
        """Price and use of every run, and whether it is on the front."""
        points = super().points(results)
        best = [point for own in study.grouped(points, "scenario").values() for point in front(own)]
        return [point | {"front": point in best} for point in points]

    def numbers(self, points: Points) -> Numbers:
        """What each law leaves unused at best, and how many of its runs are compared, and on the front."""
        numbers: Numbers = {}
        for scenario, own in study.grouped(points, "scenario").items():
            for law, runs in study.grouped(own, "controller").items():
                compared = kept(runs)
                least = min((point["unused"] for point in compared), default=math.nan)
                found = {"least_unused": least, "on_front": sum(p["front"] for p in compared), "kept": len(compared)}
                numbers |= study.keyed(found, scenario, law)
            for point in study.where(own, controller="sliding-mode", parameter=1.0):
                numbers |= study.keyed({"unused": point["unused"], "kept": bool(kept([point]))}, scenario, "printed")
        return numbers

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario; acceleration variation above, violation below."""
        laws = list(study.grouped(result.points, "controller"))
        entries = [*draw.law_entries(laws), draw.entry("front", INK, linewidth=2.0)]
        panels = draw.Panels(self.table, result.points, entries)
        for ax, column, points in panels:
            finite = [point for point in study.completed(points) if math.isfinite(point["unused"])]
            own = [point | {"unused": max(float(point["unused"]), MIN_UNUSED)} for point in finite]
            for name in laws:
                _draw_law(ax, study.where(own, controller=name), column, draw.LOOKS[name])
            if column == "acceleration_variation":
                best = sorted(study.where(own, front=True), key=lambda point: point["unused"])
                steps: dict[str, Any] = {"where": "post", "color": INK, "linewidth": 2.0, "zorder": 3}
                ax.step([p["unused"] for p in best], [p[column] for p in best], **steps)
            ax.set_xlim(1.5 * max((p["unused"] for p in own), default=1.0), 0.7 * MIN_UNUSED)
        deepest = study.greatest(study.completed(result.points), "violation")
        for (column, _), ax in panels.axes.items():
            if column == "violation":
                ax.set_ylim(-0.002, max(1.0, 2.0 * deepest))  # 1 if there is none
            ax.set_xticks([MIN_UNUSED, 0.01, 0.1, 1.0, 10.0], ["≤ 0.001", "0.01", "0.1", "1", "10"])
        return panels.sheet


def scaled_gains(scenario: str, factor: float) -> dict[str, float]:
    """Overrides that multiply every u⁺ of a shipped scenario; none for the factor 1."""
    constraints = Scenario.load(scenario).tables["constraints"]
    if factor == 1.0:
        return {}
    return {f"constraints.{i}.switching_gain": factor * table["switching_gain"] for i, table in enumerate(constraints)}


def front(points: Sequence[dict[str, Any]]) -> Points:
    """The runs without violation that no other such run beats in both unused space and acceleration variation."""
    chosen: Points = []
    for point in sorted(kept(points), key=lambda p: (p["unused"], p["acceleration_variation"])):
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


def _draw_law(ax: Any, points: Points, column: str, look: Look) -> None:
    """Large markers of the runs that keep their boundaries; the others stand behind them, small and pale."""
    large = symbol(look.marker, look.colour, "white", 7.0, zorder=3.5)
    small = symbol(look.marker, "none", look.colour, 3.5, alpha=0.45, zorder=2.5)
    for mark, compared in ((large, True), (small, False)):
        own = [p for p in points if bool(p["not_kept"]) != compared and math.isfinite(p[column])]
        ax.plot([p["unused"] for p in own], [p[column] for p in own], **mark, clip_on=False)
