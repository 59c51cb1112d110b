"""Scores of a run. The definitions are part of the product: reports print :data:`DEFINITIONS`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..rows import Array, BoolArray
from ..simulation import Trajectory
from .record import RunRecord

NEGLIGIBLE = 1e-4
"""Depth, as a fraction of the characteristic length, up to which a row does not count as violated.

A controller that holds a row on its boundary is off by the curvature inside a sampling period: some 1e-5.
"""

SLIDING_GAP = 10
"""In a sliding mode φ crosses zero again and again: within this many samples, from either side."""

RESULT_COLUMNS = (
    "suite",
    "scenario",
    "controller",
    "trial",
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
    "step_time_median_us",
    "step_time_p99_us",
    "step_time_max_us",
    "rows_time_median_us",
    "missed_periods",
    "compiled",
)
CONSTRAINT_COLUMNS = (
    "suite",
    "scenario",
    "controller",
    "trial",
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
)
TIMING_COLUMNS = (
    "step_time_median_us",
    "step_time_p99_us",
    "step_time_max_us",
    "rows_time_median_us",
    "missed_periods",
)
"""The columns of results.csv that differ from run to run on the same machine."""

DEFINITIONS = {
    "clearance": "Signed distance of a row to its boundary in its natural unit (px, rad, rad/s, m); positive where "
    "allowed. Looked at in every sample and, near the boundary, at three instants inside each sampling period.",
    "usage": "1 − clearance / L, which is 1 on the boundary. L is half an allowed range or an obstacle's radius.",
    "challenged": "A row that tracking alone violates in this scenario and trial. Only these count for utilization.",
    "utilization": "Peak usage, capped at 1, averaged over the challenged rows; 1 means the allowed space was used "
    "to its boundary.",
    "mean_unused_margin": "Mean clearance, where positive, over the samples in which tracking alone is outside.",
    "violated": "Rows whose clearance fell below −0.0001 L, separated by semicolons.",
    "violation_depth": "In results.csv the greatest depth as a fraction of L over all rows; in constraints.csv in "
    "the row's natural unit. Includes the instants between samples.",
    "violation_time_s": "Time with a clearance below −0.0001 L: of any row in results.csv, of this row in "
    "constraints.csv.",
    "phi_band": "Peak-to-peak φ while sliding, of the row in which it is largest relative to its bound. Sliding: a row "
    "that shapes the command and whose φ crosses zero again and again, within ten samples from either side. Where φ "
    "stays positive for longer the sliding mode is lost: see phi_max and longest_positive_run_s.",
    "phi_band_bound": "T_s u⁺ of that row: the bound (43) on one switching step of the constraint action alone. "
    "Tracking moves φ as well, so that the measured band can exceed it.",
    "switching_rate_hz": "How often per second the set of rows that shape the command changes.",
    "acceleration_variation": "Total variation of the commanded acceleration per second, Σ‖Δq̈_c‖ / duration.",
    "jerk_rms": "Root mean square of ‖Δq̈_c‖ / T_s.",
    "step_time": "Wall time of the controller's call alone [µs], without the first call.",
    "rows_time": "Wall time of kinematics, features, rows and task [µs], the same code for every controller. Where a "
    "controller is deceived (disturbances, motions it is not told of) without the kinematics, and in the NumPy form.",
    "missed_periods": "Samples in which rows, task and controller together took longer than T_s; without the first.",
    "compiled": "Whether rows, task and controller all ran compiled; what runs in NumPy takes longer.",
    "settling_time_s": "From the last change of the goal until the error stays within tolerance.",
    "status": "converged: the last goal is reached and held. trapped: at rest away from it. aborted: the active rows "
    "lost full row rank (section 5.2). failed: the scene or the controller could not go on. unfinished: still moving.",
}
"""What the scores mean: the one source of reports and documentation."""


@dataclass(frozen=True)
class Score:
    """One line of results.csv and one of constraints.csv for each row, without suite, scenario, controller, trial."""

    result: dict[str, Any]
    constraints: list[dict[str, Any]]


def score(record: RunRecord, baseline: RunRecord | None) -> Score:
    """Score a run.

    Parameters
    ----------
    record
        The run.
    baseline
        The tracking-only run of the same scenario and trial; without one (it failed) no row counts as challenged.
    """
    run, L = record.trajectory, record.length
    m = len(run.labels)
    N = len(run.t)
    depth: Array = np.zeros(m)
    challenged: BoolArray = np.zeros(m, dtype=np.bool_)
    unused: Array = np.full(m, np.nan)
    least = _least_clearance(run)
    if N:
        depth = _depth(least, L)
    if N and baseline is not None and baseline.trajectory.labels == run.labels and len(baseline.trajectory.t):
        theirs = baseline.trajectory
        challenged = _depth(_least_clearance(theirs), baseline.length) > 0.0
        common = min(N, len(theirs.t))
        outside = theirs.clearance[:common] < 0.0
        margin = np.maximum(run.clearance[:common], 0.0)
        count = outside.sum(axis=0)
        unused = np.divide(np.where(outside, margin, 0.0).sum(axis=0), count, out=np.full(m, np.nan), where=count > 0)
    usage = 1.0 - least / L
    rows = [
        {
            "constraint": label,
            "kind": record.kinds[i],
            "unit": record.units[i],
            "challenged": bool(challenged[i]),
            **_activity(run.t, run.active[:, i], record.Ts),
            "clearance_min": least[i],
            "usage_max": usage[i],
            "mean_unused_margin": unused[i],
            "violation_depth": depth[i],
            "violation_time_s": float((run.clearance[:, i] < -NEGLIGIBLE * L[i]).sum() * record.Ts),
            "phi_max": run.phi[:, i].max(),
            "longest_positive_run_s": _longest_run(run.phi[:, i] >= 0.0) * record.Ts,
        }
        for i, label in enumerate(run.labels)
        if N
    ]
    used = np.clip(usage[challenged], 0.0, 1.0)
    violated = [run.labels[i] for i in np.flatnonzero(depth > 0.0)]
    result = {
        "status": run.status,
        "reason": run.reason,
        "duration_s": run.t[-1] if N else np.nan,
        "settling_time_s": _settling_time(record),
        "final_translation_error_m": run.camera_error[-1, 0] if N else np.nan,
        "final_rotation_error_rad": run.camera_error[-1, 1] if N else np.nan,
        "final_feature_error_px": run.feature_error_px[-1] if N else np.nan,
        "utilization": used.mean() if len(used) else np.nan,
        "violated": "; ".join(violated),
        "violation_depth": float((depth / L).max(initial=0.0)) if N else np.nan,
        "violation_time_s": float((run.clearance < -NEGLIGIBLE * L).any(axis=1).sum() * record.Ts) if N else np.nan,
        **_chattering(record),
        **_times(run, record.Ts),
        "compiled": run.compiled,
    }
    return Score(result, rows)


def _least_clearance(run: Trajectory) -> Array:
    if not len(run.t):
        return np.full(len(run.labels), np.nan)
    least: Array = np.minimum(run.clearance.min(axis=0), run.between_clearance)
    return least


def _depth(least: Array, L: Array) -> Array:
    """How far outside each row was, in its natural unit; 0 where it was not."""
    return np.where(least < -NEGLIGIBLE * L, -least, 0.0)


def _activity(t: Array, active: BoolArray, Ts: float) -> dict[str, float]:
    times = t[active]
    return {
        "active_time_s": len(times) * Ts,
        "first_active_s": times[0] if len(times) else np.nan,
        "last_active_s": times[-1] if len(times) else np.nan,
    }


def _longest_run(flags: BoolArray) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _settling_time(record: RunRecord) -> float:
    if record.trajectory.status != "converged":
        return float("nan")
    t, unsettled = record.trajectory.t, np.flatnonzero(~record.settled)
    first = unsettled[-1] + 1 if len(unsettled) else 0
    return max(float(t[first]) - record.last_goal_time, 0.0)


def _chattering(record: RunRecord) -> dict[str, float]:
    run, Ts = record.trajectory, record.Ts
    N = len(run.t)
    band, bound = np.nan, np.nan
    for i, gain in enumerate(record.switching_gain if N else ()):
        measured = _band(run.phi[:, i], run.active[:, i])
        if np.isfinite(measured) and not measured / (Ts * gain) <= band / bound:
            band, bound = measured, Ts * gain
    duration = (N - 1) * Ts
    if N < 2:
        return dict.fromkeys(
            ("phi_band", "phi_band_bound", "switching_rate_hz", "acceleration_variation", "jerk_rms"), np.nan
        )
    change = np.sqrt((np.diff(run.qdd_command, axis=0) ** 2).sum(axis=1))
    return {
        "phi_band": band,
        "phi_band_bound": bound,
        "switching_rate_hz": float((run.active[1:] != run.active[:-1]).any(axis=1).sum() / duration),
        "acceleration_variation": float(change.sum() / duration),
        "jerk_rms": float(np.sqrt((change**2).mean()) / Ts),
    }


def _band(phi: Array, acted: BoolArray) -> float:
    """Peak-to-peak φ over the sliding intervals; NaN if there is none with three samples of φ ≥ 0 or more."""
    at = np.flatnonzero((phi >= 0.0) & acted)
    bands = []
    for interval in np.split(at, np.flatnonzero(np.diff(at) > SLIDING_GAP) + 1):
        if len(interval) >= 3:
            span = phi[interval[0] : interval[-1] + 1]
            if _longest_run(span >= 0.0) <= SLIDING_GAP:
                bands.append(float(np.ptp(span)))
    return max(bands, default=float("nan"))


def _times(run: Trajectory, Ts: float) -> dict[str, float]:
    if len(run.t) < 2:
        return dict.fromkeys(TIMING_COLUMNS, np.nan)
    step, rows = run.step_time[1:], run.rows_time[1:]
    return {
        "step_time_median_us": float(np.median(step) * 1e6),
        "step_time_p99_us": float(np.quantile(step, 0.99) * 1e6),
        "step_time_max_us": float(step.max() * 1e6),
        "rows_time_median_us": float(np.median(rows) * 1e6),
        "missed_periods": int((step + rows > Ts).sum()),
    }
