"""What a run on an arm leaves: every period, as it was measured and sent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ..comparisons.runs.files import write_arrays
from ..rows import Array, BoolArray

Ended = Literal["done", "aborted", "failed", "stopped"]
"""``done``: the whole duration. ``aborted``: the law lost rank, and the scenario stops there. ``failed``: anything else
that ended it. ``stopped``: somebody asked for it."""


class Period(NamedTuple):
    """One period: times [s], and arrays (n,).

    ``scheduled`` and ``late`` are when it was to begin, and how much later it did; ``rows_time`` and ``step_time`` what
    rows with task, and the law, took; ``busy`` the whole period's work. ``q`` and ``qd`` are measured, ``sent_q`` and
    ``sent_qd`` where the arm is to be at the end. ``pixels`` (M, 2) is what was measured, NaN without an image;
    ``taken`` when; ``innovation`` (6,) how far what was measured is from the model's prediction, see
    :data:`vsconstraints.vision.measurement.INNOVATIONS`.
    """

    scheduled: float
    late: float
    rows_time: float
    step_time: float
    busy: float
    q: Array
    qd: Array
    qdd: Array
    sent_q: Array
    sent_qd: Array
    pixels: Array
    taken: float
    innovation: Array
    guarded: bool
    braking: bool


@dataclass(frozen=True)
class ArmLog:
    """A run on an arm.

    Attributes
    ----------
    ended, cause
        How and why; the cause is empty where it is done.
    signal
        Number of the signal that asked for a stop; 0 if none did.
    stop
        How the arm came to rest, in words.
    at_rest
        Whether it was seen to.
    periods
        All of them, those of the stop too.
    missed
        How many began later than the next should have.
    remarks
        What else a reader should know.
    Ts
        Sampling time [s].
    compiled
        Whether rows, task and law all ran compiled.
    real_time
        Whether time was the system's; otherwise it waited for the loop, which then misses nothing.
    bounds
        Beyond which the arm would have been braked, by name: see :class:`.Supervision`.
    """

    ended: Ended
    cause: str
    signal: int
    stop: str
    at_rest: bool
    periods: Sequence[Period]
    missed: int
    Ts: float
    compiled: bool = False
    remarks: tuple[str, ...] = field(default=())
    real_time: bool = False
    bounds: Mapping[str, float] = field(default_factory=dict)

    def column(self, name: str) -> Array:
        """(N, …) one field of all periods."""
        return np.array([getattr(period, name) for period in self.periods])

    @property
    def braking(self) -> BoolArray:
        """(N,) which periods are those of the stop."""
        flags: BoolArray = np.array([period.braking for period in self.periods], dtype=np.bool_)
        return flags

    def save(self, path: Path, **facts: Any) -> None:
        """Write all periods as .npz, and facts as JSON in it."""
        columns = {name: self.column(name) for name in Period._fields}
        own = {
            name: getattr(self, name)
            for name in (
                "ended",
                "cause",
                "signal",
                "stop",
                "at_rest",
                "missed",
                "Ts",
                "compiled",
                "real_time",
                "bounds",
            )
        }
        write_arrays(path, {**columns, **own, "remarks": list(self.remarks), **facts})
