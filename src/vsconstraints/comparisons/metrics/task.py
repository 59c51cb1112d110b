"""When a run reaches its goal."""

from __future__ import annotations

import numpy as np

from .measured import Measured


def settling_time(measured: Measured) -> float:
    """From the last change of the goal until the goal is reached for good [s]; NaN if the run did not converge."""
    if measured.run.status != "converged":
        return float("nan")
    record, t = measured.record, measured.run.t
    unsettled = np.flatnonzero(~record.settled)
    first = unsettled[-1] + 1 if len(unsettled) else 0
    return max(float(t[first]) - record.last_goal_time, 0.0)
