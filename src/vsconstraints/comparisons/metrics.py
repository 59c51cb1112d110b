"""Table of all metrics: the columns of results.csv and constraints.csv, and the scores of a run.

:class:`.MetricInputs` has the quantities that they are computed from. Reports print
:func:`definitions`. Parts of other packages add metrics, see :class:`.Part`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ConfigurationError, format_value
from ..plugins.earlier_names import earlier_constants
from ..plugins.metric import Metric
from ..plugins.registry import added_metrics
from ..rows.readable import in_one_line
from ..simulation import PATIENCE
from .metric_inputs import (
    NEGLIGIBLE,
    SLIDING_GAP,
    TOLERANCES,
    TOLERANT,
    MetricInputs,
    first_active,
    longest_run,
    mean_while,
    reduced,
)
from .record import RunRecord

__all__ = [
    "NEGLIGIBLE",
    "TOLERANCES",
    "TOLERANT",
    "Metric",
    "MetricInputs",
    "Score",
    "definitions",
    "longest_run",
    "row_metrics",
    "run_metrics",
    "score",
]

Measured = MetricInputs  #: Former name, for custom metrics that use it.

#: Columns of both files that identify the run, and their kinds.
KINDS_OF_RUN = {"suite": "text", "scenario": "text", "controller": "text", "trial": "index"}
RUN = tuple(KINDS_OF_RUN)  #: Their names.

_NUMBERS = {
    "PATIENCE": PATIENCE,
    "SLIDING_GAP": SLIDING_GAP,
    "NEGLIGIBLE": NEGLIGIBLE,
    "TOLERANT": TOLERANT,
}
_TEXTS = tomllib.loads(Path(__file__).with_name("metrics.toml").read_text(encoding="utf-8"))
_p99 = partial(np.quantile, q=0.99)


def _with_definitions(table: str, metrics: Iterable[Metric]) -> tuple[Metric, ...]:
    """Add the definitions of the file ``metrics.toml`` to metrics; ratios have none."""
    texts = _TEXTS[table]
    described = []
    for metric in metrics:
        if metric.column in texts and not metric.over:
            definition = texts[metric.column].format(**_NUMBERS)
            described.append(replace(metric, definition=definition))
        else:
            described.append(metric)
    return tuple(described)


#: Metrics of a run of this package, in the order in which a scenario's tables show them.
_METRICS = (
    Metric("status", lambda m: m.run.status, kind="text", required=True, without_samples=True),
    Metric("reason", lambda m: m.run.reason, kind="text", without_samples=True),
    Metric("duration_s", lambda m: m.run.t[-1], required=True),
    Metric("settling_time_s", MetricInputs.settling_time, header="settling time [s]", group="task"),
    Metric(
        "final_translation_error_m",
        lambda m: m.run.camera_error[-1, 0],
        header="position error [mm]",
        group="task",
        factor=1e3,
        style="error",
    ),
    Metric(
        "final_rotation_error_rad",
        lambda m: m.run.camera_error[-1, 1],
        header="orientation error [mrad]",
        group="task",
        factor=1e3,
        style="error",
    ),
    Metric(
        "final_feature_error_px",
        lambda m: m.run.feature_error_px[-1],
        header="image error [px]",
        group="task",
        style="error",
    ),
    Metric(
        "utilization",
        MetricInputs.utilization,
        header="utilization [%]",
        better="more",
        group="outcome",
        style="percent",
        overall="median utilization [%]",
        finding=("Most of the allowed space used", "%"),
    ),
    Metric(
        "violated",
        lambda m: m.name_rows(m.natural_depth),
        kind="text",
        required=True,
        without_samples=True,
    ),
    # a fraction of L, in contrast to the column of the same name in constraints.csv
    Metric(
        "violation_depth",
        MetricInputs.deepest_violation,
        required=True,
        header="worst depth [% of L]",
        group="outcome",
        judged="any",
        factor=100.0,
        overall="worst depth [% of L]",
        condensed="worst",
    ),
    Metric(
        "violation_time_s",
        lambda m: float(m.outside.any(axis=1).sum() * m.Ts),
        header="time outside [s]",
        group="outcome",
        judged="any",
    ),
    Metric("phi_band", lambda m: m.band.width, header="φ band", better=None),
    Metric("phi_band_bound", lambda m: m.band.bound, header="bound T_s u⁺", better=None),
    Metric(
        "phi_band",
        None,
        header="band / bound",
        judged="sliding",
        over="phi_band_bound",
        overall="worst φ band / bound",
        condensed="worst",
    ),
    Metric(
        "sliding_lost_s",
        MetricInputs.sliding_lost,
        header="sliding lost [s]",
        judged="sliding",
        column_order=3,
    ),
    Metric(
        "switching_rate_hz",
        lambda m: m.per_second(m.switches),
        header="switching rate [Hz]",
        overall="switching rate [Hz]",
    ),
    Metric(
        "acceleration_variation",
        lambda m: m.per_second(m.command_changes),
        header="acceleration variation [rad/s³]",
        overall="acceleration variation [rad/s³]",
        finding=("Least chattering (acceleration variation)", "rad/s³"),
    ),
    Metric("jerk_rms", MetricInputs.jerk, header="RMS jerk [rad/s³]"),
    Metric(
        "step_time_median_us",
        lambda m: reduced(m.step_times, np.median),
        header="call, median [µs]",
        better=None,
        kind="time",
        group="time",
        overall="median call [µs]",
    ),
    Metric(
        "step_time_p99_us",
        lambda m: reduced(m.step_times, _p99),
        header="p99 [µs]",
        better=None,
        kind="time",
        group="time",
    ),
    Metric(
        "step_time_max_us",
        lambda m: reduced(m.step_times, np.max),
        header="max [µs]",
        better=None,
        kind="time",
        group="time",
    ),
    Metric(
        "rows_time_median_us",
        lambda m: reduced(m.rows_times, np.median),
        header="rows and task, median [µs]",
        better=None,
        kind="time",
        group="time",
    ),
    Metric(
        "missed_periods",
        MetricInputs.missed_periods,
        header="missed periods",
        better=None,
        kind="time",
        group="time",
        style="count",
    ),
    Metric(
        "compiled",
        lambda m: m.run.compiled,
        kind="flag",
        column_order=1,
        required=True,
        without_samples=True,
    ),
    Metric(
        "within_band",
        lambda m: m.name_rows(m.natural_depth_within_band),
        kind="text",
        column_order=2,
        required=True,
        without_samples=True,
    ),
    Metric("held_time_s", lambda m: float(m.held.sum() * m.Ts), column_order=4),
    Metric("saturated_time_s", lambda m: float(m.run.saturated.sum() * m.Ts), column_order=5),
    Metric(
        "violation_fraction",
        lambda m: float(m.relative_depth_without_threshold.max(initial=0.0)),
        column_order=6,
    ),
    Metric(
        "violated_tolerant",
        lambda m: m.name_rows(m.relative_depth_without_threshold - TOLERANT),
        kind="text",
        column_order=7,
        required=True,
        without_samples=True,
    ),
    Metric("acceleration_max", MetricInputs.largest_acceleration, column_order=8),
)

#: Metrics of each row of a run of this package.
_ROW_METRICS = (
    Metric("constraint", lambda m: m.run.labels, kind="text", required=True),
    Metric("kind", lambda m: m.record.kinds, kind="text"),
    Metric("unit", lambda m: m.record.units, kind="text"),
    Metric(
        "challenged",
        lambda m: m.outside_alone.any(axis=0).tolist(),
        kind="flag",
        required=True,
    ),
    Metric("active_time_s", lambda m: m.run.active.sum(axis=0) * m.Ts),
    Metric("first_active_s", lambda m: first_active(m.run.t, m.run.active)),
    Metric("last_active_s", lambda m: first_active(m.run.t[::-1], m.run.active[::-1])),
    Metric("clearance_min", lambda m: m.least),
    Metric("usage_max", lambda m: 1.0 - m.least / m.record.length),
    Metric(
        "mean_unused_margin",
        lambda m: mean_while(np.maximum(m.run.clearance, 0.0), m.outside_alone),
    ),
    # in the unit of the row, in contrast to the column of the same name in results.csv
    Metric("violation_depth", lambda m: m.natural_depth),
    Metric("violation_time_s", lambda m: m.outside.sum(axis=0) * m.Ts),
    Metric("phi_max", lambda m: m.run.phi.max(axis=0)),
    Metric("longest_positive_run_s", MetricInputs.longest_positive_runs),
    Metric("sampling_band", lambda m: m.record.sampling_band),
    Metric("band_depth", lambda m: m.natural_depth_within_band),
    Metric("held_time_s", lambda m: m.held.sum(axis=0) * m.Ts),
    Metric("usage_held", lambda m: mean_while(m.usage_at_speed, m.held)),
    Metric("share_to_hold", lambda m: m.run.share_to_hold),
    Metric("utilization", lambda m: mean_while(m.usage, m.outside_alone)),
)


_OF_RUNS = _with_definitions("run", _METRICS)
_OF_ROWS = _with_definitions("row", _ROW_METRICS)

#: Columns without which no stored table is read. All others may be missing, because an earlier
#: version did not write them, and are then read as empty.
REQUIRED_COLUMNS = frozenset(
    (*RUN, *(metric.column for metric in (*_OF_RUNS, *_OF_ROWS) if metric.required))
)


def require_addable(of_runs: Sequence[Metric], of_rows: Sequence[Metric] = ()) -> None:
    """Raise ConfigurationError if metrics of other packages do not fit into the two tables.

    A column must be new, also in the other table: one name has one meaning. A ratio must be of two
    scores of results.csv that are numbers; rows have none. An empty cell must not make tables
    unreadable that were stored without the metric. The error names the package, if it is known.
    """
    known = {*RUN, *(metric.column for metric in (*_OF_RUNS, *_OF_ROWS))}
    for metric in (*of_runs, *of_rows):
        if metric.required or metric.without_samples:
            raise ConfigurationError(
                f"{_addition(metric)} with 'required' or 'without_samples', which only metrics of "
                "vsconstraints can have"
            )
        if metric.value is not None:
            if metric.column in known:
                raise ConfigurationError(
                    f"{_addition(metric)}, but there is a column of this name already"
                )
            known.add(metric.column)
    numbers = {metric.column for metric in _with_columns((*_OF_RUNS, *of_runs)) if metric.is_number}
    for metric in of_runs:
        if metric.value is None:
            _require_ratio(metric, numbers)
    for metric in of_rows:
        if metric.value is None:
            raise ConfigurationError(
                f"{_addition(metric)} / {metric.over} to rows, whose metrics must have a value: "
                "only runs have ratios"
            )


def _addition(metric: Metric) -> str:
    return f"{metric.package or 'another package'} adds the metric {metric.column}"


def _require_ratio(metric: Metric, numbers: Container[str]) -> None:
    """Raise ConfigurationError unless a ratio is a number, of scores in ``numbers``."""
    ratio = f"{_addition(metric)} / {metric.over}"
    for column in (metric.column, metric.over):
        if column not in numbers:
            raise ConfigurationError(
                f"{ratio}, but {format_value(column)} is no score of results.csv that is a number"
            )
    if not metric.is_number:
        raise ConfigurationError(f"{ratio}, whose kind must be number, not {metric.kind}")


@cache
def load_metrics() -> tuple[tuple[Metric, ...], tuple[Metric, ...]]:
    """Load the metrics of runs and of their rows that other packages add.

    They are loaded at the first use of metrics: a package that adds one may import this package.
    Commands call this before they run anything. Raises ConfigurationError if one cannot be used.
    """
    of_runs = tuple(added_metrics("metrics"))
    of_rows = tuple(added_metrics("row_metrics"))
    require_addable(of_runs, of_rows)
    return of_runs, of_rows


def run_metrics() -> tuple[Metric, ...]:
    """Return the metrics of a run, in the order in which a scenario's tables show them.

    Like all functions of these tables, this raises what :func:`load_metrics` raises.
    """
    of_runs, _ = load_metrics()
    return (*_OF_RUNS, *of_runs)


def row_metrics() -> tuple[Metric, ...]:
    """Return the metrics of each row of a run."""
    _, of_rows = load_metrics()
    return (*_OF_ROWS, *of_rows)


def result_columns() -> tuple[str, ...]:
    """Return the columns of results.csv."""
    of_runs, _ = load_metrics()
    in_order = (*sorted(_OF_RUNS, key=lambda metric: metric.column_order), *of_runs)
    return (*RUN, *(metric.column for metric in _with_columns(in_order)))


def constraint_columns() -> tuple[str, ...]:
    """Return the columns of constraints.csv."""
    return (*RUN, *(metric.column for metric in row_metrics()))


def timing_columns() -> tuple[str, ...]:
    """Return the columns of results.csv that differ from run to run on the same machine."""
    return tuple(metric.column for metric in _with_columns(run_metrics()) if metric.kind == "time")


def definitions() -> dict[str, str]:
    """Return the definitions of scores and of the terms in them, by name.

    They are the single source of reports and documentation.
    """
    defined = [metric for metric in (*run_metrics(), *row_metrics()) if metric.definition]
    return {**_TEXTS["term"], **{metric.column: metric.definition for metric in defined}}


if not TYPE_CHECKING:  # type checkers would then accept any name
    __getattr__ = earlier_constants(__name__, {"DEFINITIONS": definitions})


def _with_columns(metrics: Iterable[Metric]) -> list[Metric]:
    """Return the metrics that have a column of their own, which a ratio has not."""
    return [metric for metric in metrics if metric.value is not None]


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
    one, no row counts as challenged. Raises ConfigurationError if a metric cannot be computed.
    """
    run = MetricInputs(record, baseline)
    has_samples = len(record.trajectory.t) > 0
    result = {}
    for metric in _with_columns(run_metrics()):
        is_computed = has_samples or metric.without_samples
        result[metric.column] = metric.of_run(run) if is_computed else metric.empty
    if not has_samples:
        return Score(result, [])
    columns = {
        metric.column: metric.of_rows(run, len(record.trajectory.labels))
        for metric in row_metrics()
    }
    lines = zip(*columns.values(), strict=True)
    return Score(result, [dict(zip(columns, line, strict=True)) for line in lines])
