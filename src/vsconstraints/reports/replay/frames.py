"""The instants that are shown of runs, and which rows are lit in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...rows import Array
from .run import ReplayRun

RATE = 25.0
"""Frames per second of time, unless that makes more than :data:`MOST`."""

MOST = 300
"""Frames of a replay."""

OFF, ACTS, OUTSIDE = 0, 1, 2
"""What a row's lamp says: nothing, that it holds the arm back, or that it is violated."""

Lights = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Frames:
    """Instants at equal distances, from the start to the end of the longest run.

    Attributes
    ----------
    t
        (F,) [s].
    period
        Between them [s].
    """

    t: Array
    period: float

    @classmethod
    def of(cls, runs: Sequence[ReplayRun], rate: float = RATE, most: int = MOST) -> Frames:
        """Those of runs: so many a second, or so many in all if that is fewer."""
        end = max(float(run.trajectory.t[-1]) for run in runs)
        period = max(1.0 / rate, end / (most - 1))
        return cls(period * np.arange(int(np.ceil(end / period - 1e-9)) + 1), period)

    def samples(self, run: ReplayRun) -> npt.NDArray[np.int64]:
        """(F,) the sample of a run that each instant shows: the last one until then; its last one when it is over."""
        t = run.trajectory.t
        return np.maximum(np.searchsorted(t, self.t + 1e-9, side="right") - 1, 0).astype(np.int64)

    def lights(self, run: ReplayRun) -> Lights:
        """(F, m) what the lamp of each row says from one instant to the next: a moment is enough to light it.

        A run that is over lights none: nothing after the frame that is the first to show its last sample.
        """
        every = lights(run)
        first = self.samples(run)
        shown = np.maximum.reduceat(every, first, axis=0)
        shown[1:][first[:-1] == len(every) - 1] = OFF
        return shown

    def remark(self, runs: Sequence[ReplayRun]) -> str:
        """What of the runs is shown, in a sentence."""
        samples = max(len(run.trajectory.t) for run in runs)
        if samples <= len(self.t):
            return ""
        return (
            f"{len(self.t)} of {samples} samples are shown; a row is lit where it acts, or is violated, in any sample "
            "until the next that is shown."
        )


def lights(run: ReplayRun) -> Lights:
    """(N, m) what the lamp of each row says at each sample."""
    record = RunRecord.of(run.setup, run.trajectory, "")
    outside = np.minimum(run.trajectory.clearance, run.trajectory.between_clearance) < -NEGLIGIBLE * record.length
    return np.where(outside, OUTSIDE, np.where(run.trajectory.active, ACTS, OFF)).astype(np.uint8)
