"""Made-up runs for the claims of the paper, and the rows of the tables that judge them.

A run lasts one second with a sample every 10 ms, and T_s u⁺ = 1.
"""

from __future__ import annotations

from itertools import groupby
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from vsconstraints.paper.claims import CLAIMS
from vsconstraints.paper.verdicts import Finding
from vsconstraints.rows import Array

TS = 0.01
T = TS * np.arange(101)
TWELVE_SECONDS = 0.1 * np.arange(121)
"""Time stamps with T_s = 0.1 s, so that T_s u⁺ = 10."""

ROW = "fov[marker 2]"
GAIN = 100.0
"""u⁺, so that T_s u⁺ = 1."""

HOLDS = "holds"
PARTLY = "holds partly"
FAILS = "does not hold"
NOT_MEASURED = "not measured"

COLUMNS = (
    "status",
    "reason",
    "camera_error",
    "camera_position",
    "qd",
    "q",
    "qdd_command",
    "features_px",
    "error",
    "feature_error_px",
    "step_time",
    "rows_time",
    "compiled",
)
"""Columns of a trajectory that a made-up run may have."""


class MadeRun:
    """The part of a run that claims read, from columns that a test states.

    ``phi``, ``sigma`` and ``clearance`` are numbers or (N,) by label. σ equals φ unless it is
    given, and the clearance is 0.005. Further arguments are columns of the trajectory, or
    attributes of this class.
    """

    def __init__(
        self,
        phi: Any = None,
        sigma: Any = None,
        clearance: Any = None,
        t: Array = T,
        **others: Any,
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
        given |= {name: others.pop(name) for name in list(others) if name in COLUMNS}
        self.trajectory = SimpleNamespace(
            labels=names,
            phi=columns(phi),
            sigma=columns({**phi, **(sigma or {})}),
            clearance=columns({**dict.fromkeys(names, 0.005), **(clearance or {})}),
            **given,
        )
        self.trajectory.active = others.pop("active", self.trajectory.phi >= 0.0)
        self.record = SimpleNamespace(switching_gain=np.full(len(names), GAIN))
        self.drift = np.zeros((len(t), len(names)))
        self.speed: Any = None  # towards the boundary: (N,), or (N,) by label
        self.settling_time = 1.0
        self.needed = 0.0
        self.needed_shares: Any = None  # (N,) of u⁺
        self.K = 0.1
        self.bounds: dict[str, float] = {}
        self.lengths: dict[str, float] = {}
        self.setup: Any = None
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
        lengths = [
            len(list(samples)) for positive, samples in groupby(self.phi(label) >= 0.0) if positive
        ]
        return max(lengths, default=0)

    def row(self, label: str) -> dict[str, float]:
        least = float(self.trajectory.clearance[:, self.index(label)].min())
        return {"phi_max": float(self.phi(label).max()), "clearance_min": least}

    def bound(self, label: str) -> float:
        return self.bounds.get(label, self.sampling_time * GAIN)

    def length(self, label: str) -> float:
        return self.lengths.get(label, 1.0)

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
        active = np.flatnonzero(self.phi(label) >= 0.0)
        return self.phi(label)[active[0] : active[-1] + 1]

    def approach_speed(self, label: str) -> Any:
        return self.speed[label] if isinstance(self.speed, dict) else self.speed

    def needed_gain(self) -> Array:
        return np.full(len(self.t), self.needed)

    def needed_share(self) -> Array:
        return self.needed_shares


def column(values: dict[int, float], otherwise: float = -1.0, t: Array = T) -> Array:
    """(N,) one number in all samples but these."""
    result = np.full(len(t), otherwise)
    for sample, value in values.items():
        result[sample] = value
    return result


def active_during(*spans: tuple[float, float], t: Array = T) -> Array:
    """(N,) zero within these intervals [s], −1 elsewhere."""
    result = np.full(len(t), -1.0)
    for first, last in spans:
        result[(t >= first - 1e-9) & (t <= last + 1e-9)] = 0.0
    return result


def camera_errors(position: Any = 0.0, angle: Any = 0.0, t: Array = T) -> Array:
    """(N, 2) position and orientation error of the camera."""
    return np.column_stack([np.broadcast_to(values, t.shape) for values in (position, angle)])


class Expected(NamedTuple):
    """What a claim finds. Values and text are not compared where they are None."""

    verdict: str
    values: dict[str, float] | None = None
    text: str | None = None
    part: str = ""
    """Part of the text."""


def case(
    key: str,
    source: str,
    runs: Any,
    verdict: str,
    values: dict[str, float] | None = None,
    text: str | None = None,
    part: str = "",
) -> Any:
    """Row of a table: a claim, its runs and studies, what it finds, and why it must."""
    needs = runs if isinstance(runs, tuple) else (runs,)
    return pytest.param(key, needs, Expected(verdict, values, text, part), id=f"{key}: {source}")


def check(key: str, needs: tuple[Any, ...]) -> Finding:
    """Judge a claim by the runs and studies that it needs, in their order."""
    claim = CLAIMS[key]
    return claim.check(dict(zip(claim.needs, needs, strict=True)))


def assert_finds(finding: Finding, expected: Expected) -> None:
    """Compare a finding with a row of a table."""
    assert finding.verdict == expected.verdict, finding.text
    if expected.values is not None:
        assert finding.values == pytest.approx(expected.values, rel=1e-9, abs=1e-12, nan_ok=True)
    if expected.text is not None:
        assert finding.text == expected.text
    assert expected.part in finding.text
