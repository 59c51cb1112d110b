"""Study of the sampling time against the chattering band."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from ...reports.plots import Sheet, logarithmic
from .drawing import BELOW_LEGEND, DASHED, Measure, draw_line, style_of
from .study import Found, Results, Study, StudyResult
from .summary import RunSummary
from .tables import Numbers, Point, Points, about, greatest, grouped, where

SLOW, FAST = BAND_SCENARIOS = ("example-2d-fov", "example-2d-fast-high-gain")
ROW_SCENARIO = "case-study-6r"


class TimeCase(NamedTuple):
    """Scenario and sampling time [ms]."""

    scenario: str
    Ts_ms: float


#: Sampling times by scenario [ms].
TIMES = {
    SLOW: (1.25, 2.5, 5.0, 10.0, 20.0, 40.0),
    FAST: (1.0, 2.5, 5.0, 10.0, 20.0, 40.0),
    ROW_SCENARIO: (1.0, 2.0, 4.0, 8.0, 16.0),
}
SMALL_TIMES = {FAST: (2.5, 5.0, 10.0)}

BANDS = {
    SLOW: style_of("first example, u⁺ = 10 /s", marker="o"),
    FAST: style_of("first example, fast, u⁺ = 50 /s", "#8A8A8A", marker="s"),
}
ROWS = (
    ("#0072B2", "o"),
    ("#56B4E9", "s"),
    ("#009E73", "^"),
    ("#D55E00", "D"),
    ("#CC79A7", "v"),
    ("#E69F00", "P"),
    ("#000000", "X"),
    ("#9C8A00", "<"),
)
"""Colours and symbols of the rows of the case study."""
BOUNDS = {
    "bound_43": style_of("Tₛ u⁺ (43)", **DASHED),
    "band_expected": style_of("Tₛ (u⁺ + push of tracking)", linestyle=":"),
}
#: Ticks of the sampling times of the first example, and of the case study [ms].
TICKS = (1.0, 2.5, 5.0, 10.0, 20.0, 40.0)
ROW_TICKS = (1.0, 2.0, 4.0, 8.0, 16.0)


class SamplingTime(Study):
    """The sliding-mode law with different sampling times and no other change.

    (43) bounds one step of the constraint action alone: T_s u⁺. In the last sample before a row
    becomes active, tracking moves φ by up to T_s (L_fφ + L_gφ q̈): this is the part of the band
    above zero, and the sum of both is the expected band.
    """

    name = "sampling-time"
    title = "Sampling time against the chattering band"
    question = "Does the chattering band shrink with the sampling time as (43) says?"
    claims = (10, 2)
    columns = (
        "status",
        "reason",
        "row",
        "band",
        "bound_43",
        "band_expected",
        "phi_max",
        "longest_run",
        "violation_depth",
        "relative_overshoot",
    )
    drift_noted = True
    figure_caption = (
        "Left: peak-to-peak φ while sliding, with the bound (43) and what tracking adds in one "
        "sample. Middle: greatest φ of each row of the case study relative to its T_s u⁺. Right: "
        "most samples in a row with φ ≥ 0."
    )

    def runs(self, *, small: bool = False) -> dict[TimeCase, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""
        shorter = {"duration": 4.0} if small else {}
        return {
            TimeCase(scenario, Ts): RunSpec(
                scenario, overrides={"sampling_time": Ts / 1e3, **shorter}
            )
            for scenario, times in (SMALL_TIMES if small else TIMES).items()
            for Ts in times
        }

    def lines(self, case: TimeCase, run: RunSummary, results: Results) -> Points:
        """Measured and expected band of the run, and each active row of the case study."""
        bound = run.value("phi_band_bound")
        bands = {
            "band": run.value("phi_band"),
            "bound_43": bound,
            "band_expected": bound + run.Ts * run.entry_push,
        }
        rows = run.rows.values() if case.scenario == ROW_SCENARIO else ()
        acting = [row for row in rows if row["active_time_s"] > 0]
        return [{"row": "", **bands}, *(row_line(row, run.Ts) for row in acting)]

    def numbers(self, points: Points) -> Found:
        """Growth of the bands in each scenario, and overshoot of the rows of the case study.

        The overshoot is given by its size and its duration.
        """
        numbers: dict[tuple[Any, ...], dict[Any, float]] = {}
        for scenario in BAND_SCENARIOS:
            of_scenario = where(points, scenario=scenario, row="")
            of_scenario = [point for point in of_scenario if math.isfinite(point["band"])]
            if of_scenario:
                numbers[scenario,] = growth(of_scenario)
                numbers[scenario, "band"] = {point["Ts_ms"]: point["band"] for point in of_scenario}
        if rows := [point for point in points if point["row"]]:
            longest = max(rows, key=lambda point: float(point["longest_run"]))
            numbers[ROW_SCENARIO,] = {
                "longest_run": longest["longest_run"],
                "longest_run_ms": longest["longest_run"] * longest["Ts_ms"],
                "greatest_overshoot": greatest(rows, "relative_overshoot"),
            }
        return numbers

    def sentences(self, points: Points, numbers: Numbers) -> list[str]:
        """Return the sentences of the result."""
        sentences = []
        for scenario in BAND_SCENARIOS:
            of = about(numbers, scenario)
            if "exponent" in of:
                sentences.append(
                    f"In {scenario} the band grows with the power {of['exponent']:.2f} of the "
                    f"sampling time. It is {of['least_excess']:.2f} to "
                    f"{of['greatest_excess']:.2f} times the bound (43), and at most "
                    f"{of['greatest_share_of_expected']:.2f} times that with what tracking adds in "
                    f"one sample; the longest run of φ ≥ 0 is {of['longest_run']:g} samples."
                )
        slow = about(numbers, SLOW, "band")
        fast = about(numbers, FAST, "band")
        if 5.0 in slow and 1.0 in fast:
            sentences.append(
                "The fast motion with five times the switching gain has the band "
                f"{number(fast[1.0])} at 1 ms; the slow one has {number(slow[5.0])} at 5 ms: to "
                "keep the band, the sampling time must fall as the gain rises."
            )
        if of := about(numbers, ROW_SCENARIO):
            sentences.append(
                f"In the case study the greatest φ is {of['greatest_overshoot']:.2f} times its "
                f"T_s u⁺; one row stays at φ ≥ 0 for {of['longest_run']:g} samples "
                f"({number(of['longest_run_ms'])} ms) in a row."
            )
        return sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Draw the band, the overshoot of rows, and the samples in a row, over the time."""
        points = list(result.points)
        bands = grouped(where(points, row="", scenario=[*BAND_SCENARIOS]), "scenario")
        rows = grouped([point for point in points if point["row"]], "row")
        row_styles = {}
        for row, (colour, marker) in zip(rows, ROWS, strict=False):
            row_styles[row] = style_of(row, colour, marker=marker) | {"markersize": 4.5}
        band_styles = {name: style for name, style in BANDS.items() if name in bands}
        sheet = Sheet(left=0.65)
        sheet.legend([*band_styles.values(), *row_styles.values(), *BOUNDS.values()])
        sheet.bottom += BELOW_LEGEND
        labels = ("sampling time Tₛ [ms]", "")
        band, overshoot, longest = sheet.panels(3, 3, height=2.3, gap=0.62, labels=labels)
        for name, style in band_styles.items():
            draw_line(band, bands[name], "Ts_ms", "band", style)
            draw_line(longest, bands[name], "Ts_ms", "longest_run", style)
        for row, style in row_styles.items():
            draw_line(overshoot, rows[row], "Ts_ms", "relative_overshoot", style)
            draw_line(longest, rows[row], "Ts_ms", "longest_run", style)
        for column, style in BOUNDS.items():
            for name, of_scenario in bands.items():
                coloured = style | {"color": BANDS[name]["color"]}
                draw_line(band, of_scenario, "Ts_ms", column, coloured)
        band.set_title("band of φ while sliding")
        overshoot.set_title("case study: greatest φ / (Tₛ u⁺)")
        longest.set_title("samples in a row with φ ≥ 0")
        for ax, ticks in ((band, TICKS), (overshoot, ROW_TICKS), (longest, TICKS)):
            logarithmic(ax.xaxis, ticks)
        Measure().finish(band)
        Measure(linear=True, level=1.0, low=0.0).finish(overshoot)
        Measure(ticks=(1.0, 2.0, 5.0, 10.0, 20.0)).finish(longest)
        return sheet


def row_line(row: Mapping[str, Any], Ts: float) -> Point:
    """Columns of a row of the case study."""
    step = Ts * row["switching_gain"]
    return {
        "row": row["constraint"],
        "bound_43": step,
        "phi_max": row["phi_max"],
        "relative_overshoot": row["phi_max"] / step,
        "longest_run": float(round(row["longest_positive_run_s"] / Ts)),
        "violation_depth": row["violation_depth"],
    }


def growth(points: Points) -> dict[str, float]:
    """Bands of a scenario relative to expected ones, and their growth with the sampling time."""
    names = ("Ts_ms", "band", "bound_43", "band_expected")
    Ts, band, bound, expected = (np.array([point[name] for point in points]) for name in names)
    found = {
        "least_excess": (band / bound).min(),
        "greatest_excess": (band / bound).max(),
        "greatest_share_of_expected": (band / expected).max(),
        "longest_run": greatest(points, "longest_run"),
    }
    if len(points) > 1:
        found["exponent"] = np.polyfit(np.log(Ts), np.log(band), 1)[0]
    return found
