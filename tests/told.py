"""Made-up runs for the claims: a second long, a sample every 10 ms, T_s u⁺ = 1."""

from __future__ import annotations

from itertools import groupby
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vsconstraints.paper.verdicts import CLAIMS, Finding
from vsconstraints.rows import Array

TS = 0.01
T = TS * np.arange(101)
ROW = "fov[marker 2]"
GAIN = 100.0
"""u⁺, so that T_s u⁺ = 1."""


class Told:
    """What claims ask of a run, of rows and columns that a test writes down. Rows that are not
    given keep their place.

    ``phi``, ``sigma`` and ``clearance`` are numbers or (N,) by label; σ is φ unless it is given.
    """

    def __init__(
        self, phi: Any = None, sigma: Any = None, clearance: Any = None, t: Array = T, **others: Any
    ) -> None:
        self.t = t
        self.sampling_time = float(t[1] - t[0])
        phi = {ROW: -1.0} if phi is None else phi
        names = tuple(phi)

        def columns(values: dict[str, Any]) -> Array:
            return np.column_stack(
                [np.broadcast_to(np.asarray(values[name], dtype=float), t.shape) for name in names]
            )

        given = {"status": "converged", "reason": "", "error": np.zeros((len(t), 6))}
        self.trajectory = SimpleNamespace(
            labels=names,
            phi=columns(phi),
            sigma=columns({**phi, **(sigma or {})}),
            clearance=columns({**dict.fromkeys(names, 0.005), **(clearance or {})}),
            **(given | {key: others.pop(key) for key in list(others) if key in COLUMNS}),
        )
        self.trajectory.active = others.pop("active", self.trajectory.phi >= 0.0)
        self.record = SimpleNamespace(switching_gain=np.full(len(names), GAIN))
        self.drift = np.zeros((len(t), len(names)))
        self.speed: Any = None
        self.settling_time = 1.0
        self.needed = 0.0
        self.K = 0.1
        for name, value in others.items():
            assert hasattr(self, name), name
            setattr(self, name, value)

    def index(self, label: str) -> int:
        return self.trajectory.labels.index(label)

    def labels(self, name: str) -> list[str]:
        return [label for label in self.trajectory.labels if label.startswith(name)]

    def phi(self, label: str) -> Array:
        return self.trajectory.phi[:, self.index(label)]

    def sigma(self, label: str) -> Array:
        return self.trajectory.sigma[:, self.index(label)]

    def positive_samples(self, label: str) -> int:
        return max(
            (len(list(run)) for positive, run in groupby(self.phi(label) >= 0.0) if positive),
            default=0,
        )

    def row(self, label: str) -> dict[str, float]:
        least = float(self.trajectory.clearance[:, self.index(label)].min())
        return {"phi_max": float(self.phi(label).max()), "clearance_min": least}

    def bound(self, label: str) -> float:
        return self.sampling_time * GAIN

    def length(self, label: str) -> float:
        return 1.0

    def unit(self, label: str) -> str:
        return "px"

    def constraint(self, label: str) -> Any:
        return SimpleNamespace(K=self.K)

    def ever_active(self, kind: str = "") -> list[str]:
        return [label for label in self.labels(kind) if (self.phi(label) >= 0.0).any()]

    def active_intervals(self, *labels: str, gap: float = 0.6) -> list[tuple[float, float]]:
        found: list[tuple[float, float]] = []
        for time in self.t[np.any([self.phi(label) >= 0.0 for label in labels], axis=0)]:
            if found and time - found[-1][1] <= gap:
                found[-1] = (found[-1][0], float(time))
            else:
                found.append((float(time), float(time)))
        return found

    def while_sliding(self, label: str) -> Array:
        at = np.flatnonzero(self.phi(label) >= 0.0)
        return self.phi(label)[at[0] : at[-1] + 1]

    def approach_speed(self, label: str) -> Any:
        return self.speed

    def needed_gain(self) -> Array:
        return np.full(len(self.t), self.needed)


COLUMNS = ("status", "reason", "camera_error", "camera_position", "qd", "q", "qdd_command", "features_px", "error",
           "feature_error_px", "step_time", "rows_time", "compiled")  # fmt: skip


def at(values: dict[int, float], otherwise: float = -1.0, t: Array = T) -> Array:
    """(N,) one number everywhere but in some samples."""
    column = np.full(len(t), otherwise)
    for sample, value in values.items():
        column[sample] = value
    return column


def during(*spans: tuple[float, float], t: Array = T, value: float = 0.0) -> Array:
    """(N,) zero, or another number, in some intervals; −1 elsewhere."""
    column = np.full(len(t), -1.0)
    for first, last in spans:
        column[(t >= first - 1e-9) & (t <= last + 1e-9)] = value
    return column


def found(key: str, *runs: Any) -> Finding:
    one = CLAIMS[key]
    return one.check(dict(zip(one.needs, runs, strict=True)))


def verdict(key: str, *runs: Any) -> str:
    of = found(key, *runs)
    assert of.verdict != "not measured", of.text
    return of.verdict


def gives(finding: Finding, verdict: str, **values: float) -> None:
    """What was found is this verdict with these values and no others."""
    assert finding.verdict == verdict, finding.text
    assert finding.values == pytest.approx(values, rel=1e-9, abs=1e-12)


YES = "holds"
PARTLY = "holds partly"
NO = "does not hold"
