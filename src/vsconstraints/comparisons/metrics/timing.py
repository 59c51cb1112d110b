"""What a control step takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...rows import Array
from ..record import RunRecord


def step_time(record: RunRecord, of_all: Callable[[Array], Any]) -> float:
    """Of the controller's calls [µs]; NaN where there is none but the first."""
    step = record.trajectory.step_time[1:] * 1e6
    return float(of_all(step)) if len(step) else np.nan


def rows_time(record: RunRecord) -> float:
    """Median of rows and task [µs] without the first sample; NaN where there is no other."""
    rows = record.trajectory.rows_time[1:] * 1e6
    return float(np.median(rows)) if len(rows) else np.nan


def missed_periods(record: RunRecord) -> float:
    """Samples that took longer than a period, without the first; NaN where there is no other.

    On an arm, periods that its loop missed: there the law's time is not all that a period has room for.
    """
    if record.missed is not None:
        return record.missed
    both = record.trajectory.step_time[1:] * 1e6 + record.trajectory.rows_time[1:] * 1e6
    return int((both > 1e6 * record.Ts).sum()) if len(both) else np.nan
