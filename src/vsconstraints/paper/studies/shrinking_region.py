"""Study of potential fields with smaller and smaller regions, beside the sliding-mode law."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from ...reports.plots import Sheet, logarithmic
from .drawing import (
    DASHED,
    Measure,
    add_panels,
    draw_crosses,
    draw_levels,
    draw_line,
    law_style,
    shown,
    style_of,
)
from .laws import LAWS
from .study import Found, Results, Study, StudyResult
from .summary import NOT_RUN, RunSummary, clearance_distance, joint_distance
from .tables import Numbers, Points, about, ended_early, grouped, sentence_start, where

#: Laws with a region, by the names of their blends.
BLENDS = {"priority": "potential-field-priority", "additive": "potential-field"}


class RegionCase(NamedTuple):
    """Scenario; law, or blend of a potential field; region of the field."""

    scenario: str
    law: str
    region: float | None = None


class Scene(NamedTuple):
    """Scenario, half of its sampling time [s], and regions."""

    scenario: str
    half: float
    regions: tuple[float, ...]


SCENES = (
    Scene("example-2d-fov", 0.0025, (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.003, 0.001, 0.0001)),
    Scene("case-study-6r", 0.001, (0.5, 0.2, 0.05, 0.01, 0.003, 0.001, 0.0001)),
)
SMALL = (Scene("example-2d-fov", 0.0025, (0.5, 0.02, 0.0001)),)

MEASURES = {
    "joint_distance": Measure(label="distance to sliding mode\nin joint space, RMS [rad]"),
    "unused": Measure(label="allowed space\nleft unused [%]"),
    "switching_rate": Measure(
        label="switching rate of the\nacting rows [Hz]", linear_below=1.0, low=-0.1, headroom=2.0
    ),
}
STYLES = {blend: law_style(law) for blend, law in BLENDS.items()}
SLIDING = style_of("sliding-mode", **DASHED, zorder=2)


class ShrinkingRegion(Study):
    """Potential fields with smaller and smaller regions, compared with the sliding-mode law.

    The distance to sliding mode is the root mean square of ‖q − q_SM‖ over time. The distance of
    the sliding-mode law to itself at half the sampling time is the effect of sampling alone:
    smaller distances are not significant.
    """

    name = "shrinking-region"
    title = "Shrinking the potential field's region"
    question = "Does a potential field become the sliding-mode law as its repulsion region shrinks?"
    claims = (8, 7)
    columns = (
        "status",
        "reason",
        "joint_distance",
        "clearance_distance",
        "unused",
        "step",
        "switching_rate",
        "acceleration_variation",
        "violation_depth",
    )
    figure_caption = (
        "Potential fields against the size of their influence region, as a fraction of each row's "
        "allowed range. Dashed: the sliding-mode law; in the upper panels its distance to itself "
        "at half the sampling time. Shaded: regions smaller than T_s u⁺, the step of φ in one "
        "sample. A cross marks a run that failed."
    )

    def runs(self, *, small: bool = False) -> dict[RegionCase, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""
        runs = {}
        for scenario, half, regions in SMALL if small else SCENES:
            runs[RegionCase(scenario, "sliding-mode")] = RunSpec(scenario)
            halved = RunSpec(scenario, overrides={"sampling_time": half})
            runs[RegionCase(scenario, "halved")] = halved
            for blend, law in BLENDS.items():
                for region in regions:
                    spec = RunSpec(scenario, LAWS[law].changed("region", region))
                    runs[RegionCase(scenario, blend, region)] = spec
        return runs

    def lines(self, case: RegionCase, run: RunSummary, results: Results) -> Points:
        """Distances of the run to the sliding-mode law, and greatest step of φ.

        The step is the change of φ by one sample of a row's action, relative to the row's range.
        """
        reference = results.get(RegionCase(case.scenario, "sliding-mode"), NOT_RUN)
        steps = [
            run.Ts * row["switching_gain"] / row["scale"]
            for row in run.rows.values()
            if row["challenged"]
        ]
        return [
            {
                "joint_distance": joint_distance(run, reference),
                "clearance_distance": clearance_distance(run, reference),
                "unused": 100.0 * (1.0 - run.value("utilization")),
                "step": max(steps, default=math.nan),
            }
        ]

    def numbers(self, points: Points) -> Found:
        """Distances to the sliding-mode law, by scenario, blend and region."""
        numbers: dict[tuple[Any, ...], Mapping[Any, float]] = {}
        for scenario, of_scenario in grouped(points, "scenario").items():
            by_law = grouped(of_scenario, "law")
            floor, unused = (
                float(by_law[law][0][column]) if law in by_law else math.nan
                for law, column in (("halved", "joint_distance"), ("sliding-mode", "unused"))
            )
            numbers[scenario,] = {"sampling_distance": floor, "sliding_unused": unused}
            for blend in BLENDS:
                numbers[scenario, blend] = shrinking(by_law.get(blend, []), floor)
        return numbers

    def sentences(self, points: Points, numbers: Numbers) -> list[str]:
        """Return the sentences of the result."""
        sentences = []
        for scenario in grouped(points, "scenario"):
            sliding = about(numbers, scenario)
            for blend in BLENDS:
                found = about(numbers, scenario, blend)
                if "region_largest" in found:
                    text = described(found, sliding["sliding_unused"])
                    sentences.append(f"{sentence_start(scenario)}, {blend} blend: {text}")
            sentences.append(
                "Half the sampling time moves the sliding-mode law itself by "
                f"{number(sliding['sampling_distance'])} rad there."
            )
        return sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Draw each measure over the region, beside that of the sliding-mode law."""
        points = list(result.points)
        sheet = Sheet(left=0.95)
        sheet.legend([*STYLES.values(), SLIDING])
        below = "region δ, relative to the allowed range (smaller →)"
        for panel in add_panels(sheet, points, MEASURES, below, height=1.45, gap=0.75):
            ax = panel.ax
            is_distance = panel.measure == "joint_distance"
            sliding = where(panel.points, law="sliding-mode")
            for point in shown(sliding, "step"):
                ax.axvspan(point["step"], 1e-9, color="#F6F0DC", linewidth=0.0, zorder=0.5)
            for blend, style in STYLES.items():
                runs = where(panel.points, law=blend)
                draw_line(ax, runs, "region", panel.measure, style)
                if is_distance:
                    draw_crosses(ax, runs, "region", style)
            level = where(panel.points, law="halved") if is_distance else sliding
            draw_levels(ax, level, panel.measure, SLIDING)
            logarithmic(ax.xaxis, (1e-4, 1e-3, 1e-2, 1e-1))
            MEASURES[panel.measure].finish(ax)
            ax.set_xlim(0.8, 0.6e-4)
        return sheet


def described(of: Mapping[str | float, float], sliding_unused: float) -> str:
    """Words for the numbers about a scenario and a blend."""
    violation = "it violates nothing"
    if of["violation_depth"] > 0:
        violation = (
            f"its deepest violation is {number(100 * of['violation_depth'])} % of L, "
            f"with the region {of['violation_region']:g}"
        )
    failed = f"; {of['failed']:.0f} of its {of['runs']:.0f} runs failed" if of["failed"] else ""
    return (
        f"{number(of['distance_largest_region'])} rad (RMS) from the sliding-mode law with the "
        f"region {of['region_largest']:g}, {number(of['distance_smallest_region'])} rad with "
        f"{of['region_smallest']:g}. It leaves {number(of['unused_largest_region'])} % and "
        f"{number(of['unused_smallest_region'])} % of the allowed space unused "
        f"(sliding mode: {number(sliding_unused)} %); {violation}{failed}."
    )


def shrinking(points: Points, floor: float) -> dict[str, float]:
    """Numbers about the runs of one blend, from the largest to the smallest region."""
    ordered = sorted(
        [point for point in points if not ended_early(point)], key=lambda point: -point["region"]
    )
    found: dict[str, float] = {"runs": len(points), "failed": len(points) - len(ordered)}
    if not ordered:
        return found
    for place, point in (("largest", ordered[0]), ("smallest", ordered[-1])):
        found[f"region_{place}"] = point["region"]
        found[f"distance_{place}_region"] = point["joint_distance"]
        found[f"unused_{place}_region"] = point["unused"]
    # a rise smaller than the effect of sampling alone does not count
    falls = all(
        b["joint_distance"] <= max(a["joint_distance"], floor) for a, b in pairwise(ordered)
    )
    deepest = max(ordered, key=lambda point: float(point["violation_depth"]))
    return found | {
        "distance_falls": falls and len(ordered) == len(points),
        "violation_depth": deepest["violation_depth"],
        "violation_region": deepest["region"],
    }
