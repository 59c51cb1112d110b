"""Summary of a run in a study: scores and coarse trajectories, small enough for other processes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons.metrics import score
from ...comparisons.record import RunRecord
from ...comparisons.run import Run
from ...comparisons.runs.files import read_arrays
from ...control import ControlStep
from ...controllers.least_norm import RANK_TOLERANCE, track
from ...errors import SceneError
from ...rows import Array

#: Interval of stored trajectories [s], and greatest number of samples; longer runs have a greater
#: interval.
GRID = 0.02
MAX_SAMPLES = 1000


@dataclass(frozen=True)
class RunSummary:
    """Summary of one run of a study."""

    status: str  #: Status at the end.
    reason: str  #: Reason, if not converged.
    #: Line of results.csv (:class:`vsconstraints.comparisons.metrics.Score`).
    result: Mapping[str, Any] = field(default_factory=dict)
    #: By row label, line of constraints.csv, with u⁺ as ``switching_gain``, and the scale.
    rows: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    Ts: float = np.nan  #: Sampling time [s].
    #: Times (T,) of the following arrays [s].
    t: Array = field(default_factory=lambda: np.empty(0))
    q: Array = field(default_factory=lambda: np.empty((0, 0)))  #: Joint positions (T, n).
    #: Clearance (T, m) of each row, as a fraction of its characteristic length.
    clearance: Array = field(default_factory=lambda: np.empty((0, 0)))
    #: Markers (T, M, 2) relative to the image's centre [px].
    pixels: Array = field(default_factory=lambda: np.empty((0, 0, 2)))
    #: Greatest Σ max(L_fφᵢ, 0) over the active rows in any sample: the bound (12) on u⁺.
    needed_gain: float = np.nan
    #: Greatest L_fφ + L_gφ q̈ of tracking in the last sample before a row becomes active, which
    #: moves φ past zero.
    entry_push: float = np.nan
    phi_max: float = np.nan  #: Greatest φ of any row.
    #: Greatest number of consecutive samples with φ ≥ 0, of any row; 0 if none was active.
    longest_run: int = 0
    qd: Array = field(default_factory=lambda: np.empty((0, 0)))  #: Joint speeds (T, n).

    @property
    def ended_early(self) -> bool:
        """True if the run failed or was aborted."""
        return self.status in ("failed", "aborted")

    @classmethod
    def load(cls, path: Path) -> RunSummary | None:
        """Read a file; None if it is missing or damaged."""
        with suppress(Exception):  # a damaged file can raise anything
            return cls(**read_arrays(path))
        return None

    def value(self, column: str) -> float:
        """Return a number of :attr:`result`; NaN if the run has none."""
        return float(self.result.get(column, np.nan))


NOT_RUN = RunSummary("failed", "not run")  #: Placeholder for a missing run.


def summarise(run: Run, baseline: RunRecord | None, *, drift_noted: bool = False) -> RunSummary:
    """Summarise a run.

    The unconstrained baseline on the same scenario, if given, determines the challenged rows.
    """
    record = run.record
    moved = run.trajectory
    scored = score(record, baseline)
    if not len(moved.t):
        return RunSummary(moved.status, moved.reason, scored.result)
    t = np.arange(0.0, moved.t[-1] + 1e-9, max(GRID, moved.t[-1] / MAX_SAMPLES))
    fine = {
        "q": moved.q,
        "clearance": moved.clearance / record.length,
        "pixels": moved.features_px,
        "qd": moved.qd,
    }
    coarse: dict[str, Any] = {
        name: _at(t, moved.t, values).astype(np.float32) for name, values in fine.items()
    }
    switching_gains = record.switching_gain.tolist()
    scales = run.setup.constraints.scale.tolist()
    rows = {}
    longest = 0
    for row, gain, scale in zip(scored.constraints, switching_gains, scales, strict=True):
        rows[str(row["constraint"])] = {**row, "switching_gain": gain, "scale": scale}
        longest = max(longest, round(row["longest_positive_run_s"] / record.Ts))
    noted: dict[str, Any] = gains(run) if drift_noted else {}
    return RunSummary(
        moved.status,
        moved.reason,
        scored.result,
        rows,
        Ts=record.Ts,
        t=t,
        phi_max=float(moved.phi.max(initial=-np.inf)),
        longest_run=longest,
        **noted,
        **coarse,
    )


def joint_distance(a: RunSummary, b: RunSummary) -> float:
    """Root mean square over time of ‖q − q'‖ between two runs [rad or m].

    It covers the time that both runs have.
    """
    return _rms(_difference(a, b, "q"))


def clearance_distance(a: RunSummary, b: RunSummary) -> float:
    """Root mean square over time and rows of the difference of clearances.

    Clearances are fractions of each row's length.
    """
    return _rms(_difference(a, b, "clearance")) / math.sqrt(max(a.clearance.shape[1], 1))


def pixel_distance(a: RunSummary, b: RunSummary) -> float:
    """Greatest distance of a marker between two runs at the same time [px]."""
    apart = _difference(a, b, "pixels")
    return float(np.linalg.norm(apart, axis=2).max()) if apart.size else math.nan


def speed_difference(a: RunSummary, b: RunSummary) -> tuple[float, float]:
    """Greatest difference of a joint speed, relative to the other run's greatest; and RMS ratio."""
    apart = _difference(a, b, "qd")
    reference = b.qd
    if not len(apart) or not reference.any():
        return math.nan, math.nan
    rms = math.sqrt(float((apart**2).mean()) / float((reference**2).mean()))
    return float(np.abs(apart).max() / np.abs(reference).max()), rms


def _rms(differences: Array) -> float:
    return float(np.sqrt((differences**2).sum(axis=1).mean())) if len(differences) else math.nan


def _difference(a: RunSummary, b: RunSummary, name: str) -> Array:
    """Differences of an array at the times of ``a`` that ``b`` also reached; may be empty."""
    t = a.t[a.t <= b.t[-1]] if len(a.t) and len(b.t) else np.empty(0)
    if not len(t):
        return np.empty((0, 0, 2))
    return _at(t, a.t, getattr(a, name)) - _at(t, b.t, getattr(b, name))


def _at(t: Array, times: Array, values: Array) -> Array:
    """Values (N, ...) at other times, by linear interpolation."""
    columns = values.reshape(len(times), -1).T
    interpolated = np.array([np.interp(t, times, column) for column in columns])
    return interpolated.T.reshape(len(t), *values.shape[1:])


def gains(run: Run) -> dict[str, float]:
    """``needed_gain`` and ``entry_push`` of :class:`RunSummary`, along a motion.

    They are computed from the controller's model. Gradient errors and sensor disturbances are left
    out. Without an active row the result is empty.
    """
    active = run.trajectory.phi >= 0.0
    if not active.any():
        return {}
    entered = np.zeros_like(active)
    entered[:-1] = active[1:] & ~active[:-1]
    step = ControlStep(run.setup.scene, run.setup.constraints, run.setup.task)
    step.reset()
    needed = 0.0
    push = []
    with suppress(SceneError):  # the sample at which a run failed
        for k, t in enumerate(run.t):
            now = step.evaluate(float(t), run.trajectory.q[k], run.trajectory.qd[k])
            needed = max(needed, float(np.maximum(now.rows.Lf[active[k]], 0.0).sum()))
            if entered[k].any():
                moved = now.rows.Lf + now.rows.Lg @ track(now.task, RANK_TOLERANCE)
                push.append(float(moved[entered[k]].max()))
    return {"needed_gain": needed, "entry_push": max(push, default=math.nan)}
