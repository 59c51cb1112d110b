"""Results of a simulation: all samples, or scores alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..rows import Array, BoolArray
from ..rows.readable import amount, counted, in_one_line

Outcome = Literal["converged", "slow", "trapped", "aborted", "failed", "unfinished"]
"""How a simulation ended.

``converged``: every goal was reached before the next one began, and the last one is reached and held. ``slow``: not
there, but at the pace of its last seconds it would be in less than as long again. ``trapped``: at rest, away from the
goal. ``aborted``: the controller reported a loss of rank and the scenario stops there. ``failed``: the scene or the
controller could not go on. ``unfinished``: neither of these: it still moves and comes no nearer, or a goal was missed.
"""


@dataclass(frozen=True)
class Trajectory:
    """N samples of a simulation with m rows, M markers, n joints, k features and p robot points.

    Attributes
    ----------
    status, reason
        How it ended, why if not ``converged``, and which rows it started outside of.
    t
        (N,) [s].
    q, qd, qdd_command
        (N, n) state and command.
    error
        (N, k) feature error, as the controller believes it to be.
    camera_error
        (N, 2) distance [m] and angle [rad] between the camera and the goal's pose; NaN where there is none.
    feature_error_px
        (N,) greatest distance of a marker from where the goal wants it [px].
    camera_position
        (N, 3) in the target's frame [m]: the base frame for a target that stands still.
    features_px
        (N, M, 2) markers from the image's centre [px].
    points
        (N, p, 3) robot points in the base frame [m].
    labels
        m row labels.
    phi, sigma, clearance
        (N, m) as they are, also where a controller believes otherwise.
    active
        (N, m) rows that hold the arm back: :func:`vsconstraints.compiled.samples.mark_acting`.
    saturated
        (N,) whether the command is at a limit of the actuators.
    share_to_hold
        (m,) share of the accelerations that there are which it takes to hold φ at zero, where it first gets there;
        above 1 no law could have. NaN where it does not get there, and without limits.
    between_clearance
        (N, m) least clearance at instants inside the period after each sample; infinite where none was looked at.
    rows_time, step_time
        (N,) wall time for rows and task, and for the controller's call [s]: by which route, see
        :func:`vsconstraints.simulation.simulate`.
    fallbacks
        How often another solver than the one asked for gave the answer.
    compiled
        Whether rows, task and law all ran compiled.
    """

    status: Outcome
    reason: str
    t: Array
    q: Array
    qd: Array
    qdd_command: Array
    error: Array
    camera_error: Array
    feature_error_px: Array
    camera_position: Array
    features_px: Array
    points: Array
    labels: tuple[str, ...]
    phi: Array
    sigma: Array
    clearance: Array
    active: BoolArray
    saturated: BoolArray
    share_to_hold: Array
    between_clearance: Array
    rows_time: Array
    step_time: Array
    fallbacks: int
    compiled: bool = False

    @in_one_line
    def __repr__(self) -> str:
        lasts = f"{amount(self.t[-1])} s, " if len(self.t) else ""
        size = f"{counted(len(self.t), 'sample')}, {counted(len(self.labels), 'row')}"
        return f"<Trajectory {self.status}: {lasts}{size}>"

    def active_intervals(self, label: str, gap: float = 0.6) -> list[tuple[float, float]]:
        """When φ of a row was at or above zero [s]: first and last sample, intervals closer than ``gap`` merged."""
        return intervals(self.t, self.phi[:, self.labels.index(label)] >= 0.0, gap)


@dataclass(frozen=True)
class RunScores:
    """Scores of a run with m rows and n joints, in samples alone; NaN for what there is not.

    Attributes
    ----------
    status, reason
        As of a :class:`Trajectory`.
    compiled
        Whether rows, task and law all ran compiled.
    labels
        m row labels.
    duration_s
        Time of the last sample.
    settling_times_s
        (g,) from the beginning of each goal until it is reached for good, before the next one begins or the run ends;
        NaN where it is not.
    final_translation_error_m, final_rotation_error_rad, final_feature_error_px
        Of the camera's pose, and of the marker farthest from where the goal wants it, at the end.
    acceleration_variation, jerk_rms
        Σ‖Δq̈_c‖ per second, and the root mean square of ‖Δq̈_c‖ / T_s, both over the setup's duration.
    switching_rate_hz
        How often per second the set of acting rows changes, likewise.
    acceleration_max
        (n,) greatest |q̈_c| of each joint.
    phi_max, sigma_max
        (m,) greatest φ and σ of each row; above zero, how deep it was outside, in units of φ.
    outside_time_s
        (m,) sampling periods that begin with σ > 0.
    active_time_s, first_active_s, last_active_s
        (m,) how long each row held the arm back, and when first and last.
    longest_positive_run_s
        (m,) longest time with φ ≥ 0.
    saturated_time_s
        How long the command was at a limit of the actuators.
    share_to_hold
        (m,) see :class:`Trajectory`.
    """

    status: Outcome
    reason: str
    compiled: bool
    labels: tuple[str, ...]
    duration_s: float
    settling_times_s: Array
    final_translation_error_m: float
    final_rotation_error_rad: float
    final_feature_error_px: float
    acceleration_variation: float
    jerk_rms: float
    switching_rate_hz: float
    acceleration_max: Array
    phi_max: Array
    sigma_max: Array
    outside_time_s: Array
    active_time_s: Array
    first_active_s: Array
    last_active_s: Array
    longest_positive_run_s: Array
    saturated_time_s: float
    share_to_hold: Array

    @property
    def settling_time_s(self) -> float:
        """Their sum; of converged runs."""
        return float(np.nansum(self.settling_times_s)) if self.status == "converged" else np.nan

    @in_one_line
    def __repr__(self) -> str:
        outside = counted(int((self.outside_time_s > 0.0).sum()), "row")
        return f"<RunScores {self.status}: {amount(self.duration_s)} s, {outside} of {len(self.labels)} outside>"


def intervals(t: Array, flags: BoolArray, gap: float) -> list[tuple[float, float]]:
    """First and last time of each run of flags; runs closer than ``gap`` [s] are one."""
    times = t[flags]
    if not len(times):
        return []
    breaks = np.flatnonzero(np.diff(times) > gap)
    firsts, lasts = np.concatenate(([0], breaks + 1)), np.concatenate((breaks, [len(times) - 1]))
    return [(float(times[a]), float(times[b])) for a, b in zip(firsts, lasts, strict=True)]
