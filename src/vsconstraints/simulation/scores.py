"""Scores of a run that leaves nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..compiled.samples import Loop
from ..rows import Array
from ..rows.readable import amount, counted, in_one_line
from .outcome import settling_times
from .setup import Setup
from .trajectory import Outcome


@dataclass(frozen=True)
class RunScores:
    """Scores of a run with m rows and n joints, in samples alone; NaN for what there is not.

    Attributes
    ----------
    status, reason
        As of a :class:`vsconstraints.simulation.Trajectory`.
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
        (m,) see :class:`vsconstraints.simulation.Trajectory`.
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

    @classmethod
    def of(cls, setup: Setup, loop: Loop, samples: int, outcome: tuple[Outcome, str], compiled: bool) -> RunScores:
        """The scores of a loop that has run so many samples."""
        Ts, kept, scores = setup.Ts, loop.kept, loop.scores
        status, reason = outcome
        duration = (samples - 1) * Ts if samples else np.nan
        last = (samples - 1) % len(kept.camera_error)
        errors = (*kept.camera_error[last], kept.feature_error[last]) if samples else (np.nan,) * 3
        steps = min(samples, setup.samples) - 1 if samples > 1 else np.nan
        return cls(
            status=status,
            reason=reason,
            compiled=compiled,
            labels=setup.constraints.labels,
            duration_s=duration,
            settling_times_s=settling_times(scores.unreached, loop.goals.begins, samples, Ts),
            final_translation_error_m=float(errors[0]),
            final_rotation_error_rad=float(errors[1]),
            final_feature_error_px=float(errors[2]),
            acceleration_variation=float(scores.variation[0] / (steps * Ts)),
            jerk_rms=float(np.sqrt(scores.squared_variation[0] / steps) / Ts),
            switching_rate_hz=float(scores.switches[0] / (steps * Ts)),
            acceleration_max=scores.acceleration_max,
            phi_max=scores.phi_max,
            sigma_max=scores.sigma_max,
            outside_time_s=scores.outside * Ts,
            active_time_s=scores.acted * Ts,
            first_active_s=np.where(scores.first_active < 0, np.nan, scores.first_active * Ts),
            last_active_s=np.where(scores.last_active < 0, np.nan, scores.last_active * Ts),
            longest_positive_run_s=scores.longest_positive * Ts,
            saturated_time_s=float(scores.saturated[0] * Ts),
            share_to_hold=scores.share_to_hold,
        )
