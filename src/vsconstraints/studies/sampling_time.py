"""The chattering band against the sampling time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..reports.numbers import number
from ..runs.spec import RunSpec
from .panels import INK, REFERENCE, Grid, handle, logarithmic
from .points import Measured, Numbers, Points, greatest, grouped, under
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

    def draw(self, result: StudyResult, path: Path) -> None:
        """Band, overshoot by row, samples in a row."""
        rows = list(dict.fromkeys(point["row"] for point in result.points if point["row"]))
        looks = dict(zip(rows, zip(ROW_COLOURS, MARKERS, strict=True), strict=False))
        with Grid(path, 1, 3, height=2.3, legend=0.75, left=0.65, gap=0.62) as grid:
            band, over, samples = grid.axes[0]
            handles = []
            for scenario, (colour, marker) in BAND_SCENARIOS.items():
                own = [p for p in result.points if p["scenario"] == scenario and not p["row"]]
                if own:
                    _line(band, own, "band", color=colour, marker=marker)
                    _line(band, own, "bound_43", color=colour, linestyle=REFERENCE["linestyle"], linewidth=1.1)
                    _line(band, own, "band_expected", color=colour, linestyle=":", linewidth=1.4)
                    _line(samples, own, "longest_run", color=colour, marker=marker)
                    gain = own[0]["bound_43"] / own[0]["Ts_ms"] * 1e3
                    name = "first example" + (", fast" if "fast" in scenario else "")
                    handles.append(handle(f"{name}, u⁺ = {gain:.3g} /s", colour, marker))
            for row, (colour, marker) in looks.items():
                own = [p for p in result.points if p["row"] == row]
                _line(over, own, "relative_overshoot", color=colour, marker=marker, markersize=4.5)
                _line(samples, own, "longest_run", color=colour, marker=marker, markersize=4.5)
                handles.append(handle(row, colour, marker))
            handles.append(handle("Tₛ u⁺ (43)", INK, linestyle=REFERENCE["linestyle"], linewidth=1.1))
            handles.append(handle("Tₛ (u⁺ + push of tracking)", INK, linestyle=":"))
            grid.legend(handles, 3)
            over.axhline(1.0, **REFERENCE)
            for ax, ticks in (
                (band, (1, 2.5, 5, 10, 20, 40)),
                (over, (1, 2, 4, 8, 16)),
                (samples, (1, 2.5, 5, 10, 20, 40)),
            ):
                logarithmic(ax.xaxis, ticks)
                ax.set_xlabel("sampling time Tₛ [ms]")
            logarithmic(band.yaxis)
            logarithmic(samples.yaxis, (1, 2, 5, 10, 20))
            over.set_ylim(bottom=0.0)
            band.set_title("band of φ while sliding")
            over.set_title("case study: greatest φ / (Tₛ u⁺)")
            samples.set_title("samples in a row with φ ≥ 0")


def _line(ax: Any, points: list[dict[str, Any]], column: str, **options: Any) -> None:
    pairs = [(p["Ts_ms"], p[column]) for p in points if math.isfinite(p[column])]
    if pairs:
        ax.plot(*zip(*pairs, strict=True), **{"linewidth": 1.4, "markersize": 5.0, **options})


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
