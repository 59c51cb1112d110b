"""Study of the switching gain against the speed of the motion."""

from __future__ import annotations

from typing import Any, NamedTuple

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number
from ...reports.plots import Sheet, logarithmic
from .drawing import DASHED, SYMBOLS, draw_line, style_of
from .study import Found, Results, Study, StudyResult
from .summary import RunSummary
from .tables import Numbers, Points, about, greatest, grouped, numbers_by, smallest_gain, where

#: Outcomes of a run, the worst first.
OUTCOMES = ("failed", "violated", "beyond band", "band, not sliding", "sliding")
#: Requirements on a switching gain, and the outcomes that fulfil each.
ENOUGH = {"allowed": OUTCOMES[2:], "in_band": OUTCOMES[3:], "sliding": OUTCOMES[4:]}


class GainCase(NamedTuple):
    """K_p(0) [1/s²] and u⁺ [1/s]."""

    Kp0: float
    switching_gain: float


#: Durations [s] by K_p(0) [1/s²], long enough for the row to be reached and left.
DURATIONS = {20.0: 10.0, 30.0: 6.5, 40.0: 5.0, 50.0: 4.5, 80.0: 3.0, 120.0: 2.5}
#: Switching gains on a grid of ratio √2 [1/s].
GAINS = (
    *(2.5, 3.536, 5.0, 7.071, 10.0, 14.142, 20.0, 28.284),
    *(40.0, 56.569, 80.0, 113.137, 160.0, 226.274),
)
SMALL_GAINS = (5.0, 10.0, 20.0, 40.0)

STYLES = {
    "violated": style_of("σ > 0: violated", "#B2182B", marker="X"),
    "beyond band": style_of("σ ≤ 0, but φ > Tₛ u⁺", "#EF8A62", marker="s"),
    "band, not sliding": style_of(
        "φ ≤ Tₛ u⁺, several samples in a row with φ ≥ 0", "#9BC4E2", marker="o"
    ),
    "sliding": style_of("φ ≤ Tₛ u⁺, one sample in a row with φ ≥ 0", "#0072B2", marker="o"),
    "failed": style_of("failed", "#000000", marker="x"),
}
_NEEDED = "what is needed to be back after one sample"
BOUNDS = {
    "bound_12": style_of("bound (12)", linewidth=1.8, zorder=4),
    "bound_sampled": style_of(_NEEDED, **DASHED | {"linewidth": 1.8}, zorder=4),
}


class SwitchingGain(Study):
    """The first example with faster and faster motion, and switching gains for each speed.

    Three requirements on a switching gain are tested, each stricter than the one before: σ ≤ 0
    holds; φ stays within the band (43); φ returns below zero after one sample, as in a sliding
    mode. Condition (12) guarantees that φ falls while its row is active. While it is inactive,
    tracking moves φ at up to L_fφ + L_gφ q̈, so that one sample is enough to return if u⁺ exceeds
    L_fφ by as much.
    """

    name = "switching-gain"
    title = "Switching gain against the speed of the motion"
    question = (
        "Must the switching gain rise with the speed of the motion, and is condition (12) enough?"
    )
    claims = (2, 10)
    columns = (
        "status",
        "reason",
        "outcome",
        "violation_depth",
        "phi_max",
        "band_bound",
        "longest_run",
        "bound_12",
        "bound_sampled",
        "utilization",
    )
    drift_noted = True
    figure_caption = (
        "Every marker is a run of the first example. Lines: the bound (12), the greatest "
        "Σ max(L_fφ, 0) over the active rows in any run of the same speed that slides, and what is "
        "needed to be back below zero after one sample."
    )

    def runs(self, *, small: bool = False) -> dict[GainCase, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""
        runs = {}
        for Kp0 in (50.0,) if small else DURATIONS:
            for gain in SMALL_GAINS if small else GAINS:
                overrides = {"task.Kp0": Kp0, "constraints.0.switching_gain": gain}
                overrides["duration"] = DURATIONS[Kp0]
                runs[GainCase(Kp0, gain)] = RunSpec("example-2d-fov", overrides=overrides)
        return runs

    def lines(self, case: GainCase, run: RunSummary, results: Results) -> Points:
        """Outcome, band, and lower bound on u⁺ for a return after one sample."""
        band = run.Ts * case.switching_gain
        outcome = "sliding" if run.longest_run <= 1 else "band, not sliding"
        if run.ended_early:
            outcome = "failed"
        elif run.value("violation_depth") > 0.0:
            outcome = "violated"
        elif run.phi_max > band:
            outcome = "beyond band"
        bound_sampled = run.needed_gain + max(run.entry_push, 0.0)
        return [{"outcome": outcome, "band_bound": band, "bound_sampled": bound_sampled}]

    def numbers(self, points: Points) -> Found:
        """Bounds and smallest sufficient gains for each speed; runs above (12) by outcome."""
        numbers: dict[tuple[Any, ...], dict[Any, float]] = {}
        for Kp0, chosen in grouped(points, "Kp0").items():
            # the greatest along the sliding runs or, if none slides, along the run with the largest
            # gain
            bounding = where(chosen, outcome="sliding")
            if not bounding:
                bounding = [max(chosen, key=lambda point: float(point["switching_gain"]))]
            bounds = ("bound_12", "bound_sampled")
            numbers[Kp0,] = {name: greatest(bounding, name) for name in bounds}
            for name, outcomes in ENOUGH.items():
                numbers[Kp0,][f"smallest_{name}"] = smallest_gain(chosen, outcomes)
        # bound along the run's own motion; without an active row there is no bound
        below = [point for point in points if point["switching_gain"] <= point["bound_12"]]
        above = [point for point in points if point not in below]
        numbers[()] = {"above_bound": len(above), "below_bound": len(below)}
        for side, chosen in (("above_bound", above), ("below_bound", below)):
            for name, good in ENOUGH.items():
                numbers[()][f"{side}_{name}"] = len(where(chosen, outcome=[*good]))
        return numbers

    def sentences(self, points: Points, numbers: Numbers) -> list[str]:
        """Return the sentences of the result."""
        sentences = []
        for Kp0 in grouped(points, "Kp0"):
            of = about(numbers, Kp0)
            sentences.append(
                f"With K_p(0) = {Kp0:g} the bound (12) is {number(of['bound_12'])} /s. Of the "
                f"gains tried, σ ≤ 0 holds from {number(of['smallest_allowed'])} /s on, φ stays "
                f"within T_s u⁺ from {number(of['smallest_in_band'])} /s on, and φ is back below "
                f"zero after one sample from {number(of['smallest_sliding'])} /s on "
                f"(expected: {number(of['bound_sampled'])} /s)."
            )
        counts = {name: int(count) for name, count in about(numbers).items()}
        sentences.append(
            f"Above the bound (12) along their own motion, {counts['above_bound_allowed']} of "
            f"{counts['above_bound']} runs keep σ ≤ 0, {counts['above_bound_in_band']} keep φ "
            f"within T_s u⁺, and {counts['above_bound_sliding']} are back below zero after one "
            f"sample; below it {counts['below_bound_allowed']} of {counts['below_bound']} still "
            "keep σ ≤ 0."
        )
        return sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Draw the outcomes over speed and gain, and the bounds on the gain."""
        by_outcome = grouped(result.points, "outcome")
        by_speed = numbers_by(result.numbers, "Kp0")
        styles = {name: STYLES[name] | SYMBOLS for name in STYLES if name in by_outcome}
        sheet = Sheet(left=0.8)
        sheet.legend([*styles.values(), *BOUNDS.values()], 2)
        labels = ("gain at zero error Kₚ(0) [1/s²]: faster motion →", "")
        (ax,) = sheet.panels(1, height=3.5, labels=labels)
        for outcome, style in styles.items():
            draw_line(ax, by_outcome[outcome], "Kp0", "switching_gain", style)
        for bound, style in BOUNDS.items():
            draw_line(ax, by_speed, "Kp0", bound, style)
        logarithmic(ax.xaxis, (20, 30, 40, 50, 80, 120))
        logarithmic(ax.yaxis, (2.5, 5, 10, 20, 40, 80, 160))
        ax.set_xlim(17.6, 136.8)
        ax.set_ylabel("switching gain u⁺ [1/s]")
        return sheet
