"""The table of metrics: every column of results.csv and constraints.csv, what it means and how it is shown."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...rows.readable import in_one_line
from ...simulation import PATIENCE
from ..record import RunRecord
from .measured import NEGLIGIBLE, SLIDING_GAP, TOLERANT, Measured, Metric, first_active, mean_while, over

_NUMBERS = {"PATIENCE": PATIENCE, "SLIDING_GAP": SLIDING_GAP, "NEGLIGIBLE": NEGLIGIBLE, "TOLERANT": TOLERANT}
_DEFINITIONS = tomllib.loads(Path(__file__).with_name("definitions.toml").read_text(encoding="utf-8"))


def _described(what: str, metrics: Sequence[Metric]) -> tuple[Metric, ...]:
    """With their definitions, where those are in the file beside this one; ratios have none."""
    texts = {metric.column: _DEFINITIONS[what].get(metric.column, "").format(**_NUMBERS) for metric in metrics}
    return tuple(m if m.definition or m.over else replace(m, definition=texts[m.column]) for m in metrics)


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
           overall="acceleration variation [rad/s³]", finding=("Least chattering (acceleration variation)", "rad/s³")),
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

RUN = ("suite", "scenario", "controller", "trial")  #: columns of both files that say which run it is
STORED = tuple(sorted((metric for metric in METRICS if metric.value is not None), key=lambda metric: metric.added))
RESULT_COLUMNS = (*RUN, *(metric.column for metric in STORED))
CONSTRAINT_COLUMNS = (*RUN, *(metric.column for metric in ROW_METRICS))
#: The columns of results.csv that differ from run to run on the same machine.
TIMING_COLUMNS = tuple(metric.column for metric in METRICS if metric.kind == "time")
#: What the scores mean, and words that this uses: the one source of reports and documentation.
DEFINITIONS: dict[str, str] = _DEFINITIONS["term"] | {
    metric.column: metric.definition for metric in (*METRICS, *ROW_METRICS) if metric.definition
}


@dataclass(frozen=True)
class Score:
    """One line of results.csv and one of constraints.csv for each row, without suite, scenario, controller, trial."""

    result: Mapping[str, Any]
    constraints: Sequence[Mapping[str, Any]]

    @in_one_line
    def __repr__(self) -> str:
        outside = self.result["violated"] or "none"
        return f"<Score: {self.result['status']}, violated rows: {outside}, of {len(self.constraints)}>"


def score(record: RunRecord, baseline: RunRecord | None) -> Score:
    """Score a run; where it has no sample, what is a number does not exist.

    ``baseline`` is the tracking-only run of the same scenario and trial; without one no row counts as challenged.
    """
    run, some = Measured(record, baseline), len(record.trajectory.t) > 0
    result = {
        metric.column: metric.value(run) if some or metric.kind in ("text", "flag") else math.nan
        for metric in METRICS
        if metric.value is not None
    }
    columns = {metric.column: metric.value(run) for metric in ROW_METRICS if some and metric.value is not None}
    lines = zip(*columns.values(), strict=True)
    return Score(result, [dict(zip(columns, line, strict=True)) for line in lines])
