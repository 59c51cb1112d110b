"""How a simulation ended, judged from what it did and not from what a controller says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry import Pose, distances
from ..rows import Array
from .setup import Setup
from .trajectory import Outcome

REST = 1.0, 10
"""Seconds, and sampling periods, that a camera must have hardly moved at least to be at rest, however short
``Tolerances.rest`` is: in less, a motion that is slow, turns back or is sampled rarely looks the same.
"""


def judge(
    setup: Setup,
    ended: str,
    reason: str,
    t: Array,
    goal: NDArray[np.int64],
    camera_error: Array,
    feature_error: Array,
    camera_R: Array,
    camera_t: Array,
) -> tuple[Outcome, str]:
    """Status and reason of a run.

    Parameters
    ----------
    setup
        What was run.
    ended, reason
        ``"failed"`` or ``"aborted"`` and why, if the loop ended early.
    t, goal
        (N,) time [s] and index of the goal.
    camera_error, feature_error
        As in :class:`Trajectory`.
    camera_R, camera_t
        (N, 3, 3) and (N, 3): poses of the camera in the target's frame.
    """
    if ended == "failed":
        return "failed", reason
    if ended == "aborted":
        return "aborted", reason
    tolerances = setup.tolerances
    reached = setup.reached(camera_error, feature_error)
    last = goal == len(setup.task.goals) - 1
    dwelling = t >= t[-1] - tolerances.dwell_s
    if last[dwelling].all() and reached[dwelling].all():
        return "converged", ""
    distance_now, angle_now = camera_error[-1]
    final = (
        f"ends {_amount(distance_now * 1e3)} mm and {_amount(angle_now * 1e3)} mrad from the goal"
        if np.isfinite(distance_now)
        else f"ends {_amount(feature_error[-1])} px from the goal"
    )
    rest = max(tolerances.rest_s, REST[0], REST[1] * setup.Ts)
    # half a period for the rounding of times
    since = int(np.argmax(t >= t[-1] - rest - 0.5 * setup.Ts))
    moved, turned = distances(camera_R[since:], camera_t[since:], Pose(camera_R[-1], camera_t[-1])).max(axis=0)
    if t[-1] >= rest - 0.5 * setup.Ts and moved < tolerances.translation_m and turned < tolerances.rotation_rad:
        return "trapped", f"at rest, {final}"
    return "unfinished", f"still moving, {final}"


def _amount(value: float) -> str:
    """Three significant digits, never with an exponent."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}" if value >= 0.001 else "less than 0.001"
