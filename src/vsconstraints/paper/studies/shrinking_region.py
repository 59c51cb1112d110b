"""Potential fields with ever smaller regions, which become the sliding-mode law."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from ...reports.plots import REFERENCE, Sheet, line, logarithmic
from .drawing import LOOKS, controller_entries, failed_marks, joined, scenario_panels, sentence_start
from .laws import potential_field
from .points import Measured, Numbers, Points, ended_early, grouped, through, under, where
from .study import Study, StudyResult, begun
from .summary import NOT_RUN, RunSummary, clearance_distance, joint_distance

BLENDS = ("priority", "additive")
REGIONS = {
    "example-2d-fov": (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.003, 0.001, 0.0001),
    "case-study-6r": (0.5, 0.2, 0.05, 0.01, 0.003, 0.001, 0.0001),
}
"""Of both blends."""

HALVED = {"example-2d-fov": 0.0025, "case-study-6r": 0.001}
"""Half of each scenario's sampling time [s]."""

ROWS = (
    ("joint_distance", "distance to sliding mode\nin joint space, RMS [rad]"),
    ("unused", "allowed space\nleft unused [%]"),
    ("switching_rate", "switching rate of the\nacting rows [Hz]"),
)


class Case(NamedTuple):
    """A scenario with ``sliding-mode``, with half of the sampling time (``halved``), or a blend and its region."""

    scenario: str
    law: str
    region: float | None = None


class ShrinkingRegion(Study):
    """Potential fields with ever smaller regions beside the sliding-mode law.

    The distance to sliding mode is the root mean square of ‖q − q_SM‖ over time. How far the sliding-mode law is from
    itself at half the sampling time is the scale of what sampling alone changes: no distance below it means anything.
    """

    name = "shrinking-region"
    title = "Shrinking the potential field's region"
    question = "Does a potential field become the sliding-mode law as its repulsion region shrinks?"
    claims = (8, 7)
    figure_caption = (
        "Potential fields against the size of their influence region, as a fraction of each row's allowed range. "
        "Dashed: the sliding-mode law; in the upper panels its distance to itself at half the sampling time. Shaded: "
        "regions smaller than T_s u⁺, the step of φ in one sample. A cross marks a run that failed."
    )

    def runs(self, *, small: bool = False) -> dict[Case, RunSpec]:
        """The sliding-mode law, also at half the sampling time, and both blends with every region."""
        runs = {}
        for scenario, regions in REGIONS.items():
            if small and scenario != "example-2d-fov":
                continue
            runs[Case(scenario, "sliding-mode")] = RunSpec(scenario)
            runs[Case(scenario, "halved")] = RunSpec(scenario, overrides={"sampling_time": HALVED[scenario]})
            for blend in BLENDS:
                for region in (0.5, 0.02, 0.0001) if small else regions:
                    runs[Case(scenario, blend, region)] = RunSpec(scenario, potential_field(blend, region))
        return runs

    def measure(self, results: Mapping[Case, RunSummary]) -> Measured:
        """Distances to the sliding-mode law, by scenario, blend and region."""
        points: Points = []
        for case, run in results.items():
            reference = results.get(Case(case.scenario, "sliding-mode"), NOT_RUN)
            points.append(
                {
                    **begun(case, run),
                    "joint_distance": joint_distance(run, reference),
                    "clearance_distance": clearance_distance(run, reference),
                    "unused": 100.0 * (1.0 - run.value("utilization")),
                    "step": _step(run),
                    "switching_rate": run.value("switching_rate_hz"),
                    "acceleration_variation": run.value("acceleration_variation"),
                    "violation_depth": run.value("violation_depth"),
                }
            )
        numbers: Numbers = {}
        sentences = []
        for scenario, own in grouped(points, "scenario").items():
            of = {point["law"]: point for point in own}
            floor = of["halved"]["joint_distance"] if "halved" in of else math.nan
            unused = of["sliding-mode"]["unused"] if "sliding-mode" in of else math.nan
            numbers |= under({"sampling_distance": floor, "sliding_unused": unused}, scenario)
            for blend in BLENDS:
                found = _shrunk([point for point in own if point["law"] == blend], floor)
                numbers |= under(found, scenario, blend)
                if "region_largest" in found:
                    sentences.append(f"{sentence_start(scenario)}, {blend} blend: {_said(found, unused)}.")
            sentences.append(f"Half the sampling time moves the sliding-mode law itself by {number(floor)} rad there.")
        return points, numbers, sentences

    def figure(self, result: StudyResult) -> Sheet:
        """One column per scenario; rows as in ``ROWS``."""
        sheet = Sheet(left=0.95)
        names = [potential_field(blend).name for blend in BLENDS]
        sheet.legend([*controller_entries(names), line("sliding-mode", **REFERENCE)])
        labels = [label for _, label in ROWS]
        scenarios = list(grouped(result.points, "scenario"))
        below = "region δ, relative to the allowed range (smaller →)"
        panels = scenario_panels(sheet, scenarios, labels, below, height=1.45, gap=0.75)
        for (i, scenario), ax in panels.items():
            _panel(ax, where(result.points, scenario=scenario), ROWS[i][0])
        return sheet


def _step(run: RunSummary) -> float:
    """Greatest T_s u⁺ of a challenged row, relative to its allowed range: what one sample of its action moves φ by."""
    steps = [run.Ts * row["switching_gain"] / row["scale"] for row in run.rows.values() if row["challenged"]]
    return max(steps, default=math.nan)


def _panel(ax: Any, points: Points, column: str) -> None:
    step = next((p["step"] for p in where(points, law="sliding-mode")), math.nan)
    if math.isfinite(step):
        ax.axvspan(step, 1e-9, color="#F6F0DC", linewidth=0.0, zorder=0.5)
    itself = "halved" if column == "joint_distance" else "sliding-mode"
    reference = next((p[column] for p in where(points, law=itself)), math.nan)
    if math.isfinite(reference):
        ax.axhline(reference, **REFERENCE, zorder=2)
    for blend in BLENDS:
        own, look = where(points, law=blend), LOOKS[potential_field(blend).name]
        joined(ax, through(own), "region", column, look.colour, look.marker)
        if column == ROWS[0][0]:
            failed_marks(ax, [p["region"] for p in filter(ended_early, own)], look.colour, 0.93)
    logarithmic(ax.xaxis, (1e-4, 1e-3, 1e-2, 1e-1))
    logarithmic(ax.yaxis, linear_below=1.0 if column == "switching_rate" else None)
    ax.set_xlim(0.8, 0.6e-4)
    if column == "switching_rate":
        ax.set_ylim(-0.1, 2.0 * ax.get_ylim()[1])


def _shrunk(points: Points, floor: float) -> dict[str, float]:
    """What the runs of one blend say, from the largest to the smallest region."""
    own = sorted((p for p in points if not ended_early(p)), key=lambda point: -point["region"])
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
    return found | {
        "distance_falls": falls and len(own) == len(points),
        "violation_depth": deepest["violation_depth"],
        "violation_region": deepest["region"],
    }


def _said(of: Mapping[str, float], sliding_unused: float) -> str:
    violation = (
        f"its deepest violation is {number(100.0 * of['violation_depth'])} % of L, with the region "
        f"{of['violation_region']:g}"
        if of["violation_depth"] > 0.0
        else "it violates nothing"
    )
    failed = f"; {of['failed']:.0f} of its {of['runs']:.0f} runs failed" if of["failed"] else ""
    return (
        f"{number(of['distance_largest_region'])} rad (RMS) from the sliding-mode law with the region "
        f"{of['region_largest']:g}, {number(of['distance_smallest_region'])} rad with {of['region_smallest']:g}. It "
        f"leaves {number(of['unused_largest_region'])} % and {number(of['unused_smallest_region'])} % of the allowed "
        f"space unused (sliding mode: {number(sliding_unused)} %); {violation}{failed}"
    )
