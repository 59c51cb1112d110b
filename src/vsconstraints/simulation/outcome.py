"""Outcome and scores of a simulation, judged by its motion and not by its controller."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..compiled.samples import Loop
from ..formulas.tracking import ROUNDING
from ..robots.geometry import Pose, distances
from ..rows import Array, IntArray
from ..vision.features import CameraPose
from .setup import Setup
from .trajectory import Outcome, RunScores

#: Early end of the loop; empty if all samples were run.
EarlyEnd = Literal["", "failed", "aborted"]


def judge(
    setup: Setup, loop: Loop, samples: int, ended: EarlyEnd, reason: str, dwell: float | None = None
) -> tuple[Outcome, str]:
    """Return status and reason of a run of so many samples.

    ``reason`` is the reason for an early end of the loop, if any. ``dwell`` is the time for which
    the last goal must have been held [s]; None stands for that of the tolerances.

    The first that applies is returned: the status of an early end; ``converged`` if all goals were
    held; ``unfinished`` if the last one is held, but an earlier one was missed; ``slow`` if the
    goal has not changed for the setup's ``rest_time``, and at the pace in that time the arm would
    arrive in less time than the run has taken so far; ``trapped`` if joints and camera are at rest,
    the camera for the ``rest_time``; ``unfinished`` otherwise.
    """
    if ended:
        return ended, reason
    if dwell is None:
        dwell = setup.tolerances.dwell_s
    first = first_samples(loop.goals.begins, samples, setup.Ts)
    missed = _missed_goals(loop, samples, first)
    left = [f"goal {goal + 1} was not reached before goal {goal + 2} began" for goal in missed]
    t = np.arange(samples) * setup.Ts
    dwelling = int(np.argmax(t >= t[-1] - dwell))
    has_begun = first[-1] <= dwelling
    if has_begun and loop.scores.unreached[-1] < dwelling:
        status: Outcome = "unfinished" if left else "converged"
        return status, "; ".join(left)
    final = f"ends {_distance_text(loop, samples)} from the goal"
    latest = _latest_samples(setup, t)
    if latest is not None and _approaches(setup, loop, latest, first):
        return "slow", "; ".join([f"still approaching, {final}", *left])
    fastest = _fastest_joint(loop, samples)
    joints_rest = fastest <= setup.goal_tolerances[-1, 3]
    if latest is not None and joints_rest and _camera_rests(setup, loop, latest):
        return "trapped", "; ".join([f"at rest, {final}", *left])
    motion = "still moving"
    if not joints_rest:
        motion = f"still moving, the fastest joint at {_amount(fastest)} rad/s or m/s"
    return "unfinished", "; ".join([f"{motion}, {final}", *left])


def _missed_goals(loop: Loop, samples: int, first: IntArray) -> IntArray:
    """Return the numbers, from 0, of the goals that were not reached before the next one began.

    ``first`` (g,) are the first samples of the goals.
    """
    # a goal that begins and ends between two samples is not missed
    is_sampled = first[:-1] < first[1:]
    has_ended = first[1:] < samples
    # in the last sample before the next goal
    is_unreached = loop.scores.unreached[:-1] >= first[1:] - 1
    return np.flatnonzero(is_sampled & has_ended & is_unreached)


def _latest_samples(setup: Setup, t: Array) -> IntArray | None:
    """Return the samples of the last ``rest_time``; None if the run has not taken so long."""
    # half a period allows for the rounding of times
    if t[-1] < setup.rest_time - 0.5 * setup.Ts:
        return None
    is_latest = t >= t[-1] - setup.rest_time - 0.5 * setup.Ts
    begin = int(np.argmax(is_latest))
    return np.arange(begin, len(t))


def _approaches(setup: Setup, loop: Loop, latest: IntArray, first: IntArray) -> bool:
    """True if the pace of the latest samples leads to the goal in less time than has passed.

    False if the goal has changed after the first of these samples. ``first`` is that of
    :func:`_missed_goals`.
    """
    is_new_goal = (latest[0] < first) & (first <= latest[-1])
    if is_new_goal.any():
        return False
    elapsed = latest[-1] * setup.Ts
    return bool(_time_to_go(setup, loop, latest) < elapsed)


def _fastest_joint(loop: Loop, samples: int) -> float:
    """Return the greatest speed of a joint in the last sample [rad/s or m/s]."""
    states = loop.kept.states
    last = (samples - 1) % len(states)
    speeds = states[last, 1]
    return float(np.abs(speeds).max())


def _distance_text(loop: Loop, samples: int) -> str:
    """Return the distance from the goal in the last sample, of the camera or in the image."""
    kept = loop.kept
    last = (samples - 1) % len(kept.camera_error)
    distance, angle = 1e3 * kept.camera_error[last]
    if np.isfinite(distance):
        return f"{_amount(distance)} mm and {_amount(angle)} mrad"
    return f"{_amount(kept.feature_error[last])} px"


def _camera_rests(setup: Setup, loop: Loop, latest: IntArray) -> bool:
    """True if the camera has not left its last pose, up to the tolerances, in these samples."""
    kept = loop.kept
    # a ring buffer, if only the latest poses are kept
    at = latest % len(kept.camera_t)
    R = kept.camera_R[at]
    t = kept.camera_t[at]
    last = Pose(R[-1], t[-1])
    moved, turned = distances(R, t, last).max(axis=0)
    tolerances = setup.tolerances
    return bool(moved < tolerances.translation_m and turned < tolerances.rotation_rad)


def _time_to_go(setup: Setup, loop: Loop, latest: IntArray) -> float:
    """Return the time in which the last goal is reached at the pace of these samples [s].

    The time is infinite if the goal is not approached. The pace is that of the error in units of
    its tolerance, from the mean of the samples' first half to the mean of their second half. Noise
    affects these means less than single samples.
    """
    tolerance = setup.goal_tolerances[-1]
    kept = loop.kept
    at = latest % len(kept.camera_error)
    if isinstance(setup.task.feature, CameraPose):
        errors = kept.camera_error[at] / tolerance[:2]
        error = errors.max(axis=1)
    else:
        error = kept.feature_error[at] / tolerance[2]
    half = len(error) // 2
    if not half:
        return np.inf
    decrease = error[:half].mean() - error[half:].mean()
    interval = 0.5 * len(error) * setup.Ts
    pace = decrease / interval
    left = error[-1] - 1.0
    is_approached = pace > 0.0 and left > 0.0
    return float(left / pace) if is_approached else np.inf


def first_samples(begins: Array, samples: int, Ts: float) -> IntArray:
    """Return the first sample (g,) in which each goal or a later one holds.

    The result is ``samples`` if there is none.
    """
    times = np.arange(samples) * Ts
    first = np.searchsorted(times + ROUNDING, begins)
    first[0] = 0  # the first goal also holds before its beginning
    return first


def settling_times(unreached: IntArray, begins: Array, samples: int, Ts: float) -> Array:
    """Return the settling time (g,) of each goal [s].

    It is counted from the beginning of a goal until it is reached for good, before the next goal
    begins or the run ends; NaN if it is not reached. Leaving a goal early brings no advantage,
    because the beginnings are fixed. ``unreached`` (g,) is the last sample in which a goal is not
    reached while it holds, −1 if there is none; goals begin at ``begins`` (g,) [s].
    """
    first = first_samples(begins, samples, Ts)
    reached = np.maximum(unreached + 1, first)
    ends = np.append(first[1:], samples)
    is_reached = reached < ends
    times = np.maximum(reached * Ts - begins, 0.0)
    return np.where(is_reached, times, np.nan)


def scores_of(
    setup: Setup, loop: Loop, samples: int, outcome: tuple[Outcome, str], compiled: bool
) -> RunScores:
    """Return the scores of a loop after so many samples."""
    Ts = setup.Ts
    kept = loop.kept
    scores = loop.scores
    last = (samples - 1) % len(kept.camera_error)
    distance = angle = pixels = np.nan
    if samples:
        distance, angle = kept.camera_error[last]
        pixels = kept.feature_error[last]
    duration = (samples - 1) * Ts if samples else np.nan
    steps = min(samples, setup.samples) - 1 if samples > 1 else np.nan
    acceleration_variation = scores.variation[0] / (steps * Ts)
    jerk_rms = np.sqrt(scores.squared_variation[0] / steps) / Ts
    switching_rate = scores.switches[0] / (steps * Ts)
    return RunScores(
        *outcome,
        compiled=compiled,
        labels=setup.constraints.labels,
        duration_s=duration,
        settling_times_s=settling_times(scores.unreached, loop.goals.begins, samples, Ts),
        final_translation_error_m=float(distance),
        final_rotation_error_rad=float(angle),
        final_feature_error_px=float(pixels),
        acceleration_variation=float(acceleration_variation),
        jerk_rms=float(jerk_rms),
        switching_rate_hz=float(switching_rate),
        acceleration_max=scores.acceleration_max,
        phi_max=scores.phi_max,
        sigma_max=scores.sigma_max,
        outside_time_s=scores.outside * Ts,
        active_time_s=scores.acted * Ts,
        first_active_s=_time_of(scores.first_active, Ts),
        last_active_s=_time_of(scores.last_active, Ts),
        longest_positive_run_s=scores.longest_positive * Ts,
        saturated_time_s=float(scores.saturated[0] * Ts),
        share_to_hold=scores.share_to_hold,
    )


def _time_of(sample: IntArray, Ts: float) -> Array:
    """Return the times of samples (m,) [s]; NaN for negative ones, which stand for none."""
    return np.where(sample < 0, np.nan, sample * Ts)


def _amount(value: float) -> str:
    """Return three significant digits, never with an exponent."""
    if value >= 100.0:
        return f"{value:.0f}"
    if value >= 0.001:
        return f"{value:.3g}"
    return "less than 0.001"
