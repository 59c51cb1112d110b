"""How large the switching gain must be, and how the chattering band shrinks with the sampling time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import INK, REFERENCE, Sheet, line, logarithmic
from . import drawing as draw
from . import study
from .study import Numbers, Points, StudyResult, Sweep
from .summary import RunSummary

OUTCOMES = ("failed", "violated", "beyond band", "band, not sliding", "sliding")  #: Of a run, the worst first.
#: What can be required of a switching gain, and the outcome that is enough for it.
ENOUGH = {"allowed": "beyond band", "in_band": "band, not sliding", "sliding": "sliding"}
BAND_SCENARIOS = ("example-2d-fov", "example-2d-fast-high-gain")
ROW_SCENARIO = "case-study-6r"


class SwitchingGain(Sweep):
    """The first example with ever faster motion, and a grid of switching gains for each speed.

    Three things can be required of a switching gain, each more than the one before: that σ ≤ 0 holds, that φ stays
    within the band (43), and that φ is back below zero after one sample, as in a sliding mode. Condition (12) promises
    that φ falls while its row is active. While it is inactive, tracking moves φ at up to L_fφ + L_gφ q̈, so that one
    sample is enough to come back if u⁺ exceeds L_fφ by as much.
    """

    name = "switching-gain"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case: K_p(0) [1/s²], and u⁺."""
        overrides = {"task.Kp0": case.Kp0, "constraints.0.switching_gain": case.switching_gain}
        return RunSpec("example-2d-fov", overrides=overrides)

    def measure(self, results: Mapping[Any, RunSummary]) -> tuple[Points, Numbers, list[str]]:
        """Outcome of every run; for every speed the smallest gains that are enough, and the bounds."""
        points = [
            study.begun(case, run)
            | {"outcome": _outcome(run, case.switching_gain)}
            | study.columns(run, "violation_depth", "phi_max")
            | {"band_bound": run.Ts * case.switching_gain}
            | study.columns(run, "longest_run", "bound_12")
            | {"bound_sampled": run.needed_gain + max(run.entry_push, 0.0), "utilization": run.value("utilization")}
            for case, run in results.items()
        ]
        numbers: Numbers = {}
        sentences = []
        for Kp0, own in study.grouped(points, "Kp0").items():
            found = {column: _bound(own, column) for column in ("bound_12", "bound_sampled")}
            for name, outcome in ENOUGH.items():
                reaches = partial(_reaches, outcome=outcome)
                found[f"smallest_{name}"] = study.smallest_enough(own, "switching_gain", reaches)
            numbers |= study.keyed(found, Kp0)
            sentences.append(self.sentence("speed", Kp0=Kp0, **found))
        # along its own motion; without an active row there is no bound to exceed
        below = [point for point in points if point["switching_gain"] <= point["bound_12"]]
        count: dict[str, float] = {"above_bound": len(points) - len(below), "below_bound": len(below)}
        for name, outcome in ENOUGH.items():
            count[f"below_bound_{name}"] = sum(_reaches(point, outcome) for point in below)
            reached = sum(_reaches(point, outcome) for point in points)
            count[f"above_bound_{name}"] = reached - count[f"below_bound_{name}"]
        return points, numbers | study.keyed(count), [*sentences, self.sentence("bound", **count)]

    def figure(self, result: StudyResult) -> Sheet:
        """Switching gain against speed; one marker per run, coloured by its outcome."""
        bounds = {
            "bound_12": draw.entry("bound (12)", INK),
            "bound_sampled": draw.entry("what is needed to be back after one sample", INK, linestyle=(0, (4, 2))),
        }
        sheet = Sheet(left=0.8)
        sheet.legend([*draw.outcome_entries(result.points, self.table["outcomes"]), *bounds.values()], 2)
        (ax,) = sheet.panels(1, height=3.5)
        draw.by_outcome(ax, result.points, "Kp0", "switching_gain", self.table["outcomes"])
        by_speed = dict(sorted(study.grouped(result.points, "Kp0").items()))
        for column, look in bounds.items():
            values = [_bound(own, column) for own in by_speed.values()]
            ax.plot(list(by_speed), values, color=INK, linestyle=look["linestyle"], linewidth=1.8, zorder=4)
        logarithmic(ax.xaxis, list(by_speed))
        logarithmic(ax.yaxis, (2.5, 5, 10, 20, 40, 80, 160))
        ax.set_xlim(0.88 * min(by_speed), 1.14 * max(by_speed))
        ax.set_xlabel("gain at zero error Kₚ(0) [1/s²]: faster motion →")
        ax.set_ylabel("switching gain u⁺ [1/s]")
        return sheet


def _outcome(run: RunSummary, gain: float) -> str:
    """The worst of :data:`OUTCOMES` that applies."""
    if run.ended_early:
        return "failed"
    if run.value("violation_depth") > 0.0:
        return "violated"
    if run.phi_max > run.Ts * gain:
        return "beyond band"
    return "sliding" if run.longest_run <= 1 else "band, not sliding"


def _reaches(point: Mapping[str, Any], outcome: str) -> bool:
    """Whether a run's outcome is this one or better."""
    return OUTCOMES.index(point["outcome"]) >= OUTCOMES.index(outcome)


def _bound(points: Points, column: str) -> float:
    """Greatest value along the runs that slide, or along the one with the largest gain if none does."""
    sliding = study.where(points, outcome="sliding")
    return study.greatest(sliding or [max(points, key=lambda point: point["switching_gain"])], column)


class SamplingTime(Sweep):
    """The sliding-mode law with different sampling times, nothing else changed.

    (43) bounds one step of the constraint action alone: T_s u⁺. In the last sample before a row becomes active,
    tracking moves φ by up to T_s (L_fφ + L_gφ q̈): that is what the band has above zero, and the sum is what to expect.
    """

    name = "sampling-time"

    def spec(self, case: Any) -> RunSpec:
        """The run of a case."""
        return RunSpec(case.scenario, overrides={"sampling_time": case.Ts_ms / 1e3})

    def measure(self, results: Mapping[Any, RunSummary]) -> tuple[Points, Numbers, list[str]]:
        """Bands and bounds of every run, and one line more for each row of the case study that was active."""
        points: Points = []
        for case, run in results.items():
            common, bound = study.begun(case, run), run.value("phi_band_bound")
            bands = {"row": "", "band": run.value("phi_band"), "bound_43": bound}
            bands["band_expected"] = bound + run.Ts * run.entry_push
            points.append(common | bands | study.columns(run, "phi_max", "longest_run", "violation_depth"))
            if case.scenario == ROW_SCENARIO:
                points += [common | _row(row, run.Ts) for row in run.rows.values() if row["active_time_s"] > 0]
        numbers: Numbers = {}
        sentences = []
        for scenario in BAND_SCENARIOS:
            own = [p for p in study.where(points, scenario=scenario, row="") if math.isfinite(p["band"])]
            if own:
                found = _growth(own)
                numbers |= study.keyed(found, scenario) | {(scenario, "band", p["Ts_ms"]): p["band"] for p in own}
                sentences += [self.sentence("growth", scenario=scenario, **found)] * ("exponent" in found)
        slow, fast = (numbers.get((name, "band", Ts)) for name, Ts in zip(BAND_SCENARIOS, (5.0, 1.0), strict=True))
        if slow is not None and fast is not None:
            sentences.append(self.sentence("fast", fast=fast, slow=slow))
        if rows := [point for point in points if point["row"]]:
            longest = max(rows, key=lambda point: point["longest_run"])
            found = {"longest_run": longest["longest_run"]}
            found["longest_run_ms"] = longest["longest_run"] * longest["Ts_ms"]
            found["greatest_overshoot"] = study.greatest(rows, "relative_overshoot")
            numbers |= study.keyed(found, ROW_SCENARIO)
            sentences.append(self.sentence("rows", **found))
        return points, numbers, sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Band, overshoot by row, samples in a row."""
        looks = self.table["looks"]
        rows = dict(zip(filter(None, study.grouped(result.points, "row")), looks["rows"], strict=False))
        runs = {scenario: study.where(result.points, scenario=scenario, row="") for scenario in BAND_SCENARIOS}
        runs = {scenario: own for scenario, own in runs.items() if own}
        entries = []
        for scenario, own in runs.items():
            gain = own[0]["bound_43"] / own[0]["Ts_ms"] * 1e3
            entries.append(draw.entry(f"{draw.scenario_title(scenario)}, u⁺ = {gain:.3g} /s", *looks[scenario]))
        entries += [draw.entry(row, *look) for row, look in rows.items()]
        entries += [line("Tₛ u⁺ (43)", **REFERENCE), draw.entry("Tₛ (u⁺ + push of tracking)", INK, linestyle=":")]
        sheet = Sheet(left=0.65)
        sheet.legend(entries)
        sheet.at += 0.15
        band, over, samples = sheet.panels(3, 3, height=2.3, gap=0.62, labels=("sampling time Tₛ [ms]", ""))
        for scenario, own in runs.items():
            colour, marker = looks[scenario]
            draw.joined(band, own, "Ts_ms", "band", colour, marker)
            draw.joined(band, own, "Ts_ms", "bound_43", colour, **REFERENCE | {"color": colour})
            draw.joined(band, own, "Ts_ms", "band_expected", colour, linestyle=":")
            draw.joined(samples, own, "Ts_ms", "longest_run", colour, marker)
        for row, look in rows.items():
            own = study.where(result.points, row=row)
            draw.joined(over, own, "Ts_ms", "relative_overshoot", *look, markersize=4.5)
            draw.joined(samples, own, "Ts_ms", "longest_run", *look, markersize=4.5)
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


def _row(row: Mapping[str, Any], Ts: float) -> dict[str, Any]:
    step = Ts * row["switching_gain"]
    return {
        "row": row["constraint"],
        "bound_43": step,
        "phi_max": row["phi_max"],
        "relative_overshoot": row["phi_max"] / step,
        "longest_run": float(round(row["longest_positive_run_s"] / Ts)),
        "violation_depth": row["violation_depth"],
    }


def _growth(points: Points) -> dict[str, float]:
    """The bands of a scenario beside what is expected of them, and how they grow with the sampling time."""
    names = ("Ts_ms", "band", "bound_43", "band_expected")
    Ts, band, bound, expected = (np.array([point[name] for point in points]) for name in names)
    found = {
        "least_excess": (band / bound).min(),
        "greatest_excess": (band / bound).max(),
        "greatest_share_of_expected": (band / expected).max(),
        "longest_run": study.greatest(points, "longest_run"),
    }
    return found | ({"exponent": np.polyfit(np.log(Ts), np.log(band), 1)[0]} if len(points) > 1 else {})
