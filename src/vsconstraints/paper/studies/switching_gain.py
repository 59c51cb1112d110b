"""How large the switching gain must be, and whether condition (12) tells it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from ...reports.plots import INK, Sheet, logarithmic
from .drawing import by_outcome, entry, outcome_entries
from .points import Measured, Numbers, Points, greatest, grouped, smallest_enough, under, where
from .study import Study, StudyResult, begun
from .summary import RunSummary

SCENARIO = "example-2d-fov"
DURATIONS = {20.0: 10.0, 30.0: 6.5, 40.0: 5.0, 50.0: 4.5, 80.0: 3.0, 120.0: 2.5}
"""Duration [s] by K_p(0): long enough for the row to be reached and left."""

GAINS = tuple(round(2.5 * 2.0 ** (k / 2.0), 3) for k in range(14))
"""u⁺ on a grid of ratio √2."""

OUTCOMES = ("failed", "violated", "beyond band", "band, not sliding", "sliding")
ENOUGH = {"allowed": "beyond band", "in_band": "band, not sliding", "sliding": "sliding"}
"""What can be asked of a gain, and the outcome that is enough for it."""

LOOK = {
    "violated": ("#B2182B", "X", "σ > 0: violated"),
    "beyond band": ("#EF8A62", "s", "σ ≤ 0, but φ > Tₛ u⁺"),
    "band, not sliding": ("#9BC4E2", "o", "φ ≤ Tₛ u⁺, several samples in a row with φ ≥ 0"),
    "sliding": ("#0072B2", "o", "φ ≤ Tₛ u⁺, one sample in a row with φ ≥ 0"),
    "failed": ("#000000", "x", "failed"),
}


class Case(NamedTuple):
    """K_p(0) [1/s²], and u⁺."""

    Kp0: float
    switching_gain: float


class SwitchingGain(Study):
    """The first example with ever faster motion, and a grid of switching gains for each speed.

    Three things can be asked of a switching gain, each more than the one before: that σ ≤ 0 holds, that φ stays within
    the band (43), and that φ is back below zero after one sample, as in a sliding mode. Condition (12) promises that φ
    falls while its row is active. While it is inactive, tracking moves φ at up to L_fφ + L_gφ q̈, so that one sample is
    enough to come back if u⁺ exceeds L_fφ by as much.
    """

    name = "switching-gain"
    title = "Switching gain against the speed of the motion"
    question = "Must the switching gain rise with the speed of the motion, and is condition (12) enough?"
    claims = (2, 10)
    drift_noted = True
    figure_caption = (
        "Every marker is a run of the first example. Lines: the bound (12), the greatest Σ max(L_fφ, 0) over the "
        "active rows in any run of the same speed that slides, and what is needed to be back below zero after one "
        "sample."
    )

    def runs(self, *, small: bool = False) -> dict[Case, RunSpec]:
        """Every speed with every gain."""
        speeds = (50.0,) if small else tuple(DURATIONS)
        gains = (5.0, 10.0, 20.0, 40.0) if small else GAINS
        return {
            Case(Kp0, gain): RunSpec(
                SCENARIO,
                overrides={"task.Kp0": Kp0, "constraints.0.switching_gain": gain, "duration": DURATIONS[Kp0]},
            )
            for Kp0 in speeds
            for gain in gains
        }

    def measure(self, results: Mapping[Case, RunSummary]) -> Measured:
        """Outcome of every run; for every speed the smallest gains that are enough, and the bounds."""
        points = [_point(case, run) for case, run in results.items()]
        numbers: Numbers = {}
        sentences = []
        for Kp0, own in grouped(points, "Kp0").items():
            found = {column: _bound(own, column) for column in ("bound_12", "bound_sampled")}
            found |= {
                f"smallest_{what}": smallest_enough(own, "switching_gain", partial(_reaches, outcome=outcome))
                for what, outcome in ENOUGH.items()
            }
            numbers |= under(found, Kp0)
            shown = {name: number(value) for name, value in found.items()}
            sentences.append(
                f"With K_p(0) = {Kp0:g} the bound (12) is {shown['bound_12']} /s. Of the gains tried, σ ≤ 0 holds from "
                f"{shown['smallest_allowed']} /s on, φ stays within T_s u⁺ from {shown['smallest_in_band']} /s on, and "
                f"φ is back below zero after one sample from {shown['smallest_sliding']} /s on (expected: "
                f"{shown['bound_sampled']} /s)."
            )
        # along its own motion; without an active row there is nothing to exceed
        below = [point for point in points if point["switching_gain"] <= point["bound_12"]]
        above = [point for point in points if not point["switching_gain"] <= point["bound_12"]]
        count: dict[str, float] = {"above_bound": len(above), "below_bound": len(below)}
        for side, some in (("above", above), ("below", below)):
            for what, outcome in ENOUGH.items():
                count[f"{side}_bound_{what}"] = sum(_reaches(point, outcome) for point in some)
        sentences.append(
            f"Above the bound (12) along their own motion, {count['above_bound_allowed']} of {count['above_bound']} "
            f"runs keep σ ≤ 0, {count['above_bound_in_band']} keep φ within T_s u⁺, and {count['above_bound_sliding']} "
            f"are back below zero after one sample; below it {count['below_bound_allowed']} of {count['below_bound']} "
            "still keep σ ≤ 0."
        )
        return points, numbers | under(count), sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Switching gain against speed; one marker per run, coloured by its outcome."""
        bounds = {
            "bound_12": entry("bound (12)", INK),
            "bound_sampled": entry("what is needed to be back after one sample", INK, linestyle=(0, (4, 2))),
        }
        sheet = Sheet(left=0.8)
        sheet.legend([*outcome_entries(result.points, LOOK), *bounds.values()], 2)
        (ax,) = sheet.panels(1, height=3.5)
        by_outcome(ax, result.points, "Kp0", "switching_gain", LOOK)
        speeds = sorted({point["Kp0"] for point in result.points})
        for column, look in bounds.items():
            values = [_bound(where(result.points, Kp0=Kp0), column) for Kp0 in speeds]
            ax.plot(speeds, values, color=INK, linestyle=look["linestyle"], linewidth=1.8, zorder=4)
        logarithmic(ax.xaxis, speeds)
        logarithmic(ax.yaxis, (2.5, 5, 10, 20, 40, 80, 160))
        ax.set_xlim(0.88 * speeds[0], 1.14 * speeds[-1])
        ax.set_xlabel("gain at zero error Kₚ(0) [1/s²]: faster motion →")
        ax.set_ylabel("switching gain u⁺ [1/s]")
        return sheet


def _point(case: Case, run: RunSummary) -> dict[str, Any]:
    return {
        **begun(case, run),
        "outcome": _outcome(run, case.switching_gain),
        "violation_depth": run.value("violation_depth"),
        "phi_max": run.phi_max,
        "band_bound": run.Ts * case.switching_gain,
        "longest_run": run.longest_run,
        "bound_12": run.needed_gain,
        "bound_sampled": run.needed_gain + max(run.entry_push, 0.0),
        "utilization": run.value("utilization"),
    }


def _outcome(run: RunSummary, gain: float) -> str:
    """The first of :data:`OUTCOMES` that is not excluded."""
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
    sliding = [point for point in points if point["outcome"] == "sliding"]
    return greatest(sliding or [max(points, key=lambda point: point["switching_gain"])], column)
