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
    """(T, m) sampling periods in which the baseline, tracking alone, is outside, of the T that it lasts.

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
