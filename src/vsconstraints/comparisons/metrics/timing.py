"""What a control step takes."""

from __future__ import annotations

import numpy as np

from ..record import RunRecord


def times(record: RunRecord) -> dict[str, float]:
    """Wall times of a run's calls [µs], and samples that took longer than a period; all without the first sample."""
    run = record.trajectory
    step, rows = run.step_time[1:] * 1e6, run.rows_time[1:] * 1e6
    some = len(step) > 0
    return {
        "step_time_median_us": float(np.median(step)) if some else np.nan,
        "step_time_p99_us": float(np.quantile(step, 0.99)) if some else np.nan,
        "step_time_max_us": float(step.max()) if some else np.nan,
        "rows_time_median_us": float(np.median(rows)) if some else np.nan,
        "missed_periods": int((step + rows > 1e6 * record.Ts).sum()) if some else np.nan,
    }
