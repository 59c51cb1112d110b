"""How much of the allowed space is used: while tracking alone is outside, and while a row holds the arm back."""

from __future__ import annotations

import numpy as np

from ...rows import Array, BoolArray
from ..record import RunRecord

STEPS = 2.0
"""While φ is no farther below zero than so many switching steps T_s u⁺, a row that acts before and after holds on."""


def held(record: RunRecord) -> BoolArray:
    """(N, m) when each row holds the arm back: it acts or, in a sliding mode, acts before and after."""
    active, phi = record.trajectory.active, record.trajectory.phi
    closed = active.copy()
    steps = record.Ts * record.switching_gain
    for i in np.flatnonzero(active.any(axis=0)):
        at, step = np.flatnonzero(active[:, i]), steps[i]
        # where it acts in the sample after, nothing lies in between
        for begin, end in ((at[k], at[k + 1]) for k in np.flatnonzero(np.diff(at) > 1)):
            if phi[begin:end, i].min() >= -STEPS * step:
                closed[begin:end, i] = True
    return closed


def first_active(t: Array, active: BoolArray) -> Array:
    """(m,) when each row acts (N, m) for the first time [s]; NaN where it never does."""
    first: Array = np.where(active.any(axis=0), t[active.argmax(axis=0)], np.nan)
    return first


def usage_at_speed(record: RunRecord) -> Array:
    """(N, m) 1 − (c + K ċ)/L, from 0 to 1, of clearances c: usage of what is left at the speed at which it is used up.

    It is 1 where the arm may come no faster, as φ = σ + K σ̇ = 0 says of it, and so does not mark down the approach to a
    boundary. Of a speed, which has no K, it is the usage.
    """
    c = record.trajectory.clearance
    if len(c) < 2:
        return np.zeros(c.shape)
    with np.errstate(invalid="ignore"):
        left = c + record.approach_time * np.gradient(c, record.Ts, axis=0)
        usage = np.clip(1.0 - left / record.length, 0.0, 1.0)
    # where there is no boundary in sight, nothing of the space is used
    return np.nan_to_num(usage)


def usage(record: RunRecord) -> Array:
    """(N, m) 1 − c/L, from 0 to 1, of clearances c; 0 where there is no boundary in sight."""
    used: Array = np.clip(np.nan_to_num(1.0 - record.trajectory.clearance / record.length), 0.0, 1.0)
    return used


def utilization(record: RunRecord, used: Array, when: BoolArray) -> float:
    """Mean usage (N, m) over all rows and samples in which tracking alone is outside (T, m), while both runs last.

    NaN where the goal is not reached, or tracking alone is never outside.
    """
    common = min(len(used), len(when))
    if record.trajectory.status != "converged" or not when[:common].any():
        return float("nan")
    return float(used[:common][when[:common]].mean())
