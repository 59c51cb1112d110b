"""Every score of a run: its column, unit and definition, what of it is better, and how reports show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .chattering import SLIDING_GAP
from .clearance import NEGLIGIBLE

Style = Literal["number", "error", "percent", "count"]
"""How a number is printed: three digits; the same, but not less than a thousandth; two decimals; whole."""


@dataclass(frozen=True)
class Metric:
    """A column of results.csv that reports show.

    Attributes
    ----------
    column
        Its name.
    header
        What reports call it, with the unit in which they show it.
    group
        The table of a scenario in which it stands.
    better
        Which values are better; None where none is: a fact, or noise.
    factor, style
        From the stored to the shown number.
    over
        Column that it is divided by; empty if by none.
    """

    column: str
    header: str
    group: Literal["task", "chattering"]
    better: Literal["less", "more"] | None = "less"
    factor: float = 1.0
    style: Style = "number"
    over: str = ""


METRICS = (
    Metric("settling_time_s", "settling time [s]", "task"),
    Metric("final_translation_error_m", "position error [mm]", "task", factor=1e3, style="error"),
    Metric("final_rotation_error_rad", "orientation error [mrad]", "task", factor=1e3, style="error"),
    Metric("final_feature_error_px", "image error [px]", "task", style="error"),
    Metric("utilization", "utilization [%]", "task", "more", style="percent"),
    Metric("violation_depth", "worst depth [% of L]", "task", factor=100.0),
    Metric("violation_time_s", "time outside [s]", "task"),
    Metric("phi_band", "φ band", "chattering", None),
    Metric("phi_band_bound", "bound T_s u⁺", "chattering", None),
    Metric("phi_band", "band / bound", "chattering", over="phi_band_bound"),
    Metric("sliding_lost_s", "sliding lost [s]", "chattering"),
    Metric("switching_rate_hz", "switching rate [Hz]", "chattering"),
    Metric("acceleration_variation", "acceleration variation [rad/s³]", "chattering"),
    Metric("jerk_rms", "RMS jerk [rad/s³]", "chattering"),
    Metric("step_time_median_us", "call, median [µs]", "chattering", None),
    Metric("step_time_p99_us", "p99 [µs]", "chattering", None),
    Metric("step_time_max_us", "max [µs]", "chattering", None),
    Metric("rows_time_median_us", "rows and task, median [µs]", "chattering", None),
    Metric("missed_periods", "missed periods", "chattering", None, style="count"),
)
"""What a scenario's tables show, in their order."""

RUN = ("suite", "scenario", "controller", "trial")
TIMING_COLUMNS = (
    "step_time_median_us",
    "step_time_p99_us",
    "step_time_max_us",
    "rows_time_median_us",
    "missed_periods",
)
"""The columns of results.csv that differ from run to run on the same machine."""

RESULT_COLUMNS = (
    *RUN,
    "status",
    "reason",
    "duration_s",
    "settling_time_s",
    "final_translation_error_m",
    "final_rotation_error_rad",
    "final_feature_error_px",
    "utilization",
    "violated",
    "violation_depth",
    "violation_time_s",
    "phi_band",
    "phi_band_bound",
    "switching_rate_hz",
    "acceleration_variation",
    "jerk_rms",
    *TIMING_COLUMNS,
    "compiled",
    "within_band",
    "sliding_lost_s",
    "held_time_s",
)
CONSTRAINT_COLUMNS = (
    *RUN,
    "constraint",
    "kind",
    "unit",
    "challenged",
    "active_time_s",
    "first_active_s",
    "last_active_s",
    "clearance_min",
    "usage_max",
    "mean_unused_margin",
    "violation_depth",
    "violation_time_s",
    "phi_max",
    "longest_positive_run_s",
    "sampling_band",
    "band_depth",
    "held_time_s",
    "usage_held",
)

DEFINITIONS = {
    "clearance": "Signed distance of a row to its boundary in its natural unit (px, rad, rad/s, m); positive where "
    "allowed. Looked at in every sample and, near the boundary, at three instants inside each sampling period.",
    "usage": "1 − clearance / L, which is 1 on the boundary. L is half an allowed range or an obstacle's radius.",
    "challenged": "A row that tracking alone violates in this scenario and trial.",
    "active": "A row acts where it holds the arm back: the command makes its φ rise by less than tracking alone would "
    "from the same state (by more than 0.001 u⁺). What slows one row slows others as well: of the slowed rows, those "
    "with φ ≥ 0 act; where there is none, the one nearest to that. What a law says of itself does not count.",
    "held_time_s": "How long a row holds the arm back: it acts, or acted before and acts again while φ was never "
    "farther below zero than two switching steps T_s u⁺, as in a sliding mode. Of this row in constraints.csv, the sum "
    "over the rows in results.csv.",
    "usage_held": "Mean of 1 − (clearance + K · its rate of change) / L, from 0 to 1, over the time for which the row "
    "holds the arm back: usage of the room that is left at the arm's speed. 1 means that the arm was on the boundary, "
    "or came to it as fast as φ ≤ 0 lets it. For speeds it is the mean usage.",
    "utilization": "The same over all rows, each weighted by the time for which it holds the arm back. No value where "
    "the goal is not reached and held, or no row acts: standing still uses nothing.",
    "mean_unused_margin": "Mean clearance, where positive, over the samples in which tracking alone is outside.",
    "sampling_band": "How far outside sampling alone puts a row, in its natural unit: where φ is the clearance itself, "
    "as for speeds, one switching step T_s u⁺ (43). Rows of positions have none: φ = σ + K σ̇ smooths switching.",
    "violated": f"Rows whose clearance fell below −{NEGLIGIBLE:g} L and below the sampling band, separated by "
    "semicolons.",
    "within_band": f"Rows whose clearance fell below −{NEGLIGIBLE:g} L, but never below the sampling band, likewise: "
    "outside, but not violated. Their depth is band_depth in constraints.csv.",
    "violation_depth": "Of the violated rows, in results.csv the greatest depth as a fraction of L; in constraints.csv "
    "in the row's natural unit. Includes the instants between samples.",
    "violation_time_s": "Sampling periods in which, at their beginning or at an instant inside, a clearance is as low "
    "as for violated rows: of any row in results.csv, of this row in constraints.csv.",
    "phi_band": "How far φ gets from zero to both sides, together, while a row is at its boundary; of the row in which "
    "that is largest relative to its bound. At its boundary: from the first to the last sample with φ ≥ 0, where no "
    f"more than {SLIDING_GAP} samples lie between two of them; of three such samples or more, or with φ beyond the "
    "bound. Time for which the sliding mode is lost is included.",
    "phi_band_bound": "T_s u⁺ of that row: the bound (43) on one switching step of the constraint action alone. "
    "Tracking moves φ as well, so that the measured band can exceed it.",
    "sliding_lost_s": f"Time in which a row's φ stays at or above zero for more than {SLIDING_GAP} samples in a row "
    "and gets beyond T_s u⁺.",
    "switching_rate_hz": "How often per second the set of rows that act changes.",
    "acceleration_variation": "Total variation of the commanded acceleration per second, Σ‖Δq̈_c‖ / duration.",
    "jerk_rms": "Root mean square of ‖Δq̈_c‖ / T_s.",
    "step_time": "Wall time of the call controller.command(rows, task) [µs], the same call for every law, shipped or "
    "own, with its checks of input and answer; without the first call. Laws with a compiled form answer it from "
    "there, all others in Python.",
    "rows_time": "Wall time of kinematics, features, rows and task [µs], the same code for every controller. Where a "
    "controller is deceived (disturbances, motions it is not told of) without the kinematics, and in the NumPy form.",
    "missed_periods": "Samples in which rows, task and controller together took longer than T_s; without the first.",
    "compiled": "Whether rows, task and controller all have a compiled form, which answers that call; what runs in "
    "NumPy takes longer.",
    "settling_time_s": "From the last change of the goal until the error stays within tolerance.",
    "status": "converged: the last goal is reached and held. trapped: at rest away from it. aborted: the rows with "
    "φ ≥ 0 lost full row rank (section 5.2), which a law says and the rows confirm. failed: the scene or the "
    "controller could not go on. unfinished: still moving.",
}
"""What the scores mean: the one source of reports and documentation."""
