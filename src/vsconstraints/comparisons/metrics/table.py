"""The table of metrics: every column of results.csv and constraints.csv, what it means and how it is shown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...rows.readable import in_one_line
from ...simulation import PATIENCE
from ..record import RunRecord
from .measured import NEGLIGIBLE, SLIDING_GAP, TOLERANT, Measured, Metric, first_active, mean_while, over

#: Of a run, in the order in which a scenario's tables show them.
METRICS = (
    Metric("status", lambda m: m.run.status, kind="text", definition="converged: every goal is reached before the next "
           "one begins, and the last one is reached and held. slow: not there when time is up, but at the pace of the "
           "last seconds it would be in less than as long again. trapped: at rest away from the goal. aborted: the "
           "rows with φ ≥ 0 lost full row rank (section 5.2), which a law says and the rows confirm. failed: the scene "
           "or the controller could not go on. unfinished: still moving and coming no nearer, or a goal was missed, "
           f"which the reason names. Time is up at {PATIENCE:g} times the time that tracking alone takes to settle at "
           "the last goal, without constraints and disturbances, but not before the scenario's duration, nor after it "
           "where the target moves or tracking alone has not settled by then. A run that has settled, or is trapped, "
           "ends with the duration or, after it, as soon as that is seen."),
    Metric("reason", lambda m: m.run.reason, kind="text"),
    Metric("duration_s", lambda m: m.run.t[-1], definition="Time of the last sample: see status."),
    Metric("settling_time_s", Measured.settling_time, "settling time [s]", group="task",
           definition="From the beginning of each goal until the error stays within its tolerance, added up over the "
           "goals."),
    Metric("final_translation_error_m", lambda m: m.run.camera_error[-1, 0], "position error [mm]",
           group="task", factor=1e3, style="error"),
    Metric("final_rotation_error_rad", lambda m: m.run.camera_error[-1, 1], "orientation error [mrad]",
           group="task", factor=1e3, style="error"),
    Metric("final_feature_error_px", lambda m: m.run.feature_error_px[-1], "image error [px]",
           group="task", style="error"),
    Metric("utilization", Measured.utilization, "utilization [%]",
           "more", group="outcome", style="percent", overall="median utilization [%]",
           finding=("Most of the allowed space used", "%"),
           definition="Mean usage, from 0 to 1, over the sampling periods in which tracking alone is outside: of each "
           "challenged row in constraints.csv; in results.csv of all of them, each weighted by that time. The two runs "
           "are compared at equal times, while both last: where a law comes to a boundary later than tracking, or has "
           "left it sooner, that is space that it does not use. In results.csv no value where the goal is not reached "
           "and held, or nothing is challenged: standing still uses nothing."),
    Metric("violated", lambda m: m.named(m.violated), kind="text",
           definition=f"Rows whose clearance fell below −{NEGLIGIBLE:g} L (the strict standard, the same for all laws "
           "and rows), separated by semicolons."),
    Metric("violation_depth", lambda m: float((m.violated / m.record.length).max(initial=0.0)),
           "worst depth [% of L]", group="outcome", judged="any", factor=100.0, overall="worst depth [% of L]",
           condensed="worst",
           definition="Of the violated rows, in results.csv the greatest depth as a fraction of L; in constraints.csv "
           "in the row's natural unit. Includes the instants between samples."),
    Metric("violation_time_s", lambda m: float(m.outside.any(axis=1).sum() * m.Ts), "time outside [s]",
           group="outcome", judged="any",
           definition="Sampling periods in which, at their beginning or at an instant inside, a clearance is as low "
           "as for violated rows: of any row in results.csv, of this row in constraints.csv."),
    Metric("phi_band", lambda m: m.band[0], "φ band", None,
           "How far φ gets from zero to both sides, together, while a row is at its boundary; of the row in which "
           "that is largest relative to its bound. At its boundary: from the first to the last sample with φ ≥ 0, "
           f"where no more than {SLIDING_GAP} samples lie between two of them; of three such samples or more, or with "
           "φ beyond the bound. Time for which the sliding mode is lost is included."),
    Metric("phi_band_bound", lambda m: m.band[1], "bound T_s u⁺", None,
           "T_s u⁺ of that row: the bound (43) on one switching step of the constraint action alone. Tracking moves φ "
           "as well, so that the measured band can exceed it."),
    Metric("phi_band", None, "band / bound", judged="sliding", over="phi_band_bound",
           overall="worst φ band / bound", condensed="worst"),
    Metric("sliding_lost_s", Measured.sliding_lost, "sliding lost [s]", judged="sliding",
           added=3, definition=f"Time in which a row's φ stays at or above zero for more than {SLIDING_GAP} samples "
           "in a row and gets beyond T_s u⁺."),
    Metric("switching_rate_hz", lambda m: m.per_second(m.switches), "switching rate [Hz]",
           definition="How often per second of the scenario's duration the set of rows that act changes.",
           overall="switching rate [Hz]"),
    Metric("acceleration_variation", lambda m: m.per_second(m.command_changes), "acceleration variation [rad/s³]",
           definition="Total variation of the commanded acceleration per second, Σ‖Δq̈_c‖ / duration: of the scenario's "
           "duration, which all runs share, not of the time that a run takes beyond it.",
           overall="acceleration variation [rad/s³]",
           finding=("Least chattering (acceleration variation)", "rad/s³")),
    Metric("jerk_rms", lambda m: over(m.command_changes, lambda change: np.sqrt((change**2).mean()) / m.Ts),
           "RMS jerk [rad/s³]",
           definition="Root mean square of ‖Δq̈_c‖ / T_s, over the scenario's duration."),
    Metric("step_time_median_us", lambda m: over(m.step_times, np.median), "call, median [µs]", None,
           "Wall time of the call controller.command(rows, task) [µs], the same call for every law, shipped or own, "
           "with its checks of input and answer; without the first call. Laws with a compiled form answer it from "
           "there, all others in Python.", "time", "time", overall="median call [µs]"),
    Metric("step_time_p99_us", lambda m: over(m.step_times, lambda each: np.quantile(each, 0.99)),
           "p99 [µs]", None, kind="time", group="time"),
    Metric("step_time_max_us", lambda m: over(m.step_times, np.max), "max [µs]", None,
           kind="time", group="time"),
    Metric("rows_time_median_us", lambda m: over(m.rows_times, np.median), "rows and task, median [µs]", None,
           "Wall time of kinematics, features, rows and task [µs], the same code for every controller. Where a "
           "controller is deceived (disturbances, motions it is not told of) without the kinematics, and in the NumPy "
           "form.", "time", "time"),
    Metric("missed_periods", Measured.missed_periods, "missed periods", None,
           "Samples in which rows, task and controller together took longer than T_s; without the first.", "time",
           "time", style="count"),
    Metric("compiled", lambda m: m.run.compiled, kind="flag", added=1,
           definition="Whether rows, task and controller all have a compiled form, which answers that call; what runs "
           "in NumPy takes longer."),
    Metric("within_band", lambda m: m.named(m.within_band), kind="text", added=2,
           definition="Of the violated rows those that were never deeper outside than their sampling band, likewise. "
           "Their depth is band_depth in constraints.csv. The band, T_s u⁺, excuses no law: it says what switching "
           "with u⁺ alone would explain."),
    Metric("held_time_s", lambda m: float(m.held.sum() * m.Ts), added=4,
           definition="How long a row holds the arm back: it acts, or acted before and acts again while φ was never "
           "farther below zero than two switching steps T_s u⁺, as in a sliding mode. Of this row in constraints.csv, "
           "the sum over the rows in results.csv."),
    Metric("saturated_time_s", lambda m: float(m.run.saturated.sum() * m.Ts), added=5,
           definition="How long the command was at a limit of the actuators, of acceleration or jerk; 0 where the "
           "scenario states none."),
    Metric("violation_fraction", lambda m: float(m.fraction.max(initial=0.0)), added=6,
           definition="The greatest depth outside of any row as a fraction of its L, however slight; 0 inside. A run "
           "that converged is a success at every tolerance that is not below it."),
    Metric("violated_tolerant", kind="text", added=7,
           value=lambda m: m.named(m.fraction - TOLERANT),
           definition=f"As violated, below −{TOLERANT:g} L: the tolerant standard."),
)  # fmt: skip
#: Of each row of a run.
ROW_METRICS = (
    Metric("constraint", lambda m: m.run.labels, kind="text"),
    Metric("kind", lambda m: m.record.kinds, kind="text"),
    Metric("unit", lambda m: m.record.units, kind="text"),
    Metric("challenged", lambda m: m.outside_alone.any(axis=0).tolist(), kind="flag",
           definition="A row that tracking alone violates in this scenario and trial, by the strict standard."),
    Metric("active_time_s", lambda m: m.run.active.sum(axis=0) * m.Ts),
    Metric("first_active_s", lambda m: first_active(m.run.t, m.run.active)),
    Metric("last_active_s", lambda m: first_active(m.run.t[::-1], m.run.active[::-1])),
    Metric("clearance_min", lambda m: m.least),
    Metric("usage_max", lambda m: 1.0 - m.least / m.record.length),
    Metric("mean_unused_margin",
           lambda m: mean_while(np.maximum(m.run.clearance, 0.0), m.outside_alone),
           definition="Mean clearance, where positive, over the sampling periods in which tracking alone is outside."),
    Metric("violation_depth", lambda m: m.violated),
    Metric("violation_time_s", lambda m: m.outside.sum(axis=0) * m.Ts),
    Metric("phi_max", lambda m: m.run.phi.max(axis=0)),
    Metric("longest_positive_run_s", Measured.longest_positive_runs),
    Metric("sampling_band", lambda m: m.record.sampling_band,
           definition="How far outside sampling alone puts a row, in its natural unit: where φ is the clearance "
           "itself, as for speeds, one switching step T_s u⁺ (43). Rows of positions have none: φ = σ + K σ̇ smooths "
           "switching."),
    Metric("band_depth", lambda m: m.within_band),
    Metric("held_time_s", lambda m: m.held.sum(axis=0) * m.Ts),
    Metric("usage_held", lambda m: mean_while(m.usage_at_speed, m.held),
           definition="Mean of 1 − (clearance + K · its rate of change) / L, from 0 to 1, over the time for which the "
           "row holds the arm back: usage of the room that is left at the arm's speed. 1 means that the arm was on "
           "the boundary, or came to it as fast as φ ≤ 0 lets it. For speeds it is the mean usage."),
    Metric("share_to_hold", lambda m: m.run.share_to_hold,
           definition="Where φ first comes to zero, or tracking alone would bring it there within the period: the "
           "share of all that the limits of acceleration allow which it takes to hold φ there, L_fφ / Σ|L_gφⱼ|aⱼ. "
           "Above 1, no law could have held the row; below 0, it falls by itself. No value where φ does not get "
           "there, or the scenario states no limits."),
    Metric("utilization", lambda m: mean_while(m.usage, m.outside_alone)),
)  # fmt: skip
#: Words that definitions use.
TERMS = {
    "clearance": "Signed distance of a row to its boundary in its natural unit (px, rad, rad/s, m); positive where "
    "allowed. Looked at in every sample and, wherever it could come to zero at the rate at which it changes, inside "
    "the sampling period: at three instants, and at more where it changes by much.",
    "usage": "1 − clearance / L, which is 1 on the boundary. L is half an allowed range or an obstacle's radius.",
    "active": "A row acts where it holds the arm back: the command makes its φ rise by less than tracking alone would "
    "from the same state (by more than 0.001 u⁺). What slows one row slows others as well: of the slowed rows, those "
    "with φ ≥ 0 act; where there is none, the one nearest to that. What a law says of itself does not count.",
}

RUN = ("suite", "scenario", "controller", "trial")  #: columns of both files that say which run it is
STORED = tuple(sorted((metric for metric in METRICS if metric.value is not None), key=lambda metric: metric.added))
RESULT_COLUMNS = (*RUN, *(metric.column for metric in STORED))
CONSTRAINT_COLUMNS = (*RUN, *(metric.column for metric in ROW_METRICS))
#: The columns of results.csv that differ from run to run on the same machine.
TIMING_COLUMNS = tuple(metric.column for metric in METRICS if metric.kind == "time")
#: What the scores mean: the one source of reports and documentation.
DEFINITIONS = TERMS | {metric.column: metric.definition for metric in (*METRICS, *ROW_METRICS) if metric.definition}


@dataclass(frozen=True)
class Score:
    """One line of results.csv and one of constraints.csv for each row, without suite, scenario, controller, trial."""

    result: Mapping[str, Any]
    constraints: Sequence[Mapping[str, Any]]

    @in_one_line
    def __repr__(self) -> str:
        outside = self.result["violated"] or "none"
        return f"<Score: {self.result['status']}, violated rows: {outside}, of {len(self.constraints)}>"


def score(record: RunRecord, baseline: RunRecord | None) -> Score:
    """Score a run; where it has no sample, what is a number does not exist.

    ``baseline`` is the tracking-only run of the same scenario and trial; without one no row counts as challenged.
    """
    run, some = Measured(record, baseline), len(record.trajectory.t) > 0
    result = {
        metric.column: metric.value(run) if some or metric.kind in ("text", "flag") else math.nan
        for metric in METRICS
        if metric.value is not None
    }
    columns = {metric.column: metric.value(run) for metric in ROW_METRICS if some and metric.value is not None}
    lines = zip(*columns.values(), strict=True)
    return Score(result, [dict(zip(columns, line, strict=True)) for line in lines])
