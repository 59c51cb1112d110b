"""Scores of a run: what metrics are computed from, each worked out once, and the table of all
metrics.

The definitions are part of the product: reports print :data:`DEFINITIONS`.
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
"""Depth, as a fraction of the characteristic length, up to which a row is not violated: the strict
standard.

A law that keeps a row on its boundary is off by some 1e-5. What T_s u⁺ (43) explains is violated
all the same.
"""

TOLERANT = 1e-2  #: the same of the tolerant standard, which is about what cameras and arms resolve

#: Where reports show how success grows with the depth that is tolerated.
TOLERANCES = (NEGLIGIBLE, 1e-3, TOLERANT, 2e-2, 5e-2, 1e-1)

#: in a sliding mode φ crosses zero again and again: within this many samples, from either side
SLIDING_GAP = 10
AT_BOUNDARY = 3  #: samples with φ ≥ 0 from which on a row is at its boundary; fewer only touch it
#: While φ is no farther below zero than so many switching steps T_s u⁺, a row that acts before and
#: after holds on.
STEPS = 2.0


@dataclass
class Measured:
    """The argument of a metric's function: a run of N samples and m rows, with the baseline of the
    same trial.

    ``run`` is what the simulation left, ``Ts`` the sampling time [s]. (m,) ``least`` clearances are
    of the whole run, between samples too; ``violated`` are depths by the strict standard, 0 if not,
    ``within_band`` those that were never deeper than the sampling band, ``fraction`` the greatest
    depths, however slight, over the characteristic lengths. (N, m) ``outside`` says in which
    periods a row is as deep outside as violated ones are, (T, m) ``outside_alone`` the same of the
    baseline; (N, m) ``usage`` is 1 − c/L, from 0 to 1, of clearances c. From sample to sample
    within the scenario's duration: ``switches``, whether the active set changes, and
    ``command_changes`` ‖Δq̈_c‖. ``step_times`` and ``rows_times`` are of the controller's calls,
    and of rows and task, but the first [µs].
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
        """Labels of the rows with a depth (m,), separated by semicolons."""
        return "; ".join(self.run.labels[i] for i in np.flatnonzero(depth > 0.0))

    @cached_property
    def usage_at_speed(self) -> Array:
        """(N, m) 1 − (c + K ċ)/L, from 0 to 1: 1 where the arm may come no faster, by φ = σ + K σ̇
        = 0.
        """
        c = self.run.clearance
        if len(c) < 2:
            return np.zeros(c.shape)
        with np.errstate(invalid="ignore"):
            left = c + self.record.approach_time * np.gradient(c, self.Ts, axis=0)
            usage = np.clip(1.0 - left / self.record.length, 0.0, 1.0)
        return np.nan_to_num(usage)  # where no boundary is in sight, nothing is used

    @cached_property
    def held(self) -> BoolArray:
        """(N, m) when each row holds the arm back: it acts or, in a sliding mode, acts before and
        after.
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
        """Mean usage where the baseline is outside, while both runs last; NaN if not converged, or
        it never is.
        """
        common = min(len(self.usage), len(self.outside_alone))
        when = self.outside_alone[:common]
        if self.run.status != "converged" or not when.any():
            return float("nan")
        return float(self.usage[:common][when].mean())

    @cached_property
    def band(self) -> tuple[float, float]:
        """Band of φ and its bound T_s u⁺, of the row in which the one is largest relative to the
        other; NaN if none.
        """
        bounds = self.Ts * self.record.switching_gain
        bands = np.array(
            [_band(phi, bound) for phi, bound in zip(self.run.phi.T, bounds, strict=True)]
        )
        if len(self.run.t) < 2 or not np.isfinite(bands).any():
            return np.nan, np.nan
        worst = np.nanargmax(bands / bounds)
        return float(bands[worst]), float(bounds[worst])

    def largest_acceleration(self) -> float:
        """Return the largest acceleration commanded of one joint in any sample; NaN if there is
        none.
        """
        return over(np.abs(self.run.qdd_command).ravel(), np.fmax.reduce)

    def sliding_lost(self) -> float:
        """Time for which some row's φ stays at or above zero for longer than a sliding mode does,
        beyond T_s u⁺ [s].
        """
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
        """From the beginning of each goal until it is reached for good [s], added up; NaN if it did
        not converge.
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
        """Samples but the first that took longer than a period, NaN without; on an arm, what its
        loop missed.
        """
        if self.record.missed is not None:
            return self.record.missed
        both = self.step_times + self.rows_times
        return int((both > 1e6 * self.Ts).sum()) if len(both) else np.nan


def _in_period(record: RunRecord) -> Array:
    """(N, m) least clearance of each sampling period, at its beginning and inside."""
    return cast(Array, np.minimum(record.trajectory.clearance, record.trajectory.between_clearance))


def _outside_at(record: RunRecord, Ts: float) -> BoolArray:
    """(T, m) whether each row is as deep outside as violated ones, in any part of periods of
    sampling time Ts [s].
    """
    outside = _in_period(record) < -NEGLIGIBLE * record.length
    begins = np.arange(0.0, len(outside) - ROUNDING, Ts / record.Ts) + ROUNDING
    return np.logical_or.reduceat(outside, begins.astype(np.int64)) if len(outside) else outside


def mean_while(values: Array, when: BoolArray) -> Array:
    """(m,) mean of values (N, m) over the samples in which a flag (T, m) is set, of those that both
    have; else NaN.
    """
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

    ``value`` is that of a run or, in constraints.csv, of each of its rows; None for the ratio
    ``column / over``. ``better`` is None for a fact or noise. A ``kind`` of ``time`` is a number
    that differs from run to run on the same machine. Columns stand in the order in which they were
    ``added``: a new one has a greater number than all others. Tables of earlier versions can be
    read without it if it is a number.

    In reports, ``header`` (with unit; empty: not shown) heads it in the table ``group`` of a
    scenario, ``overall`` in the tables over all scenarios, where runs are ``condensed``: to the
    median of those that converged, of a time of all, or to the worst. ``factor`` and ``style`` make
    the shown number: three digits; not less than a thousandth; two decimals; whole. ``finding`` is
    the sentence that names the best law, and the unit. ``judged`` says whose values are compared,
    of the runs that converged: ``any``, those ``inside`` that violated no row, or of these the ones
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


_NUMBERS = {
    "PATIENCE": PATIENCE,
    "SLIDING_GAP": SLIDING_GAP,
    "NEGLIGIBLE": NEGLIGIBLE,
    "TOLERANT": TOLERANT,
}
_DEFINITIONS = tomllib.loads(Path(__file__).with_name("metrics.toml").read_text(encoding="utf-8"))


def _described(what: str, metrics: Sequence[Metric]) -> tuple[Metric, ...]:
    """With their definitions, where those are in the file beside this one; ratios have none."""
    texts = {
        metric.column: _DEFINITIONS[what].get(metric.column, "").format(**_NUMBERS)
        for metric in metrics
    }
    return tuple(
        m if m.definition or m.over else replace(m, definition=texts[m.column]) for m in metrics
    )


#: Of a run, in the order in which a scenario's tables show them.
METRICS = _described("run", (
    Metric("status", lambda m: m.run.status, kind="text"),
    Metric("reason", lambda m: m.run.reason, kind="text"),
    Metric("duration_s", lambda m: m.run.t[-1]),
    Metric("settling_time_s", Measured.settling_time, "settling time [s]", group="task"),
    Metric("final_translation_error_m", lambda m: m.run.camera_error[-1, 0], "position error [mm]", group="task",
           factor=1e3, style="error"),
    Metric("final_rotation_error_rad", lambda m: m.run.camera_error[-1, 1], "orientation error [mrad]", group="task",
           factor=1e3, style="error"),
    Metric("final_feature_error_px", lambda m: m.run.feature_error_px[-1], "image error [px]", group="task",
           style="error"),
    Metric("utilization", Measured.utilization, "utilization [%]", "more", group="outcome", style="percent",
           overall="median utilization [%]", finding=("Most of the allowed space used", "%")),
    Metric("violated", lambda m: m.named(m.violated), kind="text"),
    Metric("violation_depth", lambda m: float((m.violated / m.record.length).max(initial=0.0)), "worst depth [% of L]",
           group="outcome", judged="any", factor=100.0, overall="worst depth [% of L]", condensed="worst"),
    Metric("violation_time_s", lambda m: float(m.outside.any(axis=1).sum() * m.Ts), "time outside [s]",
           group="outcome", judged="any"),
    Metric("phi_band", lambda m: m.band[0], "φ band", None),
    Metric("phi_band_bound", lambda m: m.band[1], "bound T_s u⁺", None),
    Metric("phi_band", None, "band / bound", judged="sliding", over="phi_band_bound", overall="worst φ band / bound",
           condensed="worst"),
    Metric("sliding_lost_s", Measured.sliding_lost, "sliding lost [s]", judged="sliding", added=3),
    Metric("switching_rate_hz", lambda m: m.per_second(m.switches), "switching rate [Hz]",
           overall="switching rate [Hz]"),
    Metric("acceleration_variation", lambda m: m.per_second(m.command_changes), "acceleration variation [rad/s³]",
           overall="acceleration variation "
                   "[rad/s³]", finding=("Least chattering (acceleration variation)", "rad/s³")),
    Metric("jerk_rms", lambda m: over(m.command_changes, lambda change: np.sqrt((change**2).mean()) / m.Ts),
           "RMS jerk [rad/s³]"),
    Metric("step_time_median_us", lambda m: over(m.step_times, np.median), "call, median [µs]", None, kind="time",
           group="time", overall="median call [µs]"),
    Metric("step_time_p99_us", lambda m: over(m.step_times, lambda each: np.quantile(each, 0.99)), "p99 [µs]", None,
           kind="time", group="time"),
    Metric("step_time_max_us", lambda m: over(m.step_times, np.max), "max [µs]", None, kind="time", group="time"),
    Metric("rows_time_median_us", lambda m: over(m.rows_times, np.median), "rows and task, median [µs]", None,
           kind="time", group="time"),
    Metric("missed_periods", Measured.missed_periods, "missed periods", None, kind="time", group="time", style="count"),
    Metric("compiled", lambda m: m.run.compiled, kind="flag", added=1),
    Metric("within_band", lambda m: m.named(m.within_band), kind="text", added=2),
    Metric("held_time_s", lambda m: float(m.held.sum() * m.Ts), added=4),
    Metric("saturated_time_s", lambda m: float(m.run.saturated.sum() * m.Ts), added=5),
    Metric("violation_fraction", lambda m: float(m.fraction.max(initial=0.0)), added=6),
    Metric("violated_tolerant", kind="text", added=7, value=lambda m: m.named(m.fraction - TOLERANT)),
    Metric("acceleration_max", Measured.largest_acceleration, added=8),
))  # fmt: skip
#: Of each row of a run.
ROW_METRICS = _described("row", (
    Metric("constraint", lambda m: m.run.labels, kind="text"),
    Metric("kind", lambda m: m.record.kinds, kind="text"),
    Metric("unit", lambda m: m.record.units, kind="text"),
    Metric("challenged", lambda m: m.outside_alone.any(axis=0).tolist(), kind="flag"),
    Metric("active_time_s", lambda m: m.run.active.sum(axis=0) * m.Ts),
    Metric("first_active_s", lambda m: first_active(m.run.t, m.run.active)),
    Metric("last_active_s", lambda m: first_active(m.run.t[::-1], m.run.active[::-1])),
    Metric("clearance_min", lambda m: m.least),
    Metric("usage_max", lambda m: 1.0 - m.least / m.record.length),
    Metric("mean_unused_margin", lambda m: mean_while(np.maximum(m.run.clearance, 0.0), m.outside_alone)),
    Metric("violation_depth", lambda m: m.violated),
    Metric("violation_time_s", lambda m: m.outside.sum(axis=0) * m.Ts),
    Metric("phi_max", lambda m: m.run.phi.max(axis=0)),
    Metric("longest_positive_run_s", Measured.longest_positive_runs),
    Metric("sampling_band", lambda m: m.record.sampling_band),
    Metric("band_depth", lambda m: m.within_band),
    Metric("held_time_s", lambda m: m.held.sum(axis=0) * m.Ts),
    Metric("usage_held", lambda m: mean_while(m.usage_at_speed, m.held)),
    Metric("share_to_hold", lambda m: m.run.share_to_hold),
    Metric("utilization", lambda m: mean_while(m.usage, m.outside_alone)),
))  # fmt: skip

#: columns of both files that say which run it is
RUN = ("suite", "scenario", "controller", "trial")
STORED = tuple(
    sorted(
        (metric for metric in METRICS if metric.value is not None), key=lambda metric: metric.added
    )
)
RESULT_COLUMNS = (*RUN, *(metric.column for metric in STORED))
CONSTRAINT_COLUMNS = (*RUN, *(metric.column for metric in ROW_METRICS))
#: Columns that tables of earlier versions may lack: they then read as empty. Only numbers can,
#: since an empty text says something.
LATER_COLUMNS = tuple(
    each.column for each in STORED if each.added and each.kind in ("number", "time")
)
#: The columns of results.csv that differ from run to run on the same machine.
TIMING_COLUMNS = tuple(metric.column for metric in METRICS if metric.kind == "time")
#: What the scores mean, and words that this uses: the one source of reports and documentation.
DEFINITIONS: dict[str, str] = _DEFINITIONS["term"] | {
    metric.column: metric.definition for metric in (*METRICS, *ROW_METRICS) if metric.definition
}


@dataclass(frozen=True)
class Score:
    """One line of results.csv and one of constraints.csv for each row, without suite, scenario,
    controller, trial.
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
    """Score a run; where it has no sample, what is a number does not exist.

    ``baseline`` is the tracking-only run of the same scenario and trial; without one no row counts
    as challenged.
    """
    run = Measured(record, baseline)
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
