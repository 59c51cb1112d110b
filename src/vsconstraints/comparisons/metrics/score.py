"""A run's line of results.csv, and those of its rows in constraints.csv."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...rows import Array, BoolArray
from ..record import RunRecord
from .chattering import chattering, longest_run
from .clearance import Clearances, challenged, clearances, unused_margin
from .timing import times
from .utilization import held, usage_while_held, utilization


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
    run, found, when = record.trajectory, clearances(record), held(record)
    some = len(run.t) > 0
    result = {
        "status": run.status,
        "reason": run.reason,
        "duration_s": run.t[-1] if some else np.nan,
        "settling_time_s": _settling_time(record),
        "final_translation_error_m": run.camera_error[-1, 0] if some else np.nan,
        "final_rotation_error_rad": run.camera_error[-1, 1] if some else np.nan,
        "final_feature_error_px": run.feature_error_px[-1] if some else np.nan,
        "utilization": utilization(record, when),
        "violated": _named(run.labels, found.violated),
        "violation_depth": float((found.violated / record.length).max(initial=0.0)) if some else np.nan,
        "violation_time_s": float(found.outside.any(axis=1).sum() * record.Ts) if some else np.nan,
        "within_band": _named(run.labels, found.within_band),
        "held_time_s": float(when.sum() * record.Ts) if some else np.nan,
        **chattering(record),
        **times(record),
        "compiled": run.compiled,
    }
    return Score(result, _rows(record, baseline, found, when) if some else [])


def _rows(record: RunRecord, baseline: RunRecord | None, found: Clearances, when: BoolArray) -> list[dict[str, Any]]:
    run, Ts = record.trajectory, record.Ts
    hit, unused, used = challenged(record, baseline), unused_margin(record, baseline), usage_while_held(record, when)
    return [
        {
            "constraint": label,
            "kind": record.kinds[i],
            "unit": record.units[i],
            "challenged": bool(hit[i]),
            **_activity(run.t, run.active[:, i], Ts),
            "clearance_min": found.least[i],
            "usage_max": 1.0 - found.least[i] / record.length[i],
            "mean_unused_margin": unused[i],
            "violation_depth": found.violated[i],
            "violation_time_s": float(found.outside[:, i].sum() * Ts),
            "phi_max": run.phi[:, i].max(),
            "longest_positive_run_s": longest_run(run.phi[:, i] >= 0.0) * Ts,
            "sampling_band": record.sampling_band[i],
            "band_depth": found.within_band[i],
            "held_time_s": float(when[:, i].sum() * Ts),
            "usage_held": used[i],
        }
        for i, label in enumerate(run.labels)
    ]


def _named(labels: tuple[str, ...], depth: Array) -> str:
    return "; ".join(labels[i] for i in np.flatnonzero(depth > 0.0))


def _activity(t: Array, active: BoolArray, Ts: float) -> dict[str, float]:
    times = t[active]
    return {
        "active_time_s": len(times) * Ts,
        "first_active_s": times[0] if len(times) else np.nan,
        "last_active_s": times[-1] if len(times) else np.nan,
    }


def _settling_time(record: RunRecord) -> float:
    """From the last change of the goal until the goal is reached for good [s]; NaN if the run did not converge."""
    if record.trajectory.status != "converged":
        return float("nan")
    t, unsettled = record.trajectory.t, np.flatnonzero(~record.settled)
    first = unsettled[-1] + 1 if len(unsettled) else 0
    return max(float(t[first]) - record.last_goal_time, 0.0)
