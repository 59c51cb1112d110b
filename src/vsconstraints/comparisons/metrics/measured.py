"""A run and what several metrics are computed from, worked out once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ...rows import Array, BoolArray
from ...simulation import Trajectory
from ..record import RunRecord
from .chattering import worst_band
from .clearance import Clearances, clearances, outside_alone
from .utilization import held, usage, usage_at_speed


@dataclass(frozen=True)
class Measured:
    """What a metric's function is given; N samples, m rows.

    Attributes
    ----------
    record
        The run: its trajectory, and what describes its rows.
    baseline
        The tracking-only run of the same scenario and trial; None if it failed.
    clearances
        Least clearance and depth of each row.
    held
        (N, m) when each row holds the arm back.
    band
        Band of φ and its bound, of the row in which the one is largest relative to the other.
    """

    record: RunRecord
    baseline: RunRecord | None
    clearances: Clearances
    held: BoolArray
    band: tuple[float, float]

    @classmethod
    def of(cls, record: RunRecord, baseline: RunRecord | None = None) -> Measured:
        """The same of a run."""
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
        """(T, m) periods in which tracking alone is outside."""
        return outside_alone(self.record, self.baseline)

    @property
    def run(self) -> Trajectory:
        """What the simulation left."""
        return self.record.trajectory

    @property
    def Ts(self) -> float:  # noqa: N802 - a symbol of the formulas
        """Sampling time [s]."""
        return self.record.Ts
