"""Rows, events and phases of the case study, for claims and figures."""

from __future__ import annotations

import numpy as np

from ..comparisons.run import MERGE, Run
from ..rows import BoolArray
from ..simulation import intervals

Intervals = list[tuple[float, float]]  #: First and last time of each interval [s].

SPHERE = "sphere[tip]"
RANGE = "range[joint 6]"
SPEED = "speed[joint 2]"
BORDERS = tuple(f"fov[marker {i}]" for i in (1, 2, 3, 4))
#: Events with a line in Fig. 11; a range or a speed is one line for both of its sides.
EVENTS = (*BORDERS, RANGE, SPEED, SPHERE)


def switch_sample(run: Run) -> int:
    """Return the first sample of the second phase, in which the second goal holds."""
    return int(np.searchsorted(run.t, run.setup.task.goals[1].from_time - 1e-9))


def active_of(run: Run, event: str) -> BoolArray:
    """Mask (N,) of the samples in which φ of any row of an event is at or above zero."""
    rows = [run.index(label) for label in run.labels(event)]
    is_active = run.trajectory.phi[:, rows] >= 0.0
    return np.asarray(is_active.any(axis=1))


def phases(run: Run, event: str) -> tuple[Intervals, Intervals]:
    """Return the intervals of activity of an event's rows in the first and in the second phase."""
    k = switch_sample(run)
    active = active_of(run, event)
    first_phase = intervals(run.t[:k], active[:k], MERGE)
    second_phase = intervals(run.t[k:], active[k:], MERGE)
    return first_phase, second_phase


def active_spans(run: Run, event: str) -> Intervals:
    """Return the intervals of activity of an event's rows in both phases."""
    first, second = phases(run, event)
    return first + second


def at_once(run: Run) -> np.ndarray:
    """Number (N,) of events that are active at a time, by their intervals."""
    count = np.zeros(len(run.t), dtype=np.int64)
    for event in EVENTS:
        for first, last in active_spans(run, event):
            count += (run.t >= first) & (run.t <= last)
    return count
