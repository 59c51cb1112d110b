"""Record of one run: its trajectory and everything needed to score it, in one .npz file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from ..errors import one_line
from ..plugins.provenance import Files, digests
from ..rows import Array, BoolArray
from ..rows.readable import in_one_line
from ..simulation import Setup, Trajectory
from ..simulation.trajectory import Outcome
from .runs.files import MAX_BYTES, TRAJECTORIES, read_arrays, write_arrays
from .runs.spec import RunSpec

SAMPLE_MEMORY = 65_536.0  # maximum bytes of a sample: thousands of rows and robot points

#: Axes of the arrays of a record: samples N, joints n, rows m, features k, markers M, robot points
#: p, goals g.
SHAPES = {
    **dict.fromkeys(
        ("t", "feature_error_px", "saturated", "rows_time", "step_time", "settled"), "N"
    ),
    **dict.fromkeys(("q", "qd", "qdd_command"), "Nn"),
    **dict.fromkeys(("phi", "sigma", "clearance", "active", "between_clearance"), "Nm"),
    **dict.fromkeys(("labels", "kinds", "units", "length", "switching_gain"), "m"),
    **dict.fromkeys(("approach_time", "sampling_band", "share_to_hold"), "m"),
    "error": "Nk",
    "camera_error": "N2",
    "camera_position": "N3",
    "features_px": "NM2",
    "points": "Np3",
    "goal_begins": "g",
}

TEXTS = ("labels", "kinds", "units")
FLAGS = ("active", "saturated", "settled")
#: Types of the other entries of a record.
FACTS: dict[str, Any] = dict.fromkeys(("status", "reason", "fingerprint"), str)
FACTS |= {
    "fallbacks": int,
    "compiled": bool,
    "files": dict,
    "Ts": float,
    "common": int,
    "missed": (int, type(None)),
}

TRAJECTORY = [f.name for f in fields(Trajectory)]


@dataclass(frozen=True)
class RunRecord:
    """Trajectory of a run and the description of its rows."""

    trajectory: Trajectory
    #: (m,) kind, unit, characteristic length L in that unit, and switching gain u⁺ of each row.
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    length: Array
    switching_gain: Array
    #: (m,) approach time K of each row [s], 0 for rows on speeds; depth that sampling alone causes,
    #: in the unit of the row.
    approach_time: Array
    sampling_band: Array
    #: (N,) True if the current goal is reached at the sample; (g,) start time of each goal [s].
    settled: BoolArray
    goal_begins: Array
    #: Samples within the scenario's duration, common to all laws: the basis of rates per second.
    common: int
    Ts: float  #: Sampling time [s].
    #: Hash of scenario, controller, trial, seed and code; hashes of the other files that the run
    #: depends on.
    fingerprint: str
    files: Files = field(default_factory=dict)
    #: Number of periods that the loop missed on an arm; None in a simulation.
    missed: int | None = None

    @in_one_line
    def __repr__(self) -> str:
        return f"<RunRecord of {self.trajectory!r}>"

    @classmethod
    def of(cls, setup: Setup, trajectory: Trajectory, fingerprint: str) -> RunRecord:
        """Build the record of a run of this setup."""
        told = replace(trajectory, reason=one_line(trajectory.reason))
        own = setup.constraints
        rows = (
            own.kinds,
            own.units,
            own.characteristic_length,
            own.switching_gain,
            own.approach_time,
        )
        settled = setup.reached(told.t, told.camera_error, told.feature_error_px, told.qd)
        goals = settled, setup.goal_begins, setup.samples
        return cls(told, *rows, own.sampling_band(setup.Ts), *goals, setup.Ts, fingerprint)

    @classmethod
    def failed(cls, reason: str, fingerprint: str) -> RunRecord:
        """Build the record of a run that failed without a trajectory, with its reason."""
        values: dict[str, Any] = dict.fromkeys(TEXTS, ())
        for name, axes in SHAPES.items():
            shape = [int(axis) if axis.isdecimal() else 0 for axis in axes]
            values.setdefault(name, np.empty(shape, np.bool_ if name in FLAGS else float))
        values |= {
            "status": "failed",
            "reason": one_line(reason),
            "fallbacks": 0,
            "compiled": False,
        }
        return cls._from({**values, "common": 0, "Ts": math.nan, "fingerprint": fingerprint})

    @classmethod
    def _from(cls, values: Mapping[str, Any]) -> RunRecord:
        """Build a record from its attributes and those of its trajectory."""
        others = {name: value for name, value in values.items() if name not in TRAJECTORY}
        return cls(Trajectory(**{name: values[name] for name in TRAJECTORY}), **others)

    def save(self, path: Path) -> None:
        """Write the file completely or not at all.

        Raises OSError, and any error that invalid arrays of a custom part may raise.
        """
        values = {name: getattr(self.trajectory, name) for name in TRAJECTORY}
        values |= {f.name: getattr(self, f.name) for f in fields(self)[1:]}
        write_arrays(path, {**values, "labels": np.array(self.trajectory.labels, dtype=np.str_)})

    @classmethod
    def load(cls, path: Path, samples: float = math.inf) -> RunRecord | None:
        """Read a record; return None unless the file is a complete record of this version.

        None is also returned if it has more than the given number of samples.
        """
        # a damaged file can raise any error: from the archive, its compression, NumPy or JSON
        with suppress(Exception):
            values = read_arrays(path, min(MAX_BYTES, SAMPLE_MEMORY * (1.0 + samples)))
            values |= {name: tuple(map(str, values[name])) for name in TEXTS}
            _require_shapes(values, samples)
            return cls._from(values)
        return None


def _require_shapes(values: Mapping[str, Any], samples: float) -> None:
    """Raise unless the arrays of a record have consistent shapes and all entries have their types.

    The error is ValueError, KeyError or TypeError.
    """
    sizes: dict[str, int] = {}
    for name, axes in SHAPES.items():
        value = values[name]
        shape = (len(value),) if isinstance(value, tuple) else value.shape
        if (
            not isinstance(value, tuple)
            and value.size
            and value.dtype != (np.bool_ if name in FLAGS else np.float64)
        ):
            raise TypeError(f"{name} are not numbers")
        if len(shape) != len(axes):
            raise ValueError(f"{name} has the shape {shape}")
        for axis, size in zip(axes, shape, strict=True):
            if (int(axis) if axis.isdecimal() else sizes.setdefault(axis, size)) != size:
                raise ValueError(f"{name} has the shape {shape}")
    if sizes["N"] > samples:
        raise ValueError(f"it has {sizes['N']} samples")
    for name, kind in FACTS.items():
        if not isinstance(values[name], kind) or isinstance(values[name], bool) != (kind is bool):
            raise TypeError(f"{name} is {values[name]!r}")
    if values["status"] not in get_args(Outcome):
        raise ValueError(f"status is {values['status']!r}")


def stored_run(spec: RunSpec, folder: Path) -> RunRecord | None:
    """Return the stored record of a run; None unless everything that it depends on is unchanged."""
    record = RunRecord.load(run_file(folder, *spec.key))
    if record is None or record.fingerprint != spec.fingerprint:
        return None
    return record if digests((*record.files, *spec.files)) == record.files else None


def run_file(folder: Path, scenario: str, controller: str, trial: int) -> Path:
    """Return the path of a run's trajectory in a comparison's folder."""
    return folder / TRAJECTORIES / f"{scenario}--{controller}--{trial}.npz"
