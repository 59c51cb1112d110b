"""A run's line of results.csv, and those of its rows in constraints.csv."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...rows.readable import in_one_line
from ..record import RunRecord
from .measured import Measured
from .table import METRICS, ROW_METRICS


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
    """Score a run.

    Parameters
    ----------
    record
        The run. If it has no sample, what is a number does not exist.
    baseline
        The tracking-only run of the same scenario and trial; without one (it failed) no row counts as challenged.
    """
    run, some = Measured.of(record, baseline), len(record.trajectory.t) > 0
    result = {
        metric.column: metric.value(run) if some or metric.kind in ("text", "flag") else math.nan
        for metric in METRICS
        if metric.value is not None
    }
    columns = {metric.column: metric.value(run) for metric in ROW_METRICS if some and metric.value is not None}
    lines = zip(*columns.values(), strict=True)
    return Score(result, [dict(zip(columns, line, strict=True)) for line in lines])
