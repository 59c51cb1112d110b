"""One stored run: its trajectory and what is needed to score it, in one .npz file."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import one_line
from ..provenance import Files
from ..rows import Array, BoolArray
from ..runs.files import replaced
from ..simulation import Setup, Trajectory

_TEXT = ("status", "reason")
_NUMBERS = ("fallbacks", "compiled")
_OWN = ("length", "switching_gain", "approach_time", "sampling_band", "settled")


@dataclass(frozen=True)
class RunRecord:
    """A run and the description of its rows.

    Attributes
    ----------
    trajectory
        What the simulation left.
    kinds, units
        (m,) of each row.
    length
        (m,) characteristic length L of each row, in its unit.
    switching_gain
        (m,) u⁺ of each row.
    approach_time
        (m,) K of each row [s]; 0 for rows of speeds.
    sampling_band
        (m,) how far outside sampling alone puts each row, in its unit.
    settled
        (N,) whether the goal counts as reached at each sample.
    last_goal_time
        When the last goal was set [s].
    Ts
        Sampling time [s].
    fingerprint
        Identifies what was run: scenario, controller, trial, seed and code.
    files
        What it was made from besides: own modules, data, meshes, with hashes of what they held.
    """

    trajectory: Trajectory
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    length: Array
    switching_gain: Array
    approach_time: Array
    sampling_band: Array
    settled: BoolArray
    last_goal_time: float
    Ts: float
    fingerprint: str
    files: Files = field(default_factory=dict)

    @classmethod
    def of(cls, setup: Setup, trajectory: Trajectory, fingerprint: str) -> RunRecord:
        """The record of a run of this setup."""
        constraints = setup.constraints
        return cls(
            replace(trajectory, reason=one_line(trajectory.reason)),
            constraints.kinds,
            constraints.units,
            constraints.characteristic_length,
            constraints.switching_gain,
            constraints.approach_time,
            constraints.sampling_band(setup.Ts),
            setup.reached(trajectory.camera_error, trajectory.feature_error_px),
            setup.task.goals[-1].from_time,
            setup.Ts,
            fingerprint,
        )

    @classmethod
    def failed(cls, reason: str, fingerprint: str) -> RunRecord:
        """The record of a run that left nothing but its reason."""
        none = np.empty(0)
        empty: dict[str, Any] = {f.name: none for f in fields(Trajectory)}
        wide: dict[str, Any] = {
            name: np.empty((0, 0))
            for name in ("q", "qd", "qdd_command", "error", "phi", "sigma", "clearance", "between_clearance")
        }
        empty.update(wide, camera_error=np.empty((0, 2)), camera_position=np.empty((0, 3)))
        empty.update(features_px=np.empty((0, 0, 2)), points=np.empty((0, 0, 3)))
        empty.update(active=np.empty((0, 0), dtype=np.bool_))
        empty.update(status="failed", reason=one_line(reason), labels=(), fallbacks=0, compiled=False)
        trajectory = Trajectory(**empty)
        return cls(trajectory, (), (), none, none, none, none, np.empty(0, dtype=np.bool_), 0.0, np.nan, fingerprint)

    def save(self, path: Path) -> None:
        """Write the file whole or not at all; raises OSError, and what an own part's strange arrays may raise."""
        arrays: dict[str, Any] = {}
        facts: dict[str, Any] = {
            "kinds": self.kinds,
            "units": self.units,
            "last_goal_time": self.last_goal_time,
            "Ts": self.Ts,
            "fingerprint": self.fingerprint,
            "files": self.files,
        }
        for name, value in ((f.name, getattr(self.trajectory, f.name)) for f in fields(Trajectory)):
            if name in _TEXT or name in _NUMBERS:
                facts[name] = value
            else:
                arrays[name] = np.array(value, dtype=np.str_) if name == "labels" else value
        arrays.update({name: getattr(self, name) for name in _OWN})
        with replaced(path) as part, part.open("wb") as file:
            np.savez_compressed(file, facts=np.array(json.dumps(facts)), **arrays)

    @classmethod
    def load(cls, path: Path) -> RunRecord | None:
        """What the file holds; None if there is none or it is not a whole record of this version."""
        try:
            with path.open("rb") as file, np.load(file) as stored:
                arrays = {name: stored[name] for name in stored.files}
            facts = json.loads(str(arrays.pop("facts")))
            own = {name: arrays.pop(name) for name in _OWN}
            labels = tuple(str(name) for name in arrays.pop("labels"))
            text = {name: facts.pop(name) for name in (*_TEXT, *_NUMBERS)}
            trajectory = Trajectory(**arrays, **text, labels=labels)
            return cls(trajectory, tuple(facts.pop("kinds")), tuple(facts.pop("units")), **own, **facts)
        except Exception:  # a damaged file can raise anything: of the archive, its compression, NumPy, JSON
            return None


def run_file(folder: Path, scenario: str, controller: str, trial: int) -> Path:
    """Where a run's trajectory is stored below a comparison's folder."""
    return folder / "trajectories" / f"{scenario}--{controller}--{trial}.npz"
