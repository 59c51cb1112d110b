"""The frames that a replay shows, which constraints are active or violated in each, and what is highlighted then."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal

import numpy as np
import numpy.typing as npt

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...rows import Array
from .runs import ReplayRun

RATE = 25.0
"""Frames per second of time, unless that makes more than :data:`MAX_FRAMES`."""

MAX_FRAMES = 300
"""Frames of a replay."""

INACTIVE, ACTIVE, VIOLATED = 0, 1, 2
"""States of a constraint's row."""

HIGHLIGHTS = {ACTIVE: "#F0A202", VIOLATED: "#D1102A"}
"""Their colours."""

States = npt.NDArray[np.uint8]


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
    def of(cls, runs: Sequence[ReplayRun], rate: float = RATE, most: int = MAX_FRAMES) -> Frames:
        """Those of runs: so many a second, or so many in all if that is fewer."""
        end = max(float(run.trajectory.t[-1]) for run in runs)
        period = max(1.0 / rate, end / (most - 1))
        return cls(period * np.arange(int(np.ceil(end / period - 1e-9)) + 1), period)

    def samples(self, run: ReplayRun) -> npt.NDArray[np.int64]:
        """(F,) the sample of a run that each instant shows: the last one until then; its last one when it is over."""
        t = run.trajectory.t
        return np.maximum(np.searchsorted(t, self.t + 1e-9, side="right") - 1, 0).astype(np.int64)

    def states(self, run: ReplayRun) -> States:
        """(F, m) the state of each row between one instant and the next: a single sample is enough to show it.

        A run that is over shows none: nothing after the frame that is the first to show its last sample.
        """
        every = states(run)
        first = self.samples(run)
        shown = np.maximum.reduceat(every, first, axis=0)
        shown[1:][first[:-1] == len(every) - 1] = INACTIVE
        return shown

    def remark(self, runs: Sequence[ReplayRun]) -> str:
        """What of the runs is shown, in a sentence."""
        samples = max(len(run.trajectory.t) for run in runs)
        if samples <= len(self.t):
            return ""
        return (
            f"{len(self.t)} of {samples} samples are shown; a constraint is highlighted if it is active or violated in "
            "any sample up to the next one shown."
        )


def states(run: ReplayRun) -> States:
    """(N, m) the state of each row at each sample."""
    record = RunRecord.of(run.setup, run.trajectory, "")
    outside = np.minimum(run.trajectory.clearance, run.trajectory.between_clearance) < -NEGLIGIBLE * record.length
    return np.where(outside, VIOLATED, np.where(run.trajectory.active, ACTIVE, INACTIVE)).astype(np.uint8)


# --- in space ---

Thing = Literal["marker", "joint", "obstacle"]


@dataclass(frozen=True)
class Highlight:
    """Something in space that is highlighted.

    Attributes
    ----------
    what, number
        A marker or a joint, counted from 1, or an obstacle: the place of its constraint in the list.
    run
        Of which run, for joints and for markers that the robot carries; 0 for what runs share.
    states
        (F,) the state in each frame.
    """

    what: Thing
    number: int
    run: int
    states: States


def highlights_of(runs: Sequence[ReplayRun], frames: Frames) -> list[Highlight]:
    """Everything that is highlighted at all; markers and obstacles by the rows of any run."""
    found: dict[tuple[Thing, int, int], States] = {}
    for k, run in enumerate(runs):
        of_rows = frames.states(run)
        for i, thing in enumerate(things_of(run)):
            if thing is not None and of_rows[:, i].any():
                carried = thing[0] == "marker" and run.setup.scene.camera.fixed is not None
                key = (*thing, k if thing[0] == "joint" or carried else 0)
                found[key] = np.maximum(found.get(key, np.zeros(len(frames.t), dtype=np.uint8)), of_rows[:, i])
    return [Highlight(*key, of_thing) for key, of_thing in found.items()]


def things_of(run: ReplayRun) -> list[tuple[Thing, int] | None]:
    """(m,) what each row is about: a marker, a joint or an obstacle, with its number; None if it is none of them."""
    blocks = run.setup.constraints.blocks()
    owners = chain.from_iterable([k] * count for k, (_, count, _) in enumerate(blocks))
    return [_thing(run, label, owner) for label, owner in zip(run.setup.constraints.labels, owners, strict=True)]


def _thing(run: ReplayRun, label: str, owner: int) -> tuple[Thing, int] | None:
    if run.setup.constraints.constraints[owner].meshes(0.0, 1.0):
        return "obstacle", owner
    named = re.search(r"(marker|joint) (\d+)\]", label)
    if named is None:
        return None
    what: Thing = "marker" if named[1] == "marker" else "joint"
    number, count = int(named[2]), len(run.setup.scene.markers) if what == "marker" else run.setup.scene.robot.n
    return (what, number) if number <= count else None
