"""How near rows come to their boundary, how far beyond it they are, and for how long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rows import Array, BoolArray
from ..record import RunRecord

NEGLIGIBLE = 1e-4
"""Depth, as a fraction of the characteristic length, up to which a row is not violated: the strict standard.

A controller that holds a row on its boundary is off by the curvature inside a sampling period: some 1e-5. No law's own
gain enters: what T_s u⁺ (43) explains is violated all the same.
"""

TOLERANT = 1e-2
"""The same of the tolerant standard, which is about what cameras and arms resolve."""

TOLERANCES = (NEGLIGIBLE, 1e-3, TOLERANT, 2e-2, 5e-2, 1e-1)
"""Where reports show how success grows with the depth that is tolerated."""


@dataclass(frozen=True)
class Clearances:
    """Clearances of a run with N samples and m rows.

    Attributes
    ----------
    least
        (m,) of the whole run; NaN without samples.
    violated
        (m,) depth of the rows that are violated by the strict standard; 0 of the others.
    within_band
        (m,) the same of those that were never deeper than their sampling band; 0 of the others.
    outside
        (N, m) periods in which a row is as deep outside as violated ones are.
    """

    least: Array
    violated: Array
    within_band: Array
    outside: BoolArray


def clearances(record: RunRecord) -> Clearances:
    """Clearances of a run, at samples and between them."""
    run, slight = record.trajectory, NEGLIGIBLE * record.length
    in_period = np.minimum(run.clearance, run.between_clearance)
    least = in_period.min(axis=0) if len(run.t) else np.full(len(run.labels), np.nan)
    depth = np.where(least < -slight, -least, 0.0)
    return Clearances(least, depth, np.where(depth > record.sampling_band, 0.0, depth), in_period < -slight)


def fractions(record: RunRecord, found: Clearances) -> Array:
    """(m,) greatest depth of each row as a fraction of its characteristic length; 0 where it was never outside."""
    depth: Array = np.fmax(-found.least / record.length, 0.0)
    return depth


def named(labels: tuple[str, ...], depth: Array) -> str:
    """Labels of the rows with a depth (m,), separated by semicolons."""
    return "; ".join(labels[i] for i in np.flatnonzero(depth > 0.0))


def outside_alone(record: RunRecord, baseline: RunRecord | None) -> BoolArray:
    """(T, m) sampling periods in which the baseline, unconstrained tracking, is outside, of the T that it lasts.

    No period without it, or if its rows are others.
    """
    if baseline is None or baseline.trajectory.labels != record.trajectory.labels:
        return np.zeros((0, len(record.trajectory.labels)), dtype=np.bool_)
    return clearances(baseline).outside


def mean_while(values: Array, when: BoolArray) -> Array:
    """(m,) mean of values (N, m) over the samples in which a flag (T, m) is set, of those that both have; else NaN."""
    common = min(len(values), len(when))
    count = when[:common].sum(axis=0)
    total = np.where(when[:common], values[:common], 0.0).sum(axis=0)
    mean: Array = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    return mean


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
    """Mean usage (N, m) over all rows and samples in which the baseline is outside (T, m), while both runs last.

    NaN where the goal is not reached, or the baseline is never outside.
    """
    common = min(len(used), len(when))
    if record.trajectory.status != "converged" or not when[:common].any():
        return float("nan")
    return float(used[:common][when[:common]].mean())
