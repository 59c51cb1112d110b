"""Quantities of a run that metrics are computed from; each is computed once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from ..formulas.tracking import goals_at
from ..rows import Array, BoolArray
from ..simulation import Trajectory
from ..simulation.outcome import settling_times
from .record import RunRecord
from .runs.spec import ROUNDING

NEGLIGIBLE = 1e-4
"""Depth up to which a row is not violated under the strict standard [fraction of L].

L is the characteristic length. A law that keeps a row on its boundary deviates from it by about
1e-5. Depths that the sampling band T_s u⁺ (43) explains count as violations too.
"""

#: The same depth under the tolerant standard: about the resolution of cameras and arms.
TOLERANT = 1e-2

#: Tolerated depths for which reports show the success rate [fraction of L].
TOLERANCES = (NEGLIGIBLE, 1e-3, TOLERANT, 2e-2, 5e-2, 1e-1)

#: Maximum number of samples between two zero crossings of φ in a sliding mode, from either side.
SLIDING_GAP = 10
AT_BOUNDARY = 3  #: Samples with φ ≥ 0 that put a row at its boundary; fewer only touch it.
#: A row between two active times still restrains the arm while φ is at most this many switching
#: steps T_s u⁺ below zero.
STEPS = 2.0


class Band(NamedTuple):
    """Extent of φ while a row is at its boundary, and its bound T_s u⁺."""

    width: float
    bound: float


@dataclass
class MetricInputs:
    """Argument of a metric's function: a run of N samples and m rows, and its baseline.

    The baseline is of the same scenario and trial. The depth of a violated row is measured in the
    natural unit of the row, such as pixels or radians (``natural_depth``), or as a fraction of its
    characteristic length L (``relative_depth``). Both are 0 for rows that are not violated under
    the strict standard.
    """

    record: RunRecord
    baseline: RunRecord | None = None

    @property
    def run(self) -> Trajectory:
        """Trajectory of the simulation."""
        return self.record.trajectory

    @property
    def Ts(self) -> float:  # noqa: N802 - as in the scenario and the paper
        """Sampling time [s]."""
        return self.record.Ts

    # --- clearances and depths ---

    @cached_property
    def _in_period(self) -> Array:
        """(N, m) least clearance of each sampling period, at its start and inside it."""
        return _least_in_period(self.record)

    @cached_property
    def least(self) -> Array:
        """(m,) least clearance of the run [natural], between samples included; NaN without any."""
        if not len(self.run.t):
            return np.full(len(self.run.labels), np.nan)
        return cast(Array, self._in_period.min(axis=0))

    @cached_property
    def _is_unknown(self) -> BoolArray:
        """(m,) True if the clearance of a row is unknown in at least one period.

        Such a row is not known to be satisfied: its depths are NaN.
        """
        return cast(BoolArray, np.isnan(self._in_period).any(axis=0))

    @cached_property
    def _depth_if_known(self) -> Array:
        """(m,) depth of violated rows [natural]; 0 for all others, unknown ones included."""
        is_violated = self.least < -NEGLIGIBLE * self.record.length
        return np.where(is_violated, -self.least, 0.0)

    @cached_property
    def natural_depth(self) -> Array:
        """(m,) greatest depth of violated rows in their units; 0 for others, NaN if unknown."""
        return np.where(self._is_unknown, np.nan, self._depth_if_known)

    @cached_property
    def natural_depth_within_band(self) -> Array:
        """(m,) the same depth, 0 if it exceeds the sampling band."""
        return np.where(self._depth_if_known > self.record.sampling_band, 0.0, self._depth_if_known)

    @cached_property
    def relative_depth(self) -> Array:
        """(m,) the natural depth as a fraction of L; 0 for rows not violated, NaN if unknown."""
        return self.natural_depth / self.record.length

    @cached_property
    def relative_depth_without_threshold(self) -> Array:
        """(m,) greatest depth of all rows, however small [fraction of L]; NaN if unknown."""
        depth = np.fmax(-self.least / self.record.length, 0.0)
        return np.where(self._is_unknown, np.nan, depth)

    def deepest_violation(self) -> float:
        """Return the greatest depth of a violated row [fraction of L]; 0 if none is violated."""
        return float(self.relative_depth.max(initial=0.0))

    def name_rows(self, depth: Array) -> str:
        """Return the labels of the rows with a positive or unknown depth (m,), with semicolons."""
        is_named = (depth > 0.0) | np.isnan(depth)
        return "; ".join(self.run.labels[row] for row in np.flatnonzero(is_named))

    @cached_property
    def outside(self) -> BoolArray:
        """(N, m) True in periods in which a row is violated under the strict standard."""
        return violated_in_periods(self.record)

    @cached_property
    def outside_alone(self) -> BoolArray:
        """(T, m) the same for the baseline; T = 0 without a baseline that has the same rows."""
        alone = self.baseline
        labels = self.run.labels
        if alone is None or alone.trajectory.labels != labels:
            return np.zeros((0, len(labels)), dtype=np.bool_)
        return _violated_in_other_periods(alone, self.Ts)

    # --- use of the allowed space ---

    @cached_property
    def usage(self) -> Array:
        """(N, m) 1 − c/L of clearances c, from 0 to 1."""
        usage = 1.0 - self.run.clearance / self.record.length
        # without a boundary in range the usage is 0
        return np.clip(np.nan_to_num(usage), 0.0, 1.0)

    @cached_property
    def usage_at_speed(self) -> Array:
        """(N, m) 1 − (c + K ċ)/L, from 0 to 1.

        It is 1 at the highest approach speed that φ = σ + K σ̇ = 0 permits.
        """
        clearance = self.run.clearance
        if len(clearance) < 2:
            return np.zeros(clearance.shape)
        with np.errstate(invalid="ignore"):
            rate = np.gradient(clearance, self.Ts, axis=0)
            left = clearance + self.record.approach_time * rate
            usage = np.clip(1.0 - left / self.record.length, 0.0, 1.0)
        return np.nan_to_num(usage)  # as above

    def utilization(self) -> float:
        """Return the mean usage while the baseline violates a row and both runs last.

        NaN if the run did not converge or the baseline never violates a row.
        """
        common = min(len(self.usage), len(self.outside_alone))
        is_challenged = self.outside_alone[:common]
        if self.run.status != "converged" or not is_challenged.any():
            return float("nan")
        return float(self.usage[:common][is_challenged].mean())

    # --- sliding mode ---

    @cached_property
    def switching_step(self) -> Array:
        """(m,) T_s u⁺ of each row: the bound (43) on one switching step of φ."""
        return self.Ts * self.record.switching_gain

    @cached_property
    def held(self) -> BoolArray:
        """(N, m) True while a row restrains the arm.

        This is the case while the row is active and, in a sliding mode, between two activations.
        """
        active = self.run.active
        held = active.copy()
        lowest = -STEPS * self.switching_step
        for row in np.flatnonzero(held.any(axis=0)):
            phi = self.run.phi[:, row]
            samples = np.flatnonzero(active[:, row])
            gaps = np.flatnonzero(np.diff(samples) > 1)
            for begin, end in zip(samples[gaps], samples[gaps + 1], strict=True):
                if phi[begin:end].min() >= lowest[row]:
                    held[begin:end, row] = True
        return held

    @cached_property
    def band(self) -> Band:
        """Band of φ and its bound T_s u⁺, for the row with the largest ratio; NaN if none."""
        bounds = self.switching_step
        each = zip(self.run.phi.T, bounds, strict=True)
        widths = np.array([_band(phi, bound) for phi, bound in each])
        if len(self.run.t) < 2 or not np.isfinite(widths).any():
            return Band(np.nan, np.nan)
        widest = np.nanargmax(widths / bounds)
        return Band(float(widths[widest]), float(bounds[widest]))

    def sliding_lost(self) -> float:
        """Return the time during which sliding is lost on some row [s].

        Sliding is lost if φ stays at or above zero for longer than in a sliding mode, and exceeds
        T_s u⁺.
        """
        if len(self.run.t) < 2:
            return np.nan
        lost = np.zeros(len(self.run.t), dtype=np.bool_)
        for phi, bound in zip(self.run.phi.T, self.switching_step, strict=True):
            for begin, end in _intervals(phi >= 0.0):
                if end - begin > SLIDING_GAP and phi[begin:end].max() > bound:
                    lost[begin:end] = True
        return float(lost.sum() * self.Ts)

    def longest_positive_runs(self) -> Array:
        """(m,) longest time with φ ≥ 0 of each row [s]."""
        is_positive = self.run.phi.T >= 0.0
        samples = np.array([longest_run(of_row) for of_row in is_positive])
        return samples * self.Ts

    # --- commands ---

    @cached_property
    def switches(self) -> BoolArray:
        """True if the active set changes from one sample of the scenario's duration to the next."""
        active = self.run.active[: self.record.common]
        is_changed = active[1:] != active[:-1]
        return cast(BoolArray, is_changed.any(axis=1))

    @cached_property
    def command_changes(self) -> Array:
        """‖Δq̈_c‖ from one sample of the scenario's duration to the next."""
        command = self.run.qdd_command[: self.record.common]
        change = np.diff(command, axis=0)
        return cast(Array, np.sqrt((change**2).sum(axis=1)))

    def per_second(self, changes: Array | BoolArray) -> float:
        """Return the sum of changes between samples per second; NaN for a run of one sample."""
        if not len(changes):
            return np.nan
        return float(changes.sum() / (len(changes) * self.Ts))

    def jerk(self) -> float:
        """Return the root mean square of ‖Δq̈_c‖ / T_s; NaN for a run of one sample."""
        if not len(self.command_changes):
            return np.nan
        return float(np.sqrt((self.command_changes**2).mean()) / self.Ts)

    def largest_acceleration(self) -> float:
        """Return the largest commanded acceleration of any joint in any sample; NaN if none."""
        return reduced(np.abs(self.run.qdd_command).ravel(), np.fmax.reduce)

    # --- times ---

    @cached_property
    def step_times(self) -> Array:
        """Times of the controller's calls [µs], without the first."""
        return self.run.step_time[1:] * 1e6

    @cached_property
    def rows_times(self) -> Array:
        """Times of rows and task [µs], without the first."""
        return self.run.rows_time[1:] * 1e6

    def missed_periods(self) -> float:
        """Count the samples, except the first, that took longer than a period; NaN without times.

        On an arm, this is the number of periods that the control loop missed.
        """
        if self.record.missed is not None:
            return self.record.missed
        together = self.step_times + self.rows_times
        if not np.isfinite(together).any():
            return np.nan
        return int((together > 1e6 * self.Ts).sum())

    def settling_time(self) -> float:
        """Return the time from the start of each goal until it is finally reached [s], summed.

        NaN if the run did not converge.
        """
        record = self.record
        if self.run.status != "converged":
            return float("nan")
        goal_at_sample = goals_at(record.goal_begins, self.run.t)
        unreached = []
        for goal in range(len(record.goal_begins)):
            is_due = goal_at_sample == goal
            unreached.append(_last(is_due & ~record.settled))
        times = settling_times(np.array(unreached), record.goal_begins, len(self.run.t), self.Ts)
        return float(np.nansum(times))


def _least_in_period(record: RunRecord) -> Array:
    """Return the least clearance of each sampling period (N, m), at its start and inside it."""
    return cast(Array, np.minimum(record.trajectory.clearance, record.trajectory.between_clearance))


def violated_in_periods(record: RunRecord) -> BoolArray:
    """Flag the periods in which each row is violated under the strict standard (N, m)."""
    return _least_in_period(record) < -NEGLIGIBLE * record.length


def _violated_in_other_periods(record: RunRecord, Ts: float) -> BoolArray:
    """Flag the periods in which each row is violated under the strict standard (T, m).

    The periods have the sampling time Ts [s]; any part of a period counts.
    """
    outside = violated_in_periods(record)
    if not len(outside):
        return outside
    begins = np.arange(0.0, len(outside) - ROUNDING, Ts / record.Ts) + ROUNDING
    return np.logical_or.reduceat(outside, begins.astype(np.int64))


def mean_while(values: Array, flags: BoolArray) -> Array:
    """Return the mean (m,) of values (N, m) over the samples in which a flag (T, m) is set.

    Only samples that both arrays have are used. NaN if no flag is set.
    """
    common = min(len(values), len(flags))
    is_counted = flags[:common]
    count = is_counted.sum(axis=0)
    total = np.where(is_counted, values[:common], 0.0).sum(axis=0)
    mean = np.full(len(count), np.nan)
    return cast(Array, np.divide(total, count, out=mean, where=count > 0))


def first_active(t: Array, active: BoolArray) -> Array:
    """Return the time (m,) at which each row is first active (N, m) [s]; NaN if it never is."""
    first = active.argmax(axis=0)
    return np.where(active.any(axis=0), t[first], np.nan)


def reduced(values: Array, function: Callable[[Array], Any]) -> float:
    """Reduce values (n,) to one number by a function such as ``np.median``; NaN without values."""
    return float(function(values)) if len(values) else np.nan


def longest_run(flags: BoolArray) -> int:
    """Return the length of the longest sequence of set flags (N,)."""
    return max((end - begin for begin, end in _intervals(flags)), default=0)


def _last(flags: BoolArray) -> int:
    """Return the index of the last set flag (N,); -1 if none is set."""
    samples = np.flatnonzero(flags)
    return int(samples[-1]) if len(samples) else -1


def _intervals(flags: BoolArray) -> list[tuple[int, int]]:
    """Return the start and end of each sequence of set flags (N,)."""
    changes = np.diff(flags.astype(np.int8), prepend=0, append=0)
    edges = np.flatnonzero(changes)
    begins = edges[::2].tolist()
    ends = edges[1::2].tolist()
    return list(zip(begins, ends, strict=True))


def _band(phi: Array, bound: float) -> float:
    """Return the greatest extent of φ (N,) and zero while the row is at its boundary.

    NaN if the row is never at its boundary.
    """
    reached = np.flatnonzero(phi >= 0.0)
    if not len(reached):
        return float("nan")
    breaks = np.flatnonzero(np.diff(reached) > SLIDING_GAP) + 1
    bands = []
    for samples in np.split(reached, breaks):
        span = phi[samples[0] : samples[-1] + 1]
        if len(samples) >= AT_BOUNDARY or span.max() > bound:
            bands.append(float(span.max() - min(span.min(), 0.0)))
    return max(bands, default=float("nan"))
