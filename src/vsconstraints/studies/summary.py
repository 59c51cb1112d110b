"""What a study keeps of a run: its scores and coarse trajectories, small enough to hand between processes."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..comparisons.metrics import score
from ..comparisons.record import RunRecord
from ..rows import Array
from ..runs.files import replaced
from .recorder import DriftRecorder

GRID = 0.02
"""Trajectories are kept at these intervals [s]."""

MOST_POINTS = 1000
"""Long runs are kept at greater intervals, so that there are no more points than this."""


@dataclass(frozen=True)
class RunSummary:
    """One run of a study.

    Attributes
    ----------
    status, reason
        How it ended, and why if not converged.
    result
        Its line of results.csv (:class:`vsconstraints.comparisons.metrics.Score`).
    rows
        By row label, its line of constraints.csv, its u⁺ as ``switching_gain``, and its scale.
    Ts
        Sampling time [s].
    t
        (T,) times of what follows [s].
    q
        (T, n) joint positions.
    clearance
        (T, m) clearance of each row as a fraction of its characteristic length.
    pixels
        (T, M, 2) markers from the image's centre [px].
    needed_gain
        Greatest Σ max(L_fφᵢ, 0) over the active rows in any sample: the bound (12) on u⁺.
    return_gain
        Greatest L_fφ + φ/T_s over the samples in which a row has just become active: the u⁺ with which φ would be
        back below zero after one sample.
    entry_push
        Greatest L_fφ + L_gφ q̈ of tracking in the last sample before a row becomes active: what moves φ past zero.
    phi_max
        Greatest φ of any row.
    longest_run
        Most samples in a row with φ ≥ 0, of any row; 0 if none was active.
    qd
        (T, n) joint speeds.
    """

    status: str
    reason: str
    result: dict[str, Any] = field(default_factory=dict)
    rows: dict[str, dict[str, Any]] = field(default_factory=dict)
    Ts: float = np.nan
    t: Array = field(default_factory=lambda: np.empty(0))
    q: Array = field(default_factory=lambda: np.empty((0, 0)))
    clearance: Array = field(default_factory=lambda: np.empty((0, 0)))
    pixels: Array = field(default_factory=lambda: np.empty((0, 0, 2)))
    needed_gain: float = np.nan
    return_gain: float = np.nan
    entry_push: float = np.nan
    phi_max: float = np.nan
    longest_run: int = 0
    qd: Array = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def carried_through(self) -> bool:
        """Whether the run went on to its end."""
        return self.status in ("converged", "trapped", "unfinished")

    def save(self, path: Path) -> None:
        """Write the file whole or not at all."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        arrays: dict[str, Any] = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
        facts = {name: value for name, value in values.items() if name not in arrays}
        with replaced(path) as part, part.open("wb") as file:
            np.savez(file, facts=np.array(json.dumps(facts, default=lambda number: number.item())), **arrays)

    @classmethod
    def load(cls, path: Path) -> RunSummary | None:
        """What the file holds; None if there is none, or it is damaged."""
        try:
            with path.open("rb") as file, np.load(file) as stored:
                arrays = {name: stored[name] for name in stored.files}
            return cls(**json.loads(str(arrays.pop("facts"))), **arrays)
        except Exception:  # a damaged file can raise anything
            return None

    def value(self, column: str) -> float:
        """A number of :attr:`result`; NaN if the run has none."""
        return float(self.result.get(column, np.nan))


def summarise(
    record: RunRecord, baseline: RunRecord | None, recorder: DriftRecorder | None, scales: Array
) -> RunSummary:
    """The summary of a run.

    Parameters
    ----------
    record
        The run.
    baseline
        Tracking alone on the same scenario, which tells the challenged rows; None if it failed.
    recorder
        What noted the drift of φ during the run; None if nothing did.
    scales
        (m,) size of each row's allowed range in units of φ.
    """
    run, N = record.trajectory, len(record.trajectory.t)
    scored = score(record, baseline)
    if N == 0:
        return RunSummary(run.status, run.reason, scored.result)
    t = np.arange(0.0, run.t[-1] + 1e-9, max(GRID, run.t[-1] / MOST_POINTS))
    relative = run.clearance / record.length
    return RunSummary(
        run.status,
        run.reason,
        scored.result,
        {
            str(row["constraint"]): {**row, "switching_gain": float(gain), "scale": float(scale)}
            for row, gain, scale in zip(scored.constraints, record.switching_gain, scales, strict=True)
        },
        record.Ts,
        t,
        _on_grid(t, run.t, run.q),
        _on_grid(t, run.t, relative),
        _on_grid(t, run.t, run.features_px.reshape(N, -1)).reshape(len(t), -1, 2),
        **(_gains(run.phi, recorder.drift(N), recorder.push(N), record.Ts) if recorder else {}),
        phi_max=float(run.phi.max(initial=-np.inf)),
        longest_run=max((round(row["longest_positive_run_s"] / record.Ts) for row in scored.constraints), default=0),
        qd=_on_grid(t, run.t, run.qd),
    )


def _on_grid(t: Array, times: Array, values: Array) -> Array:
    """Values (N, n) at other times, by linear interpolation, in single precision."""
    columns = [np.interp(t, times, column) for column in values.T]
    return np.array(columns, dtype=np.float64).reshape(len(columns), len(t)).T.astype(np.float32)


def joint_distance(one: RunSummary, other: RunSummary) -> float:
    """Root mean square over time of ‖q − q'‖ between two runs [rad or m], over the time both have."""
    return _rms(one, other, one.q, other.q)


def clearance_distance(one: RunSummary, other: RunSummary) -> float:
    """Root mean square over time and rows of the difference of clearances, as a fraction of each row's length."""
    return _rms(one, other, one.clearance, other.clearance) / math.sqrt(max(one.clearance.shape[1], 1))


def pixel_distance(one: RunSummary, other: RunSummary) -> float:
    """Greatest distance of a marker between two runs at the same time [px]."""
    t = _common(one, other)
    if not len(t) or not one.pixels.size:
        return float("nan")
    return float(np.linalg.norm(_at(t, one.t, one.pixels) - _at(t, other.t, other.pixels), axis=2).max())


def speed_difference(one: RunSummary, other: RunSummary) -> tuple[float, float]:
    """How joint speeds differ: the greatest difference of one, as a share of the other run's greatest; and both RMS."""
    t = _common(one, other)
    if not len(t) or not other.qd.any():
        return float("nan"), float("nan")
    apart, reference = _at(t, one.t, one.qd) - _at(t, other.t, other.qd), other.qd
    rms = math.sqrt(float((apart**2).mean()) / float((reference**2).mean()))
    return float(np.abs(apart).max() / np.abs(reference).max()), rms


def _rms(one: RunSummary, other: RunSummary, values: Array, theirs: Array) -> float:
    t = _common(one, other)
    if not len(t):
        return float("nan")
    return float(np.sqrt(((_at(t, one.t, values) - _at(t, other.t, theirs)) ** 2).sum(axis=1).mean()))


def _common(one: RunSummary, other: RunSummary) -> Array:
    """Times of ``one`` that ``other`` has reached too."""
    return one.t[one.t <= other.t[-1]] if len(one.t) and len(other.t) else np.empty(0)


def _at(t: Array, times: Array, values: Array) -> Array:
    flat = values.reshape(len(times), -1)
    return np.array([np.interp(t, times, column) for column in flat.T]).T.reshape(len(t), *values.shape[1:])


def _gains(phi: Array, drift: Array, push: Array, Ts: float) -> dict[str, float]:
    active = phi >= 0.0
    if not active.any():
        return {}
    needed = np.where(active, np.maximum(drift, 0.0), 0.0).sum(axis=1)
    entered = np.zeros_like(active)
    entered[1:] = active[1:] & ~active[:-1]
    before = np.zeros_like(active)
    before[:-1] = entered[1:]
    return {
        "needed_gain": float(needed.max()),
        "return_gain": _greatest((drift + phi / Ts)[entered]),
        "entry_push": _greatest(push[before]),
    }


def _greatest(values: Array) -> float:
    return float(values.max()) if values.size else float("nan")
