"""How much a run chatters: of φ and of the command."""

from __future__ import annotations

import numpy as np

from ...rows import Array, BoolArray
from ..record import RunRecord

SLIDING_GAP = 10
"""In a sliding mode φ crosses zero again and again: within this many samples, from either side."""

AT_BOUNDARY = 3
"""Samples with φ ≥ 0 from which on a row is at its boundary; fewer only touch it."""


def chattering(record: RunRecord) -> dict[str, float]:
    """Band of φ, switching rate, variation and jerk; NaN for what a run is too short to have."""
    run, Ts = record.trajectory, record.Ts
    N = len(run.t)
    if N < 2:
        names = ("phi_band", "phi_band_bound", "sliding_lost_s", "switching_rate_hz", "acceleration_variation")
        return dict.fromkeys((*names, "jerk_rms"), np.nan)
    bounds = Ts * record.switching_gain
    bands = np.array([_band(phi, bound) for phi, bound in zip(run.phi.T, bounds, strict=True)])
    worst = np.nanargmax(bands / bounds) if np.isfinite(bands).any() else None
    lost = np.any([_lost(phi, bound) for phi, bound in zip(run.phi.T, bounds, strict=True)], axis=0)
    duration = (N - 1) * Ts
    change = np.sqrt((np.diff(run.qdd_command, axis=0) ** 2).sum(axis=1))
    return {
        "phi_band": np.nan if worst is None else float(bands[worst]),
        "phi_band_bound": np.nan if worst is None else float(bounds[worst]),
        "sliding_lost_s": float(lost.sum() * Ts),
        "switching_rate_hz": float((run.active[1:] != run.active[:-1]).any(axis=1).sum() / duration),
        "acceleration_variation": float(change.sum() / duration),
        "jerk_rms": float(np.sqrt((change**2).mean()) / Ts),
    }


def longest_run(flags: BoolArray) -> int:
    """Most flags (N,) in a row."""
    return max((end - begin for begin, end in _runs(flags)), default=0)


def _runs(flags: BoolArray) -> list[tuple[int, int]]:
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
