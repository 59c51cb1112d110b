"""How much a run chatters: of φ and of the command."""

from __future__ import annotations

import numpy as np

from ...rows import Array, BoolArray
from ..record import RunRecord

SLIDING_GAP = 10
"""In a sliding mode φ crosses zero again and again: within this many samples, from either side."""

AT_BOUNDARY = 3
"""Samples with φ ≥ 0 from which on a row is at its boundary; fewer only touch it."""


def worst_band(record: RunRecord) -> tuple[float, float]:
    """Band of φ and its bound T_s u⁺, of the row in which the one is largest relative to the other; NaN without one."""
    bounds, phi = record.Ts * record.switching_gain, record.trajectory.phi
    bands = np.full(len(bounds), np.nan)
    for i in _reached(phi):
        bands[i] = _band(phi[:, i], bounds[i])
    if len(record.trajectory.t) < 2 or not np.isfinite(bands).any():
        return np.nan, np.nan
    worst = np.nanargmax(bands / bounds)
    return float(bands[worst]), float(bounds[worst])


def sliding_lost(record: RunRecord) -> float:
    """Time for which some row's sliding mode is lost [s]; NaN for a run of one sample."""
    run, bounds = record.trajectory, record.Ts * record.switching_gain
    lost = np.zeros(len(run.t), dtype=np.bool_)
    for i in _reached(run.phi):
        lost |= _lost(run.phi[:, i], bounds[i])
    return float(lost.sum() * record.Ts) if len(run.t) > 1 else np.nan


def switching_rate(record: RunRecord) -> float:
    """Changes of the active set per second of the scenario's duration [Hz]; NaN for a run of one sample."""
    active = record.trajectory.active[: record.common]
    changes = (active[1:] != active[:-1]).any(axis=1)
    return float(changes.sum() / (len(changes) * record.Ts)) if len(changes) else np.nan


def variation(record: RunRecord) -> float:
    """Σ‖Δq̈_c‖ per second of the scenario's duration; NaN for a run of one sample."""
    change = _changes(record)
    return float(change.sum() / (len(change) * record.Ts)) if len(change) else np.nan


def jerk_rms(record: RunRecord) -> float:
    """Root mean square of ‖Δq̈_c‖ / T_s; NaN for a run of one sample."""
    change = _changes(record)
    return float(np.sqrt((change**2).mean()) / record.Ts) if len(change) else np.nan


def _changes(record: RunRecord) -> Array:
    """‖Δq̈_c‖ within the scenario's duration: a run that takes longer is not calmer for it."""
    change: Array = np.sqrt((np.diff(record.trajectory.qdd_command[: record.common], axis=0) ** 2).sum(axis=1))
    return change


def longest_positive_runs(record: RunRecord) -> Array:
    """(m,) longest time with φ ≥ 0 of each row [s]."""
    phi = record.trajectory.phi
    longest = np.zeros(phi.shape[1])
    for i in _reached(phi):
        longest[i] = longest_run(phi[:, i] >= 0.0) * record.Ts
    return longest


def longest_run(flags: BoolArray) -> int:
    """Most flags (N,) in a row."""
    return max((end - begin for begin, end in _runs(flags)), default=0)


def _reached(phi: Array) -> list[int]:
    """Indices of the rows whose φ (N, m) is ever at or above zero."""
    rows: list[int] = np.flatnonzero((phi >= 0.0).any(axis=0)).tolist()
    return rows


def _runs(flags: BoolArray) -> list[tuple[int, int]]:
    if not flags.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _band(phi: Array, bound: float) -> float:
    """Greatest extent of φ (N,) and zero while the row is at its boundary; NaN if it never is."""
    at = np.flatnonzero(phi >= 0.0)
    bands = []
    for interval in np.split(at, np.flatnonzero(np.diff(at) > SLIDING_GAP) + 1) if len(at) else ():
        span = phi[interval[0] : interval[-1] + 1]
        if len(interval) >= AT_BOUNDARY or span.max() > bound:
            bands.append(float(span.max() - min(span.min(), 0.0)))
    return max(bands, default=float("nan"))


def _lost(phi: Array, bound: float) -> BoolArray:
    """(N,) when φ stays at or above zero for longer than a sliding mode does, beyond its bound."""
    lost = np.zeros(len(phi), dtype=np.bool_)
    for begin, end in _runs(phi >= 0.0):
        if end - begin > SLIDING_GAP and phi[begin:end].max() > bound:
            lost[begin:end] = True
    return lost
