"""The frames that a replay shows, which constraints are active or violated in each, and what is highlighted then."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...rows import Array
from .runs import ReplayRun

RATE, MAX_FRAMES = 25.0, 300
"""Frames per second of time, unless that makes more frames than so many."""

INACTIVE, ACTIVE, VIOLATED = 0, 1, 2
"""States of a constraint's row."""

HIGHLIGHTS = {ACTIVE: "#F0A202", VIOLATED: "#D1102A"}
"""Their colours."""

States = npt.NDArray[np.uint8]
Thing = tuple[str, int] | None
"""What a row is about: a marker, a joint or an obstacle, with its number; None if it is none of them."""


@dataclass(frozen=True)
class Frames:
    """Instants t (F,), ``period`` apart [s], from the start to the end of the longest run."""

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
        shown = np.searchsorted(run.trajectory.t, self.t + 1e-9, side="right") - 1
        return np.maximum(shown, 0).astype(np.int64)

    def states(self, run: ReplayRun) -> States:
        """(F, m) the state of each row between one instant and the next: a single sample is enough to show it.

        A run that is over shows none: nothing after the frame that is the first to show its last sample.
        """
        every, first = states(run), self.samples(run)
        shown = np.maximum.reduceat(every, first, axis=0)
        shown[1:][first[:-1] == len(every) - 1] = INACTIVE
        return shown

    def remark(self, runs: Sequence[ReplayRun]) -> str:
        """What of the runs is shown, in a sentence."""
        samples = max(len(run.trajectory.t) for run in runs)
        rule = "a constraint is highlighted if it is active or violated in any sample up to the next one shown"
        return f"{len(self.t)} of {samples} samples are shown; {rule}." if samples > len(self.t) else ""


def states(run: ReplayRun) -> States:
    """(N, m) the state of each row at each sample."""
    length = RunRecord.of(run.setup, run.trajectory, "").length
    outside = np.minimum(run.trajectory.clearance, run.trajectory.between_clearance) < -NEGLIGIBLE * length
    return np.where(outside, VIOLATED, np.where(run.trajectory.active, ACTIVE, INACTIVE)).astype(np.uint8)


class Highlight(NamedTuple):
    """Something in space that is highlighted: a ``marker`` or a ``joint``, counted from 1, or an ``obstacle``.

    An obstacle's number is the place of its constraint in the list; ``run`` is 0 for what runs share; ``states`` (F,)
    are those in each frame.
    """

    what: str
    number: int
    run: int
    states: States


def highlights_of(runs: Sequence[ReplayRun], frames: Frames) -> list[Highlight]:
    """Everything that is highlighted at all; markers and obstacles by the rows of any run."""
    found: dict[tuple[str, int, int], States] = {}
    for k, run in enumerate(runs):
        for thing, own in zip(things_of(run), frames.states(run).T, strict=True):
            if thing is not None and own.any():
                carried = thing[0] == "marker" and run.setup.scene.camera.fixed is not None
                key = (*thing, k if thing[0] == "joint" or carried else 0)
                found[key] = np.maximum(found.get(key, INACTIVE), own).astype(np.uint8)
    return [Highlight(*key, own) for key, own in found.items()]


def things_of(run: ReplayRun) -> list[Thing]:
    """(m,) what each row is about."""
    constraints, scene = run.setup.constraints, run.setup.scene
    counts = {"marker": len(scene.markers), "joint": scene.robot.n}
    solid = [bool(constraint.meshes(0.0, 1.0)) for constraint in constraints.constraints]
    owners = [k for k, (_, count, _) in enumerate(constraints.blocks()) for _ in range(count)]
    things: list[Thing] = []
    for label, owner in zip(constraints.labels, owners, strict=True):
        named = re.search(r"(marker|joint) (\d+)\]", label)
        if solid[owner]:
            things.append(("obstacle", owner))
        else:
            known = named is not None and int(named[2]) <= counts[named[1]]
            things.append((named[1], int(named[2])) if named is not None and known else None)
    return things
