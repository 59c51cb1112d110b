"""How near rows come to their boundary, how far beyond it they are, and for how long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rows import Array, BoolArray
from ..record import RunRecord

NEGLIGIBLE = 1e-4
"""Depth, as a fraction of the characteristic length, up to which a row does not count as outside.

A controller that holds a row on its boundary is off by the curvature inside a sampling period: some 1e-5.
"""


@dataclass(frozen=True)
class Clearances:
    """Clearances of a run with N samples and m rows.

    Attributes
    ----------
    least
        (m,) of the whole run; NaN without samples.
    violated, within_band
        (m,) depth of what is outside, beyond what sampling makes and not beyond it; 0 where the row is not.
    outside
        (N, m) periods in which a row is as deep outside as violated ones are.
    """

    least: Array
    violated: Array
    within_band: Array
    outside: BoolArray


def tolerated(record: RunRecord) -> Array:
    """(m,) depth from which on a row counts as violated."""
    depth: Array = np.maximum(NEGLIGIBLE * record.length, record.sampling_band)
    return depth


def clearances(record: RunRecord) -> Clearances:
    """Clearances of a run, at samples and between them."""
    run, slight, most = record.trajectory, NEGLIGIBLE * record.length, tolerated(record)
    in_period = np.minimum(run.clearance, run.between_clearance)
    least = in_period.min(axis=0) if len(run.t) else np.full(len(run.labels), np.nan)
    depth = np.where(least < -slight, -least, 0.0)
    beyond = depth > most
    return Clearances(least, np.where(beyond, depth, 0.0), np.where(beyond, 0.0, depth), in_period < -most)


def named(labels: tuple[str, ...], depth: Array) -> str:
    """Labels of the rows with a depth (m,), separated by semicolons."""
    return "; ".join(labels[i] for i in np.flatnonzero(depth > 0.0))


def challenged(record: RunRecord, baseline: RunRecord | None) -> BoolArray:
    """(m,) rows that the baseline, tracking alone, is outside of; none without it, or if its rows are others."""
    if baseline is None or baseline.trajectory.labels != record.trajectory.labels:
        return np.zeros(len(record.trajectory.labels), dtype=np.bool_)
    theirs = clearances(baseline)
    hit: BoolArray = theirs.violated + theirs.within_band > 0.0
    return hit


def unused_margin(record: RunRecord, baseline: RunRecord | None) -> Array:
    """(m,) mean clearance, where positive, over the samples in which the baseline is outside; NaN where it never is."""
    run, m = record.trajectory, len(record.trajectory.labels)
    nothing = np.full(m, np.nan)
    if baseline is None or baseline.trajectory.labels != run.labels:
        return nothing
    common = min(len(run.t), len(baseline.trajectory.t))
    outside = baseline.trajectory.clearance[:common] < 0.0
    margin = np.where(outside, np.maximum(run.clearance[:common], 0.0), 0.0)
    count = outside.sum(axis=0)
    mean: Array = np.divide(margin.sum(axis=0), count, out=nothing, where=count > 0)
    return mean
