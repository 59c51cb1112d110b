"""Results of a simulation: all samples, or only scores."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from ..rows import Array, BoolArray
from ..rows.readable import amount, counted, in_one_line

Outcome = Literal["converged", "slow", "trapped", "aborted", "failed", "unfinished"]
"""Outcome of a simulation.

``converged``: every goal was reached before the next one began, and the last one is reached and
held. ``slow``: the last goal is not reached, but at the pace of the last seconds it would be
reached in less time than the run has taken. ``trapped``: at rest, away from the goal. ``aborted``:
the controller reported a loss of rank, and the scenario stops there. ``failed``: the scene or the
controller could not go on. ``unfinished``: none of these: the robot still moves without approaching
the goal, or a goal was missed.
"""


@dataclass(frozen=True)
class Trajectory:
    """N samples of a simulation with m rows, M markers, n joints, k features and p robot points.

    The annotation of an array names its axes, or their sizes: with them the stored run is checked
    when it is read, and no other list has to name a field.
    """

    status: Outcome
    reason: str  #: Reason, unless ``converged``, and the rows that were violated at the start.
    t: Annotated[Array, "N"]  #: [s].
    q: Annotated[Array, "N n"]  #: [rad or m].
    qd: Annotated[Array, "N n"]  #: [rad/s or m/s].
    qdd_command: Annotated[Array, "N n"]  #: [rad/s² or m/s²].
    error: Annotated[Array, "N k"]  #: Feature error according to the controller.
    #: Distance [m] and angle [rad] of the camera from the goal's pose; NaN if it has none.
    camera_error: Annotated[Array, "N 2"]
    #: Largest distance of a marker from its goal [px]; the largest error of the feature times the
    #: focal length, if the feature decides whether the goal is reached.
    feature_error_px: Annotated[Array, "N"]
    #: In the target's frame [m]; this is the base frame if the target stands still.
    camera_position: Annotated[Array, "N 3"]
    features_px: Annotated[Array, "N M 2"]  #: Markers from the image's centre [px].
    points: Annotated[Array, "N p 3"]  #: Robot points in the base frame [m].
    labels: Annotated[tuple[str, ...], "m"]  #: Row labels.
    #: True value, even if the controller's differs; so are σ and clearance.
    phi: Annotated[Array, "N m"]
    sigma: Annotated[Array, "N m"]  #: Constraint functions.
    clearance: Annotated[Array, "N m"]  #: In the natural unit of each constraint.
    #: Rows that hold the arm back, see :func:`vsconstraints.compiled.samples.mark_acting`; not all
    #: rows with φ ≥ 0, which are those of :meth:`active_intervals`.
    active: Annotated[BoolArray, "N m"]
    saturated: Annotated[BoolArray, "N"]  #: True if the command is at a limit of the actuators.
    #: Share of the available accelerations that holding φ at zero takes when φ first reaches zero;
    #: above 1 it is impossible for any law. NaN if φ does not reach zero, and without limits.
    share_to_hold: Annotated[Array, "m"]
    #: Smallest clearance within the period after each sample; infinite if not inspected.
    between_clearance: Annotated[Array, "N m"]
    rows_time: Annotated[Array, "N"]  #: Wall time of rows and task [s].
    #: Wall time of the controller's call [s]: see :func:`vsconstraints.simulation.simulate`.
    step_time: Annotated[Array, "N"]
    fallbacks: int  #: Number of samples in which another solver than the selected one answered.
    compiled: bool = False  #: True if rows, task and law all ran compiled.

    @in_one_line
    def __repr__(self) -> str:
        lasts = f"{amount(self.t[-1])} s, " if len(self.t) else ""
        size = f"{counted(len(self.t), 'sample')}, {counted(len(self.labels), 'row')}"
        return f"<Trajectory {self.status}: {lasts}{size}>"

    def active_intervals(self, label: str, gap: float = 0.6) -> list[tuple[float, float]]:
        """Return the intervals in which φ of a row was at or above zero [s].

        Each interval is given by its first and last sample; intervals closer than ``gap`` are
        merged. The row need not hold the arm back in them, as :attr:`active` says: tracking may
        lead away from it.
        """
        return intervals(self.t, self.phi[:, self.labels.index(label)] >= 0.0, gap)


@dataclass(frozen=True)
class RunScores:
    """Scores of a run with m rows and n joints, from its samples alone.

    Undefined scores are NaN.
    """

    status: Outcome
    reason: str  #: As in :class:`Trajectory`.
    compiled: bool  #: True if rows, task and law all ran compiled.
    labels: tuple[str, ...]  #: m row labels.
    duration_s: float  #: Time of the last sample.
    #: (g,) time from the beginning of each goal until it is reached for good, before the next goal
    #: begins or the run ends.
    settling_times_s: Array
    final_translation_error_m: float  #: Error of the camera's pose at the end, as is the next one.
    final_rotation_error_rad: float
    #: Error at the end of the marker that is farthest from its goal.
    final_feature_error_px: float
    #: Σ‖Δq̈_c‖ per second of the setup's duration, as are the next two.
    acceleration_variation: float
    jerk_rms: float  #: Root mean square of ‖Δq̈_c‖ / T_s.
    switching_rate_hz: float  #: Changes of the set of acting rows per second.
    acceleration_max: Array  #: (n,) largest absolute value of q̈_c for each joint.
    phi_max: Array  #: (m,) largest φ of each row.
    #: (m,) largest σ of each row in any sample; above zero the row is violated. Not the metric
    #: ``violation_depth``, which is a depth in clearance, between samples too.
    sigma_max: Array
    outside_time_s: Array  #: (m,) total of the sampling periods that begin with σ > 0.
    active_time_s: Array  #: (m,) time during which each row constrained the arm.
    first_active_s: Array  #: (m,) time at which each row acted first; NaN if never.
    last_active_s: Array  #: (m,) time at which each row acted last; NaN if never.
    longest_positive_run_s: Array  #: (m,) longest time with φ ≥ 0.
    saturated_time_s: float  #: Time during which the command was at a limit of the actuators.
    share_to_hold: Array  #: (m,) see :class:`Trajectory`.

    @property
    def settling_time_s(self) -> float:
        """Sum of the settling times; NaN unless the run converged."""
        return float(np.nansum(self.settling_times_s)) if self.status == "converged" else np.nan

    @in_one_line
    def __repr__(self) -> str:
        outside = counted(int((self.outside_time_s > 0.0).sum()), "row")
        return (
            f"<RunScores {self.status}: {amount(self.duration_s)} s, {outside} of "
            f"{len(self.labels)} outside>"
        )


def intervals(t: Array, flags: BoolArray, gap: float) -> list[tuple[float, float]]:
    """Return the first and last time of each run of flags.

    Runs closer than ``gap`` [s] are merged.
    """
    times = t[flags]
    if not len(times):
        return []
    breaks = np.flatnonzero(np.diff(times) > gap)
    firsts = np.concatenate(([0], breaks + 1))
    lasts = np.concatenate((breaks, [len(times) - 1]))
    begins = times[firsts].tolist()
    ends = times[lasts].tolist()
    return list(zip(begins, ends, strict=True))
