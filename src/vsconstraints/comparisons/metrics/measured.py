"""A run and what several metrics are computed from, worked out once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ...formulas.tracking import goals_at
from ...rows import Array, BoolArray
from ...simulation import Trajectory
from ...simulation.outcome import settling_times
from ..record import RunRecord
from .chattering import worst_band
from .clearance import Clearances, clearances, held, outside_alone, usage, usage_at_speed


@dataclass(frozen=True)
class Measured:
    """The argument of a metric's function; N samples, m rows.

    Attributes
    ----------
    record, baseline
        The run, and the unconstrained baseline of the same scenario and trial; None if it failed.
    clearances
        Least clearance and depth of each row.
    held
        (N, m) when each row holds the arm back.
    band
        Band of φ and its bound, of the row with the greatest ratio of them.
    """

    record: RunRecord
    baseline: RunRecord | None
    clearances: Clearances
    held: BoolArray
    band: tuple[float, float]

    @classmethod
    def of(cls, record: RunRecord, baseline: RunRecord | None = None) -> Measured:
        """What metrics share of a run."""
        return cls(record, baseline, clearances(record), held(record), worst_band(record))

    @cached_property
    def usage(self) -> Array:
        """(N, m) of the allowed space, from 0 to 1."""
        return usage(self.record)

    @cached_property
    def usage_at_speed(self) -> Array:
        """(N, m) of what is left at the speed at which it is used up, from 0 to 1."""
        return usage_at_speed(self.record)

    @cached_property
    def outside_alone(self) -> BoolArray:
        """(T, m) periods in which unconstrained tracking is outside."""
        return outside_alone(self.record, self.baseline)

    @property
    def run(self) -> Trajectory:
        """What the simulation left."""
        return self.record.trajectory

    @property
    def Ts(self) -> float:  # noqa: N802 - a symbol of the formulas
        """Sampling time [s]."""
        return self.record.Ts


@dataclass(frozen=True)
class Metric:
    """A column of results.csv or constraints.csv, and of the tables of reports.

    Attributes
    ----------
    column, value
        Its name, and its value for a run or, in constraints.csv, for each row of it; None for a ratio of two columns.
    header
        Its heading in the tables of a scenario, with the unit; empty if it is not shown.
    better
        Which values are better; None where none is: a fact, or noise.
    definition
        What it means; empty where the name says it.
    kind
        What a cell holds; a ``time`` is a number that differs from run to run on the same machine.
    group
        Which table of a scenario shows it.
    judged
        Whose values are compared, of the runs that converged: ``any``, those ``inside`` that violated no row, or of
        those the ones still ``sliding`` that never lost a sliding mode.
    factor, style
        From the stored to the shown number. Styles: three digits; the same, but not less than a thousandth; two
        decimals; whole.
    over
        Column that it is divided by; empty if by none.
    overall, condensed
        Its heading in the tables over all scenarios, and how runs are aggregated: the ``median`` of those that
        converged, of a time of all, or the ``worst`` of all. No mean: one run that diverges would dominate it.
    finding
        Sentence of the findings that names the best law, and the unit; empty for none.
    added
        Columns stand in the order in which they were added: a new one has a greater number than the others.
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


def settling_time(measured: Measured) -> float:
    """From the beginning of each goal until it is reached for good [s], added up; NaN if the run did not converge."""
    if measured.run.status != "converged":
        return float("nan")
    record, t = measured.record, measured.run.t
    goals = goals_at(record.goal_begins, t)
    unsettled = [np.flatnonzero((goals == goal) & ~record.settled) for goal in range(len(record.goal_begins))]
    unreached = np.array([samples[-1] if len(samples) else -1 for samples in unsettled])
    return float(np.nansum(settling_times(unreached, record.goal_begins, len(t), record.Ts)))


def step_time(record: RunRecord, of_all: Callable[[Array], Any]) -> float:
    """Of the controller's calls [µs]; NaN where there is none but the first."""
    step = record.trajectory.step_time[1:] * 1e6
    return float(of_all(step)) if len(step) else np.nan


def rows_time(record: RunRecord) -> float:
    """Median of rows and task [µs] without the first sample; NaN where there is no other."""
    rows = record.trajectory.rows_time[1:] * 1e6
    return float(np.median(rows)) if len(rows) else np.nan


def missed_periods(record: RunRecord) -> float:
    """Samples that took longer than a period, without the first; NaN where there is no other.

    On an arm, periods that its loop missed: there the law's time is not all that a period has room for.
    """
    if record.missed is not None:
        return record.missed
    both = record.trajectory.step_time[1:] * 1e6 + record.trajectory.rows_time[1:] * 1e6
    return int((both > 1e6 * record.Ts).sum()) if len(both) else np.nan
