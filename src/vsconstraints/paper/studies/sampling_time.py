"""The chattering band against the sampling time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from ...reports.plots import INK, REFERENCE, Sheet, line, logarithmic
from .drawing import entry, joined, scenario_title
from .points import Measured, Numbers, Points, greatest, grouped, under, where
from .study import Study, StudyResult, begun
from .summary import RunSummary

BAND_SCENARIOS = {"example-2d-fov": ("#222222", "o"), "example-2d-fast-high-gain": ("#8A8A8A", "s")}
ROW_SCENARIO = "case-study-6r"
SAMPLING_TIMES = {
    "example-2d-fov": (1.25, 2.5, 5.0, 10.0, 20.0, 40.0),
    "example-2d-fast-high-gain": (1.0, 2.5, 5.0, 10.0, 20.0, 40.0),
    ROW_SCENARIO: (1.0, 2.0, 4.0, 8.0, 16.0),
}
"""[ms]"""

ROW_COLOURS = ("#0072B2", "#56B4E9", "#009E73", "#D55E00", "#CC79A7", "#E69F00", "#000000", "#9C8A00")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<")


class Case(NamedTuple):
    """A scenario and its sampling time [ms]."""

    scenario: str
    Ts_ms: float


class SamplingTime(Study):
    """The sliding-mode law with different sampling times, nothing else changed.

    (43) bounds one step of the constraint action alone: T_s u⁺. In the last sample before a row becomes active,
    tracking moves φ by up to T_s (L_fφ + L_gφ q̈): that is what the band has above zero, and the sum is what to expect.
    """

    name = "sampling-time"
    title = "Sampling time against the chattering band"
    question = "Does the chattering band shrink with the sampling time as (43) says?"
    claims = (10, 2)
    drift_noted = True
    figure_caption = (
        "Left: peak-to-peak φ while sliding, with the bound (43) and what tracking adds in one sample. Middle: "
        "greatest φ of each row of the case study relative to its T_s u⁺. Right: most samples in a row with φ ≥ 0."
    )

    def runs(self, *, small: bool = False) -> dict[Case, RunSpec]:
        """Every scenario with every sampling time."""
        times = {"example-2d-fast-high-gain": (2.5, 5.0, 10.0)} if small else SAMPLING_TIMES
        shorter = {"duration": 4.0} if small else {}
        return {
            Case(scenario, time): RunSpec(scenario, overrides={"sampling_time": time / 1e3, **shorter})
            for scenario, own in times.items()
            for time in own
        }

    def measure(self, results: Mapping[Case, RunSummary]) -> Measured:
        """Bands and bounds of every run, and one line more for each row of the case study that was active."""
        points: Points = []
        for case, run in results.items():
            common, bound = begun(case, run), run.value("phi_band_bound")
            points.append(
                {
                    **common,
                    "row": "",
                    "band": run.value("phi_band"),
                    "bound_43": bound,
                    "band_expected": bound + run.Ts * run.entry_push,
                    "phi_max": run.phi_max,
                    "longest_run": float(run.longest_run),
                    "violation_depth": run.value("violation_depth"),
                }
            )
            if case.scenario == ROW_SCENARIO:
                points += [common | _row_point(row, run.Ts) for row in run.rows.values() if row["active_time_s"] > 0]
        numbers: Numbers = {}
        sentences = []
        banded = grouped([p for p in points if not p["row"] and math.isfinite(p["band"])], "scenario")
        for scenario in BAND_SCENARIOS:
            if scenario not in banded:
                continue
            found = _band(banded[scenario])
            numbers |= under(found, scenario)
            numbers |= {(scenario, "band", p["Ts_ms"]): p["band"] for p in banded[scenario]}
            if "exponent" in found:
                sentences.append(
                    f"In {scenario} the band grows with the power {found['exponent']:.2f} of the sampling time. It is "
                    f"{found['least_excess']:.2f} to {found['greatest_excess']:.2f} times the bound (43), and at most "
                    f"{found['greatest_share_of_expected']:.2f} times that with what tracking adds in one sample; the "
                    f"longest run of φ ≥ 0 is {found['longest_run']:g} samples."
                )
        slow, fast = (
            numbers.get((scenario, "band", Ts)) for scenario, Ts in zip(BAND_SCENARIOS, (5.0, 1.0), strict=True)
        )
        if slow is not None and fast is not None:
            sentences.append(
                f"The fast motion with five times the switching gain has the band {number(fast)} at 1 ms; the slow one "
                f"has {number(slow)} at 5 ms: to keep the band, the sampling time must fall as the gain rises."
            )
        rows = [point for point in points if point["row"]]
        if rows:
            worst, overshoot = max(rows, key=lambda point: point["longest_run"]), greatest(rows, "relative_overshoot")
            samples, time = worst["longest_run"], worst["longest_run"] * worst["Ts_ms"]
            found = {"longest_run": samples, "longest_run_ms": time, "greatest_overshoot": overshoot}
            numbers |= under(found, ROW_SCENARIO)
            sentences.append(
                f"In the case study the greatest φ is {overshoot:.2f} times its T_s u⁺; one row stays at φ ≥ 0 for "
                f"{samples:g} samples ({number(time)} ms) in a row."
            )
        return points, numbers, sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Band, overshoot by row, samples in a row."""
        rows = [row for row in grouped(result.points, "row") if row]
        runs = {scenario: where(result.points, scenario=scenario, row="") for scenario in BAND_SCENARIOS}
        runs = {scenario: own for scenario, own in runs.items() if own}
        looks = dict(zip(rows, zip(ROW_COLOURS, MARKERS, strict=True), strict=False))
        entries = []
        for scenario, own in runs.items():
            gain = own[0]["bound_43"] / own[0]["Ts_ms"] * 1e3
            entries.append(entry(f"{scenario_title(scenario)}, u⁺ = {gain:.3g} /s", *BAND_SCENARIOS[scenario]))
        entries += [entry(row, *look) for row, look in looks.items()]
        entries += [line("Tₛ u⁺ (43)", **REFERENCE), entry("Tₛ (u⁺ + push of tracking)", INK, linestyle=":")]
        sheet = Sheet(left=0.65)
        sheet.legend(entries)
        sheet.at += 0.15
        band, over, samples = sheet.panels(3, 3, height=2.3, gap=0.62, labels=("sampling time Tₛ [ms]", ""))
        for scenario, own in runs.items():
            colour, marker = BAND_SCENARIOS[scenario]
            joined(band, own, "Ts_ms", "band", colour, marker)
            joined(band, own, "Ts_ms", "bound_43", colour, **REFERENCE | {"color": colour})
            joined(band, own, "Ts_ms", "band_expected", colour, linestyle=":")
            joined(samples, own, "Ts_ms", "longest_run", colour, marker)
        for row, look in looks.items():
            own = where(result.points, row=row)
            joined(over, own, "Ts_ms", "relative_overshoot", *look, markersize=4.5)
            joined(samples, own, "Ts_ms", "longest_run", *look, markersize=4.5)
        over.axhline(1.0, **REFERENCE)
        for ax, title, ticks in (
            (band, "band of φ while sliding", (1, 2.5, 5, 10, 20, 40)),
            (over, "case study: greatest φ / (Tₛ u⁺)", (1, 2, 4, 8, 16)),
            (samples, "samples in a row with φ ≥ 0", (1, 2.5, 5, 10, 20, 40)),
        ):
            logarithmic(ax.xaxis, ticks)
            ax.set_title(title)
        logarithmic(band.yaxis)
        logarithmic(samples.yaxis, (1, 2, 5, 10, 20))
        over.set_ylim(bottom=0.0)
        return sheet


def _row_point(row: Mapping[str, Any], Ts: float) -> dict[str, Any]:
    step = Ts * row["switching_gain"]
    return {
        "row": row["constraint"],
        "bound_43": step,
        "phi_max": row["phi_max"],
        "relative_overshoot": row["phi_max"] / step,
        "longest_run": float(round(row["longest_positive_run_s"] / Ts)),
        "violation_depth": row["violation_depth"],
    }


def _band(points: Points) -> dict[str, float]:
    """The bands of a scenario beside what is expected of them, and how they grow with the sampling time."""
    columns = ("Ts_ms", "band", "bound_43", "band_expected")
    Ts, band, bound, whole = (np.array([point[column] for point in points]) for column in columns)
    found = {
        "least_excess": (band / bound).min(),
        "greatest_excess": (band / bound).max(),
        "greatest_share_of_expected": (band / whole).max(),
        "longest_run": greatest(points, "longest_run"),
    }
    return found | ({"exponent": np.polyfit(np.log(Ts), np.log(band), 1)[0]} if len(points) > 1 else {})
