"""A run and what metrics are computed from: clearances, usage, φ and commands, each worked out once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, cast

import numpy as np

from ...formulas.tracking import goals_at
from ...rows import Array, BoolArray
from ...simulation.outcome import settling_times
from ..record import RunRecord
from ..runs.spec import ROUNDING

NEGLIGIBLE = 1e-4
"""Depth, as a fraction of the characteristic length, up to which a row is not violated: the strict standard.

A law that keeps a row on its boundary is off by some 1e-5. What T_s u⁺ (43) explains is violated all the same.
"""

TOLERANT = 1e-2  #: the same of the tolerant standard, which is about what cameras and arms resolve

#: Where reports show how success grows with the depth that is tolerated.
TOLERANCES = (NEGLIGIBLE, 1e-3, TOLERANT, 2e-2, 5e-2, 1e-1)

SLIDING_GAP = 10  #: in a sliding mode φ crosses zero again and again: within this many samples, from either side
AT_BOUNDARY = 3  #: samples with φ ≥ 0 from which on a row is at its boundary; fewer only touch it
#: While φ is no farther below zero than so many switching steps T_s u⁺, a row that acts before and after holds on.
STEPS = 2.0


@dataclass
class Measured:
    """The argument of a metric's function: a run of N samples and m rows, with the baseline of the same trial.

    ``run`` is what the simulation left, ``Ts`` the sampling time [s]. (m,) ``least`` clearances are of the whole run,
    between samples too; ``violated`` are depths by the strict standard, 0 if not, ``within_band`` those that were never
    deeper than the sampling band, ``fraction`` the greatest depths, however slight, over the characteristic lengths.
    (N, m) ``outside`` says in which periods a row is as deep outside as violated ones are, (T, m) ``outside_alone`` the
    same of the baseline; (N, m) ``usage`` is 1 − c/L, from 0 to 1, of clearances c. From sample to sample within the
    scenario's duration: ``switches``, whether the active set changes, and ``command_changes`` ‖Δq̈_c‖. ``step_times``
    and ``rows_times`` are of the controller's calls, and of rows and task, but the first [µs].
    """

    record: RunRecord
    baseline: RunRecord | None = None

    def __post_init__(self) -> None:
        record, run = self.record, self.record.trajectory
        self.run, self.Ts = run, record.Ts
        in_period, nothing = _in_period(record), np.zeros((0, len(run.labels)), dtype=np.bool_)
        self.least = in_period.min(axis=0) if len(run.t) else np.full(len(run.labels), np.nan)
        self.violated = np.where(self.least < -NEGLIGIBLE * record.length, -self.least, 0.0)
        self.within_band = np.where(self.violated > record.sampling_band, 0.0, self.violated)
        self.fraction = np.fmax(-self.least / record.length, 0.0)
        self.outside = in_period < -NEGLIGIBLE * record.length
        alone = self.baseline
        if alone is not None and alone.trajectory.labels != run.labels:
            alone = None
        self.outside_alone = nothing if alone is None else _outside_at(alone, record.Ts)
        self.usage = np.clip(np.nan_to_num(1.0 - run.clearance / record.length), 0.0, 1.0)
        active, command = run.active[: record.common], run.qdd_command[: record.common]
        self.switches = (active[1:] != active[:-1]).any(axis=1)
        self.command_changes: Array = np.sqrt((np.diff(command, axis=0) ** 2).sum(axis=1))
        self.step_times, self.rows_times = run.step_time[1:] * 1e6, run.rows_time[1:] * 1e6

    def named(self, depth: Array) -> str:
        """Labels of the rows with a depth (m,), separated by semicolons."""
        return "; ".join(self.run.labels[i] for i in np.flatnonzero(depth > 0.0))

    @cached_property
    def usage_at_speed(self) -> Array:
        """(N, m) 1 − (c + K ċ)/L, from 0 to 1: 1 where the arm may come no faster, by φ = σ + K σ̇ = 0."""
        c = self.run.clearance
        if len(c) < 2:
            return np.zeros(c.shape)
        with np.errstate(invalid="ignore"):
            left = c + self.record.approach_time * np.gradient(c, self.Ts, axis=0)
            usage = np.clip(1.0 - left / self.record.length, 0.0, 1.0)
        return np.nan_to_num(usage)  # where no boundary is in sight, nothing is used

    @cached_property
    def held(self) -> BoolArray:
        """(N, m) when each row holds the arm back: it acts or, in a sliding mode, acts before and after."""
        held, steps = self.run.active.copy(), self.Ts * self.record.switching_gain
        for i in np.flatnonzero(held.any(axis=0)):
            at = np.flatnonzero(self.run.active[:, i])
            for begin, end in ((at[k], at[k + 1]) for k in np.flatnonzero(np.diff(at) > 1)):
                if self.run.phi[begin:end, i].min() >= -STEPS * steps[i]:
                    held[begin:end, i] = True
        return held

    def utilization(self) -> float:
        """Mean usage where the baseline is outside, while both runs last; NaN if not converged, or it never is."""
        common = min(len(self.usage), len(self.outside_alone))
        when = self.outside_alone[:common]
        if self.run.status != "converged" or not when.any():
            return float("nan")
        return float(self.usage[:common][when].mean())

    @cached_property
    def band(self) -> tuple[float, float]:
        """Band of φ and its bound T_s u⁺, of the row in which the one is largest relative to the other; NaN if none."""
        bounds = self.Ts * self.record.switching_gain
        bands = np.array([_band(phi, bound) for phi, bound in zip(self.run.phi.T, bounds, strict=True)])
        if len(self.run.t) < 2 or not np.isfinite(bands).any():
            return np.nan, np.nan
        worst = np.nanargmax(bands / bounds)
        return float(bands[worst]), float(bounds[worst])

    def sliding_lost(self) -> float:
        """Time for which some row's φ stays at or above zero for longer than a sliding mode does, beyond T_s u⁺ [s]."""
        lost = np.zeros(len(self.run.t), dtype=np.bool_)
        for phi, bound in zip(self.run.phi.T, self.Ts * self.record.switching_gain, strict=True):
            for begin, end in _intervals(phi >= 0.0):
                if end - begin > SLIDING_GAP and phi[begin:end].max() > bound:
                    lost[begin:end] = True
        return float(lost.sum() * self.Ts) if len(lost) > 1 else np.nan

    def longest_positive_runs(self) -> Array:
        """(m,) longest time with φ ≥ 0 of each row [s]."""
        return np.array([longest_run(phi >= 0.0) * self.Ts for phi in self.run.phi.T])

    def per_second(self, changes: Array | BoolArray) -> float:
        """Sum of changes from sample to sample per second; NaN for a run of one sample."""
        return float(changes.sum() / (len(changes) * self.Ts)) if len(changes) else np.nan

    def settling_time(self) -> float:
        """From the beginning of each goal until it is reached for good [s], added up; NaN if it did not converge."""
        if self.run.status != "converged":
            return float("nan")
        begins, t = self.record.goal_begins, self.run.t
        goals = goals_at(begins, t)
        unsettled = [np.flatnonzero((goals == goal) & ~self.record.settled) for goal in range(len(begins))]
        unreached = np.array([samples[-1] if len(samples) else -1 for samples in unsettled])
        return float(np.nansum(settling_times(unreached, begins, len(t), self.Ts)))

    def missed_periods(self) -> float:
        """Samples but the first that took longer than a period, NaN without; on an arm, what its loop missed."""
        if self.record.missed is not None:
            return self.record.missed
        both = self.step_times + self.rows_times
        return int((both > 1e6 * self.Ts).sum()) if len(both) else np.nan


def _in_period(record: RunRecord) -> Array:
    """(N, m) least clearance of each sampling period, at its beginning and inside."""
    return cast(Array, np.minimum(record.trajectory.clearance, record.trajectory.between_clearance))


def _outside_at(record: RunRecord, Ts: float) -> BoolArray:
    """(T, m) whether each row is as deep outside as violated ones, in any part of periods of sampling time Ts [s]."""
    outside = _in_period(record) < -NEGLIGIBLE * record.length
    begins = np.arange(0.0, len(outside) - ROUNDING, Ts / record.Ts) + ROUNDING
    return np.logical_or.reduceat(outside, begins.astype(np.int64)) if len(outside) else outside


def mean_while(values: Array, when: BoolArray) -> Array:
    """(m,) mean of values (N, m) over the samples in which a flag (T, m) is set, of those that both have; else NaN."""
    common = min(len(values), len(when))
    count = when[:common].sum(axis=0)
    total = np.where(when[:common], values[:common], 0.0).sum(axis=0)
    return cast(Array, np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0))


def first_active(t: Array, active: BoolArray) -> Array:
    """(m,) when each row acts (N, m) for the first time [s]; NaN where it never does."""
    return np.where(active.any(axis=0), t[active.argmax(axis=0)], np.nan)


def over(values: Array, how: Callable[[Array], Any]) -> float:
    """A number of values (n,); NaN of none."""
    return float(how(values)) if len(values) else np.nan


def longest_run(flags: BoolArray) -> int:
    """Most flags (N,) in a row."""
    return max((end - begin for begin, end in _intervals(flags)), default=0)


def _intervals(flags: BoolArray) -> list[tuple[int, int]]:
    """Begin and end of each stretch of flags (N,)."""
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _band(phi: Array, bound: float) -> float:
    """Greatest extent of φ (N,) and zero while the row is at its boundary; NaN if it never is."""
    at = np.flatnonzero(phi >= 0.0)
    bands = []
    for interval in np.split(at, np.flatnonzero(np.diff(at) > SLIDING_GAP) + 1) if len(at) else ():
        span = phi[interval[0] : interval[-1] + 1]
        if len(interval) >= AT_BOUNDARY or span.max() > bound:
            bands.append(float(span.max() - min(span.min(), 0.0)))
    return max(bands, default=float("nan"))


@dataclass(frozen=True)
class Metric:
    """A column of results.csv or constraints.csv, and of the tables of reports.

    ``value`` is that of a run or, in constraints.csv, of each of its rows; None for the ratio ``column / over``.
    ``better`` is None for a fact or noise. A ``kind`` of ``time`` is a number that differs from run to run on the same
    machine. Columns stand in the order in which they were ``added``: a new one has a greater number than all others.

    In reports, ``header`` (with unit; empty: not shown) heads it in the table ``group`` of a scenario, ``overall`` in
    the tables over all scenarios, where runs are ``condensed``: to the median of those that converged, of a time of
    all, or to the worst. ``factor`` and ``style`` make the shown number: three digits; not less than a thousandth; two
    decimals; whole. ``finding`` is the sentence that names the best law, and the unit. ``judged`` says whose values are
    compared, of the runs that converged: ``any``, those ``inside`` that violated no row, or of these the ones
    ``sliding`` that never lost a sliding mode.
    """

    column: str
    value: Callable[[Measured], Any] | None
    header: str = ""
    better: Literal["less", "more"] | None = "less"
    definition: str = ""
    kind: Literal["number", "time", "text", "flag"] = "number"
    group: Literal["outcome", "task", "chattering", "time"] = "chattering"
    judged: Literal["any", "inside", "sliding"] = "inside"
    factor: float = 1.0
    style: Literal["number", "error", "percent", "count"] = "number"
    over: str = ""
    overall: str = ""
    condensed: Literal["median", "worst"] = "median"
    finding: tuple[str, str] = ("", "")
    added: int = 0
