"""When a run reaches its goal."""

from __future__ import annotations

import numpy as np

from ...formulas.tracking import goals_at
from ...simulation.outcome import settling_times
from .measured import Measured


def settling_time(measured: Measured) -> float:
    """From the beginning of each goal until it is reached for good [s], added up; NaN if the run did not converge."""
    if measured.run.status != "converged":
        return float("nan")
    record, t = measured.record, measured.run.t
    goals = goals_at(record.goal_begins, t)
    unsettled = [np.flatnonzero((goals == goal) & ~record.settled) for goal in range(len(record.goal_begins))]
    unreached = np.array([samples[-1] if len(samples) else -1 for samples in unsettled])
    return float(np.nansum(settling_times(unreached, record.goal_begins, len(t), record.Ts)))
