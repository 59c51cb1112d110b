"""How a simulation ended, judged from what it did and not from what a controller says."""

from __future__ import annotations

import numpy as np

from ..geometry import Pose, distances
from ..kernels.samples import Loop
from .arrays import rest
from .setup import Setup
from .trajectory import Outcome


def judge(setup: Setup, loop: Loop, samples: int, ended: str, reason: str) -> tuple[Outcome, str]:
    """Status and reason of a run.

    Parameters
    ----------
    setup, loop
        What was run, and what was kept of it.
    samples
        How many there are.
    ended, reason
        ``"failed"`` or ``"aborted"`` and why, if the loop ended early; else empty.
    """
    if ended == "failed":
        return "failed", reason
    if ended == "aborted":
        return "aborted", reason
    tolerances, kept, speed = setup.tolerances, loop.kept, setup.reach[3]
    t, last = np.arange(samples) * setup.Ts, (samples - 1) % len(kept.camera_error)
    dwelling = int(np.argmax(t >= t[-1] - tolerances.dwell_s))
    if setup.task.goal_at(t[dwelling]) == len(setup.task.goals) - 1 and loop.scores.unreached[0] < dwelling:
        return "converged", ""
    distance_now, angle_now = kept.camera_error[last]
    final = (
        f"ends {_amount(distance_now * 1e3)} mm and {_amount(angle_now * 1e3)} mrad from the goal"
        if np.isfinite(distance_now)
        else f"ends {_amount(kept.feature_error[last])} px from the goal"
    )
    # half a period for the rounding of times
    since = np.arange(int(np.argmax(t >= t[-1] - rest(setup) - 0.5 * setup.Ts)), samples) % len(kept.camera_t)
    camera_R, camera_t = kept.camera_R[since], kept.camera_t[since]
    moved, turned = distances(camera_R, camera_t, Pose(camera_R[-1], camera_t[-1])).max(axis=0)
    fastest = np.abs(kept.states[(samples - 1) % len(kept.states), 1]).max()
    still = moved < tolerances.translation_m and turned < tolerances.rotation_rad and fastest <= speed
    if still and t[-1] >= rest(setup) - 0.5 * setup.Ts:
        return "trapped", f"at rest, {final}"
    at = f"the fastest joint at {_amount(fastest)} rad/s or m/s, " if fastest > speed else ""
    return "unfinished", f"still moving, {at}{final}"


def _amount(value: float) -> str:
    """Three significant digits, never with an exponent."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}" if value >= 0.001 else "less than 0.001"
