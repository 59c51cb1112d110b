"""Results of a simulation: all samples, or scores alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..rows import Array, BoolArray
from ..rows.readable import amount, counted, in_one_line

Outcome = Literal["converged", "slow", "trapped", "aborted", "failed", "unfinished"]
"""How a simulation ended.

``converged``: every goal was reached before the next one began, and the last one is reached and
held. ``slow``: not there, but at the pace of its last seconds it would be in less than as long
again. ``trapped``: at rest, away from the goal. ``aborted``: the controller reported a loss of rank
and the scenario stops there. ``failed``: the scene or the controller could not go on.
``unfinished``: neither of these: it still moves and comes no nearer, or a goal was missed.
"""


@dataclass(frozen=True)
class Trajectory:
    """N samples of a simulation with m rows, M markers, n joints, k features and p robot points."""

    status: Outcome
    reason: str  #: Why, if not ``converged``, and which rows it started outside of.
    t: Array  #: (N,) [s].
    q: Array  #: (N, n) [rad or m].
    qd: Array  #: (N, n).
    qdd_command: Array  #: (N, n).
    error: Array  #: (N, k) feature error, as the controller believes it to be.
    #: (N, 2) distance [m] and angle [rad] of the camera from the goal's pose; NaN if it has none.
    camera_error: Array
    #: (N,) greatest distance of a marker from where the goal wants it [px].
    feature_error_px: Array
    #: (N, 3) in the target's frame [m]: the base frame for a target that stands still.
    camera_position: Array
    features_px: Array  #: (N, M, 2) markers from the image's centre [px].
    points: Array  #: (N, p, 3) robot points in the base frame [m].
    labels: tuple[str, ...]  #: m row labels.
    #: (N, m) as it is, also where a controller believes otherwise; so are σ and clearance.
    phi: Array
    sigma: Array  #: (N, m).
    clearance: Array  #: (N, m) in the natural unit of each constraint.
    #: (N, m) rows that hold the arm back: :func:`vsconstraints.compiled.samples.mark_acting`.
    active: BoolArray
    saturated: BoolArray  #: (N,) whether the command is at a limit of the actuators.
    #: (m,) share of the available accelerations that it takes to hold φ at zero, where it first
    #: gets there; above 1 no law could have. NaN where it does not get there, and without limits.
    share_to_hold: Array
    #: (N, m) least clearance inside the period after each sample; infinite if not inspected.
    between_clearance: Array
    rows_time: Array  #: (N,) wall time of rows and task [s].
    #: (N,) wall time of the controller's call [s]: see :func:`vsconstraints.simulation.simulate`.
    step_time: Array
    fallbacks: int  #: How often another solver than the one asked for gave the answer.
    compiled: bool = False  #: Whether rows, task and law all ran compiled.

    @in_one_line
    def __repr__(self) -> str:
        lasts = f"{amount(self.t[-1])} s, " if len(self.t) else ""
        size = f"{counted(len(self.t), 'sample')}, {counted(len(self.labels), 'row')}"
        return f"<Trajectory {self.status}: {lasts}{size}>"

    def active_intervals(self, label: str, gap: float = 0.6) -> list[tuple[float, float]]:
        """When φ of a row was at or above zero [s]: first and last sample, intervals closer than
        ``gap`` merged.
        """
        return intervals(self.t, self.phi[:, self.labels.index(label)] >= 0.0, gap)


@dataclass(frozen=True)
class RunScores:
    """Scores of a run with m rows and n joints, in samples alone; NaN for what does not exist."""

    status: Outcome
    reason: str  #: As of a :class:`Trajectory`.
    compiled: bool  #: Whether rows, task and law all ran compiled.
    labels: tuple[str, ...]  #: m row labels.
    duration_s: float  #: Time of the last sample.
    #: (g,) from the beginning of each goal until it is reached for good, before the next one begins
    #: or the run ends.
    settling_times_s: Array
    final_translation_error_m: float  #: Of the camera's pose at the end; so is the next one.
    final_rotation_error_rad: float
    #: Of the marker farthest from where the goal wants it, at the end.
    final_feature_error_px: float
    #: Σ‖Δq̈_c‖ per second of the setup's duration; so are the next two.
    acceleration_variation: float
    jerk_rms: float  #: Root mean square of ‖Δq̈_c‖ / T_s.
    switching_rate_hz: float  #: How often per second the set of acting rows changes.
    acceleration_max: Array  #: (n,) greatest |q̈_c| of each joint.
    phi_max: Array  #: (m,) greatest φ of each row.
    sigma_max: Array  #: (m,) greatest σ of each row: above zero, how deep it was violated.
    outside_time_s: Array  #: (m,) sampling periods that begin with σ > 0.
    active_time_s: Array  #: (m,) how long each row held the arm back.
    first_active_s: Array  #: (m,)
    last_active_s: Array  #: (m,)
    longest_positive_run_s: Array  #: (m,) longest time with φ ≥ 0.
    saturated_time_s: float  #: How long the command was at a limit of the actuators.
    share_to_hold: Array  #: (m,) see :class:`Trajectory`.

    @property
    def settling_time_s(self) -> float:
        """Their sum; of converged runs."""
        return float(np.nansum(self.settling_times_s)) if self.status == "converged" else np.nan

    @in_one_line
    def __repr__(self) -> str:
        outside = counted(int((self.outside_time_s > 0.0).sum()), "row")
        return (
            f"<RunScores {self.status}: {amount(self.duration_s)} s, {outside} of "
            f"{len(self.labels)} outside>"
        )


def intervals(t: Array, flags: BoolArray, gap: float) -> list[tuple[float, float]]:
    """First and last time of each run of flags; runs closer than ``gap`` [s] are merged."""
    times = t[flags]
    if not len(times):
        return []
    breaks = np.flatnonzero(np.diff(times) > gap)
    firsts = np.concatenate(([0], breaks + 1))
    lasts = np.concatenate((breaks, [len(times) - 1]))
    return [(float(times[a]), float(times[b])) for a, b in zip(firsts, lasts, strict=True)]
