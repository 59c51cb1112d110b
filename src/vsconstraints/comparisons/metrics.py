"""Scores of a run: the quantities that metrics are computed from, and the table of all metrics.

Each quantity is computed once. Reports print :data:`DEFINITIONS`.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from ..formulas.tracking import goals_at
from ..rows import Array, BoolArray
from ..rows.readable import in_one_line
from ..simulation import PATIENCE
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


@dataclass
class MetricInputs:
    """Argument of a metric's function: a run of N samples and m rows, and its baseline.

    The baseline is of the same scenario and trial.

    - ``run``: the trajectory of the simulation; ``Ts``: the sampling time [s].
    - ``least`` (m,): minimum clearances over the whole run, between samples included.
    - ``violated`` (m,): violation depths under the strict standard, 0 if not violated.
    - ``within_band`` (m,): the same, 0 for depths beyond the sampling band.
    - ``fraction`` (m,): greatest depths, however small, over the characteristic lengths.
    - ``outside`` (N, m): True in periods in which a row is violated under the strict standard.
    - ``outside_alone`` (T, m): the same for the baseline.
    - ``usage`` (N, m): 1 − c/L of clearances c, from 0 to 1.
    - ``switches``: True if the active set changes from one sample to the next.
    - ``command_changes``: ‖Δq̈_c‖ from one sample to the next.
    - ``step_times``, ``rows_times``: times of the controller's calls, and of rows and task [µs],
      without the first.

    ``switches`` and ``command_changes`` end with the scenario's duration.
    """

    record: RunRecord
    baseline: RunRecord | None = None

    def __post_init__(self) -> None:
        record = self.record
        run = self.record.trajectory
        self.run = run
        self.Ts = record.Ts
        in_period = _in_period(record)
        nothing = np.zeros((0, len(run.labels)), dtype=np.bool_)
        self.least = in_period.min(axis=0) if len(run.t) else np.full(len(run.labels), np.nan)
        self.violated = np.where(self.least < -NEGLIGIBLE * record.length, -self.least, 0.0)
        self.within_band = np.where(self.violated > record.sampling_band, 0.0, self.violated)
        self.fraction = np.fmax(-self.least / record.length, 0.0)
        # a row whose clearance is not known is not known to be satisfied
        unknown = np.isnan(in_period).any(axis=0)
        self.violated[unknown] = np.nan
        self.fraction[unknown] = np.nan
        self.outside = in_period < -NEGLIGIBLE * record.length
        alone = self.baseline
        if alone is not None and alone.trajectory.labels != run.labels:
            alone = None
        self.outside_alone = nothing if alone is None else _outside_at(alone, record.Ts)
        self.usage = np.clip(np.nan_to_num(1.0 - run.clearance / record.length), 0.0, 1.0)
        active = run.active[: record.common]
        command = run.qdd_command[: record.common]
        self.switches = (active[1:] != active[:-1]).any(axis=1)
        self.command_changes: Array = np.sqrt((np.diff(command, axis=0) ** 2).sum(axis=1))
        self.step_times = run.step_time[1:] * 1e6
        self.rows_times = run.rows_time[1:] * 1e6

    def named(self, depth: Array) -> str:
        """Return the labels of the rows with a positive or unknown depth (m,), with semicolons."""
        named = (depth > 0.0) | np.isnan(depth)
        return "; ".join(self.run.labels[i] for i in np.flatnonzero(named))

    @cached_property
    def usage_at_speed(self) -> Array:
        """(N, m) 1 − (c + K ċ)/L, from 0 to 1.

        It is 1 at the highest approach speed that φ = σ + K σ̇ = 0 permits.
        """
        c = self.run.clearance
        if len(c) < 2:
            return np.zeros(c.shape)
        with np.errstate(invalid="ignore"):
            left = c + self.record.approach_time * np.gradient(c, self.Ts, axis=0)
            usage = np.clip(1.0 - left / self.record.length, 0.0, 1.0)
        return np.nan_to_num(usage)  # without a boundary in range the usage is 0

    @cached_property
    def held(self) -> BoolArray:
        """(N, m) True while a row restrains the arm.

        This is the case while the row is active and, in a sliding mode, between two activations.
        """
        held = self.run.active.copy()
        steps = self.Ts * self.record.switching_gain
        for i in np.flatnonzero(held.any(axis=0)):
            at = np.flatnonzero(self.run.active[:, i])
            for begin, end in ((at[k], at[k + 1]) for k in np.flatnonzero(np.diff(at) > 1)):
                if self.run.phi[begin:end, i].min() >= -STEPS * steps[i]:
                    held[begin:end, i] = True
        return held

    def utilization(self) -> float:
        """Return the mean usage while the baseline violates a row and both runs last.

        NaN if the run did not converge or the baseline never violates a row.
        """
        common = min(len(self.usage), len(self.outside_alone))
        when = self.outside_alone[:common]
        if self.run.status != "converged" or not when.any():
            return float("nan")
        return float(self.usage[:common][when].mean())

    @cached_property
    def band(self) -> tuple[float, float]:
        """Band of φ and its bound T_s u⁺, for the row with the largest ratio; NaN if none."""
        bounds = self.Ts * self.record.switching_gain
        bands = np.array(
            [_band(phi, bound) for phi, bound in zip(self.run.phi.T, bounds, strict=True)]
        )
        if len(self.run.t) < 2 or not np.isfinite(bands).any():
            return np.nan, np.nan
        worst = np.nanargmax(bands / bounds)
        return float(bands[worst]), float(bounds[worst])

    def largest_acceleration(self) -> float:
        """Return the largest commanded acceleration of any joint in any sample; NaN if none."""
        return over(np.abs(self.run.qdd_command).ravel(), np.fmax.reduce)

    def sliding_lost(self) -> float:
        """Return the time during which sliding is lost on some row [s].

        Sliding is lost if φ stays at or above zero for longer than in a sliding mode, and exceeds
        T_s u⁺.
        """
        lost = np.zeros(len(self.run.t), dtype=np.bool_)
        for phi, bound in zip(self.run.phi.T, self.Ts * self.record.switching_gain, strict=True):
            for begin, end in _intervals(phi >= 0.0):
                if end - begin > SLIDING_GAP and phi[begin:end].max() > bound:
                    lost[begin:end] = True
        return float(lost.sum() * self.Ts) if len(lost) > 1 else np.nan

    def longest_positive_runs(self) -> Array:
        """(m,) Longest time with φ ≥ 0 of each row [s]."""
        return np.array([longest_run(phi >= 0.0) * self.Ts for phi in self.run.phi.T])

    def per_second(self, changes: Array | BoolArray) -> float:
        """Return the sum of changes between samples per second; NaN for a run of one sample."""
        return float(changes.sum() / (len(changes) * self.Ts)) if len(changes) else np.nan

    def settling_time(self) -> float:
        """Return the time from the start of each goal until it is finally reached [s], summed.

        NaN if the run did not converge.
        """
        if self.run.status != "converged":
            return float("nan")
        begins = self.record.goal_begins
        t = self.run.t
        goals = goals_at(begins, t)
        unsettled = [
            np.flatnonzero((goals == goal) & ~self.record.settled) for goal in range(len(begins))
        ]
        unreached = np.array([samples[-1] if len(samples) else -1 for samples in unsettled])
        return float(np.nansum(settling_times(unreached, begins, len(t), self.Ts)))

    def missed_periods(self) -> float:
        """Count the samples, except the first, that took longer than a period; NaN without times.

        On an arm, this is the number of periods that the control loop missed.
        """
        if self.record.missed is not None:
            return self.record.missed
        both = self.step_times + self.rows_times
        return int((both > 1e6 * self.Ts).sum()) if np.isfinite(both).any() else np.nan


Measured = MetricInputs  #: Former name, for custom metrics that use it.


def _in_period(record: RunRecord) -> Array:
    """Return the least clearance of each sampling period (N, m), at its start and inside it."""
    return cast(Array, np.minimum(record.trajectory.clearance, record.trajectory.between_clearance))


def _outside_at(record: RunRecord, Ts: float) -> BoolArray:
    """Flag the periods in which each row is violated under the strict standard (T, m).

    The periods have the sampling time Ts [s]; any part of a period counts.
    """
    outside = _in_period(record) < -NEGLIGIBLE * record.length
    begins = np.arange(0.0, len(outside) - ROUNDING, Ts / record.Ts) + ROUNDING
    return np.logical_or.reduceat(outside, begins.astype(np.int64)) if len(outside) else outside


def mean_while(values: Array, when: BoolArray) -> Array:
    """Return the mean (m,) of values (N, m) over the samples in which a flag (T, m) is set.

    Only samples that both arrays have are used. NaN if no flag is set.
    """
    common = min(len(values), len(when))
    count = when[:common].sum(axis=0)
    total = np.where(when[:common], values[:common], 0.0).sum(axis=0)
    return cast(Array, np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0))


def first_active(t: Array, active: BoolArray) -> Array:
    """Return the time (m,) at which each row is first active (N, m) [s]; NaN if it never is."""
    return np.where(active.any(axis=0), t[active.argmax(axis=0)], np.nan)


def over(values: Array, how: Callable[[Array], Any]) -> float:
    """Reduce values (n,) to one number; NaN if there are no values."""
    return float(how(values)) if len(values) else np.nan


def longest_run(flags: BoolArray) -> int:
    """Return the length of the longest sequence of set flags (N,)."""
    return max((end - begin for begin, end in _intervals(flags)), default=0)


def _intervals(flags: BoolArray) -> list[tuple[int, int]]:
    """Return the start and end of each sequence of set flags (N,)."""
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _band(phi: Array, bound: float) -> float:
    """Return the greatest extent of φ (N,) and zero while the row is at its boundary.

    NaN if the row is never at its boundary.
    """
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

    ``value`` computes the value of a run or, in constraints.csv, of each of its rows; None for the
    ratio ``column / over``. ``better`` is None for facts and noise. A ``kind`` of ``time`` is a
    number that differs between runs on the same machine. Columns are ordered by ``column_order``: a
    new column gets a greater number than all others. Stored tables without a column are read with
    it empty, unless it is ``required`` because an empty cell would be read as a result.

    In reports, ``header`` (with unit; hidden if empty) is the heading in the table ``group`` of a
    scenario, and ``overall`` in the tables over all scenarios. There, runs are ``condensed`` to the
    worst, or to the median of those that converged (for times: of all runs). ``factor`` and
    ``style`` format the number: three digits; at least a thousandth; two decimals; whole.
    ``finding`` is the sentence that names the best law, and the unit. ``judged`` selects the
    converged runs that are compared: ``any``; those ``inside``, which violated no row; or, of
    these, the ones ``sliding``, which never lost a sliding mode.
    """

    column: str
    value: Callable[[MetricInputs], Any] | None
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
    column_order: int = 0
    required: bool = False


_NUMBERS = {
    "PATIENCE": PATIENCE,
    "SLIDING_GAP": SLIDING_GAP,
    "NEGLIGIBLE": NEGLIGIBLE,
    "TOLERANT": TOLERANT,
}
_DEFINITIONS = tomllib.loads(Path(__file__).with_name("metrics.toml").read_text(encoding="utf-8"))


def _described(what: str, metrics: Sequence[Metric]) -> tuple[Metric, ...]:
    """Add the definitions of the file ``metrics.toml`` to metrics; ratios have none."""
    texts = {
        metric.column: _DEFINITIONS[what].get(metric.column, "").format(**_NUMBERS)
        for metric in metrics
    }
    return tuple(
        m if m.definition or m.over else replace(m, definition=texts[m.column]) for m in metrics
    )


#: Metrics of a run, in the order in which a scenario's tables show them.
METRICS = _described("run", (
    Metric("status", lambda m: m.run.status, kind="text", required=True),
    Metric("reason", lambda m: m.run.reason, kind="text"),
    Metric("duration_s", lambda m: m.run.t[-1], required=True),
    Metric("settling_time_s", MetricInputs.settling_time, "settling time [s]", group="task"),
    Metric("final_translation_error_m", lambda m: m.run.camera_error[-1, 0], "position error [mm]",
           group="task", factor=1e3, style="error"),
    Metric("final_rotation_error_rad", lambda m: m.run.camera_error[-1, 1],
           "orientation error [mrad]", group="task", factor=1e3, style="error"),
    Metric("final_feature_error_px", lambda m: m.run.feature_error_px[-1], "image error [px]",
           group="task", style="error"),
    Metric("utilization", MetricInputs.utilization, "utilization [%]", "more", group="outcome",
           style="percent", overall="median utilization [%]",
           finding=("Most of the allowed space used", "%")),
    Metric("violated", lambda m: m.named(m.violated), kind="text", required=True),
    Metric("violation_depth", lambda m: float((m.violated / m.record.length).max(initial=0.0)),
           "worst depth [% of L]", group="outcome", judged="any", factor=100.0,
           overall="worst depth [% of L]", condensed="worst"),
    Metric("violation_time_s", lambda m: float(m.outside.any(axis=1).sum() * m.Ts),
           "time outside [s]", group="outcome", judged="any"),
    Metric("phi_band", lambda m: m.band[0], "φ band", None),
    Metric("phi_band_bound", lambda m: m.band[1], "bound T_s u⁺", None),
    Metric("phi_band", None, "band / bound", judged="sliding", over="phi_band_bound",
           overall="worst φ band / bound", condensed="worst"),
    Metric("sliding_lost_s", MetricInputs.sliding_lost, "sliding lost [s]", judged="sliding",
           column_order=3),
    Metric("switching_rate_hz", lambda m: m.per_second(m.switches), "switching rate [Hz]",
           overall="switching rate [Hz]"),
    Metric("acceleration_variation", lambda m: m.per_second(m.command_changes),
           "acceleration variation [rad/s³]", overall="acceleration variation [rad/s³]",
           finding=("Least chattering (acceleration variation)", "rad/s³")),
    Metric("jerk_rms",
           lambda m: over(m.command_changes, lambda change: np.sqrt((change**2).mean()) / m.Ts),
           "RMS jerk [rad/s³]"),
    Metric("step_time_median_us", lambda m: over(m.step_times, np.median), "call, median [µs]",
           None, kind="time", group="time", overall="median call [µs]"),
    Metric("step_time_p99_us", lambda m: over(m.step_times, lambda each: np.quantile(each, 0.99)),
           "p99 [µs]", None, kind="time", group="time"),
    Metric("step_time_max_us", lambda m: over(m.step_times, np.max), "max [µs]", None, kind="time",
           group="time"),
    Metric("rows_time_median_us", lambda m: over(m.rows_times, np.median),
           "rows and task, median [µs]", None, kind="time", group="time"),
    Metric("missed_periods", MetricInputs.missed_periods, "missed periods", None, kind="time",
           group="time", style="count"),
    Metric("compiled", lambda m: m.run.compiled, kind="flag", column_order=1, required=True),
    Metric("within_band", lambda m: m.named(m.within_band), kind="text", column_order=2,
           required=True),
    Metric("held_time_s", lambda m: float(m.held.sum() * m.Ts), column_order=4),
    Metric("saturated_time_s", lambda m: float(m.run.saturated.sum() * m.Ts), column_order=5),
    Metric("violation_fraction", lambda m: float(m.fraction.max(initial=0.0)), column_order=6),
    Metric("violated_tolerant", kind="text", column_order=7, required=True,
           value=lambda m: m.named(m.fraction - TOLERANT)),
    Metric("acceleration_max", MetricInputs.largest_acceleration, column_order=8),
))  # fmt: skip
#: Metrics of each row of a run.
ROW_METRICS = _described("row", (
    Metric("constraint", lambda m: m.run.labels, kind="text", required=True),
    Metric("kind", lambda m: m.record.kinds, kind="text"),
    Metric("unit", lambda m: m.record.units, kind="text"),
    Metric("challenged", lambda m: m.outside_alone.any(axis=0).tolist(), kind="flag",
           required=True),
    Metric("active_time_s", lambda m: m.run.active.sum(axis=0) * m.Ts),
    Metric("first_active_s", lambda m: first_active(m.run.t, m.run.active)),
    Metric("last_active_s", lambda m: first_active(m.run.t[::-1], m.run.active[::-1])),
    Metric("clearance_min", lambda m: m.least),
    Metric("usage_max", lambda m: 1.0 - m.least / m.record.length),
    Metric("mean_unused_margin",
           lambda m: mean_while(np.maximum(m.run.clearance, 0.0), m.outside_alone)),
    Metric("violation_depth", lambda m: m.violated),
    Metric("violation_time_s", lambda m: m.outside.sum(axis=0) * m.Ts),
    Metric("phi_max", lambda m: m.run.phi.max(axis=0)),
    Metric("longest_positive_run_s", MetricInputs.longest_positive_runs),
    Metric("sampling_band", lambda m: m.record.sampling_band),
    Metric("band_depth", lambda m: m.within_band),
    Metric("held_time_s", lambda m: m.held.sum(axis=0) * m.Ts),
    Metric("usage_held", lambda m: mean_while(m.usage_at_speed, m.held)),
    Metric("share_to_hold", lambda m: m.run.share_to_hold),
    Metric("utilization", lambda m: mean_while(m.usage, m.outside_alone)),
))  # fmt: skip

#: Columns of both files that identify the run.
RUN = ("suite", "scenario", "controller", "trial")
STORED = tuple(
    sorted(
        (metric for metric in METRICS if metric.value is not None),
        key=lambda metric: metric.column_order,
    )
)
RESULT_COLUMNS = (*RUN, *(metric.column for metric in STORED))
CONSTRAINT_COLUMNS = (*RUN, *(metric.column for metric in ROW_METRICS))
#: Columns without which no stored table is read. All others may be missing, because an earlier
#: version did not write them, and are then read as empty.
REQUIRED_COLUMNS = frozenset(
    (*RUN, *(metric.column for metric in (*METRICS, *ROW_METRICS) if metric.required))
)
#: The columns of results.csv that differ from run to run on the same machine.
TIMING_COLUMNS = tuple(metric.column for metric in METRICS if metric.kind == "time")
#: Definitions of scores and of the terms in them: the single source of reports and documentation.
DEFINITIONS: dict[str, str] = _DEFINITIONS["term"] | {
    metric.column: metric.definition for metric in (*METRICS, *ROW_METRICS) if metric.definition
}


@dataclass(frozen=True)
class Score:
    """Scores of a run: its line of results.csv, and one line of constraints.csv per row.

    The columns of :data:`RUN`, which identify the run, are not included.
    """

    result: Mapping[str, Any]
    constraints: Sequence[Mapping[str, Any]]

    @in_one_line
    def __repr__(self) -> str:
        outside = self.result["violated"] or "none"
        return (
            f"<Score: {self.result['status']}, violated rows: {outside}, of "
            f"{len(self.constraints)}>"
        )


def score(record: RunRecord, baseline: RunRecord | None) -> Score:
    """Score a run; numbers are NaN if it has no sample.

    ``baseline`` is the run of the unconstrained baseline in the same scenario and trial. Without
    one, no row counts as challenged.
    """
    run = MetricInputs(record, baseline)
    some = len(record.trajectory.t) > 0
    result = {
        metric.column: metric.value(run) if some or metric.kind in ("text", "flag") else math.nan
        for metric in METRICS
        if metric.value is not None
    }
    columns = {
        metric.column: metric.value(run)
        for metric in ROW_METRICS
        if some and metric.value is not None
    }
    lines = zip(*columns.values(), strict=True)
    return Score(result, [dict(zip(columns, line, strict=True)) for line in lines])
