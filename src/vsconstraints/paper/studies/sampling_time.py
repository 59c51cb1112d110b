"""Study of the sampling time against the chattering band."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from .drawing import Layer, Measure, SweepFigure
from .study import Found, Results, Sweep
from .summary import RunSummary
from .tables import Numbers, Points, about, greatest, where

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

IN_BANDS = {"row": "", "scenario": [*BAND_SCENARIOS]}
FIGURE = SweepFigure(
    x="Ts_ms",
    below="sampling time Tₛ [ms]",
    columns=3,
    left=0.65,
    height=2.3,
    gap=0.62,
    measures={
        "band": Measure(title="band of φ while sliding", below=(1, 2.5, 5, 10, 20, 40)),
        "relative_overshoot": Measure(
            title="case study: greatest φ / (Tₛ u⁺)",
            below=(1, 2, 4, 8, 16),
            linear=True,
            level=1.0,
            low=0.0,
        ),
        "longest_run": Measure(
            title="samples in a row with φ ≥ 0",
            below=(1, 2.5, 5, 10, 20, 40),
            ticks=(1, 2, 5, 10, 20),
        ),
    },
    layers=(
        Layer(by="scenario", where=IN_BANDS),
        Layer(
            by="row",
            on=("relative_overshoot", "longest_run"),
            palette=(
                ("#0072B2", "o"),
                ("#56B4E9", "s"),
                ("#009E73", "^"),
                ("#D55E00", "D"),
                ("#CC79A7", "v"),
                ("#E69F00", "P"),
                ("#000000", "X"),
                ("#9C8A00", "<"),
            ),
            look={"markersize": 4.5},
        ),
        Layer(
            by="scenario",
            where=IN_BANDS,
            on=("band",),
            y="bound_43",
            reference=True,
            look={"marker": "", "label": "Tₛ u⁺ (43)"},
        ),
        Layer(
            by="scenario",
            where=IN_BANDS,
            on=("band",),
            y="band_expected",
            look={"marker": "", "linestyle": ":", "label": "Tₛ (u⁺ + push of tracking)"},
        ),
    ),
    looks={
        SLOW: {"color": "#222222", "marker": "o", "label": "first example, u⁺ = 10 /s"},
        FAST: {"color": "#8A8A8A", "marker": "s", "label": "first example, fast, u⁺ = 50 /s"},
    },
)


class SamplingTime(Sweep):
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
    Case = TimeCase
    layout = FIGURE

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

    def lines(self, case: TimeCase, run: RunSummary, results: Results) -> list[dict[str, Any]]:
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


def row_line(row: Mapping[str, Any], Ts: float) -> dict[str, Any]:
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
