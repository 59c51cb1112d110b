"""Record of one run: its trajectory and everything needed to score it, in one .npz file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from ..errors import one_line
from ..plugins.provenance import Files, digests
from ..rows import Array, BoolArray, IntArray
from ..rows.readable import in_one_line
from ..simulation import Setup, Trajectory
from .runs.files import MAX_BYTES, TRAJECTORIES, read_arrays, write_arrays
from .runs.spec import RunSpec

SAMPLE_MEMORY = 65_536.0  # maximum bytes of a sample: thousands of rows and robot points


@dataclass(frozen=True)
class RunRecord:
    """Trajectory of a run with g goals, and the description of its m rows.

    The annotation of an array names its axes, as in :class:`.Trajectory`.
    """

    trajectory: Trajectory
    kinds: Annotated[tuple[str, ...], "m"]  #: Kind of each row, such as ``fov``.
    units: Annotated[tuple[str, ...], "m"]  #: Natural unit of each row.
    length: Annotated[Array, "m"]  #: Characteristic length L in that unit.
    switching_gain: Annotated[Array, "m"]  #: Switching gain u⁺ [of φ per second].
    approach_time: Annotated[Array, "m"]  #: Approach time K [s]; 0 for rows on speeds.
    sampling_band: Annotated[Array, "m"]  #: Depth that sampling alone causes [natural].
    settled: Annotated[BoolArray, "N"]  #: True if the current goal is reached at the sample.
    goal_begins: Annotated[Array, "g"]  #: Start time of each goal [s].
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
        run = replace(trajectory, reason=one_line(trajectory.reason))
        constraints = setup.constraints
        return cls(
            run,
            kinds=constraints.kinds,
            units=constraints.units,
            length=constraints.characteristic_length,
            switching_gain=constraints.switching_gain,
            approach_time=constraints.approach_time,
            sampling_band=constraints.sampling_band(setup.Ts),
            settled=setup.reached(run.t, run.camera_error, run.feature_error_px, run.qd),
            goal_begins=setup.goal_begins,
            common=setup.samples,
            Ts=setup.Ts,
            fingerprint=fingerprint,
        )

    @classmethod
    def failed(cls, reason: str, fingerprint: str) -> RunRecord:
        """Build the record of a run that failed without a trajectory, with its reason."""
        values = {name: array.empty() for name, array in ARRAYS.items()}
        values |= {
            "status": "failed",
            "reason": one_line(reason),
            "fallbacks": 0,
            "common": 0,
            "Ts": math.nan,
            "fingerprint": fingerprint,
        }
        return cls._from(values)

    @classmethod
    def _from(cls, values: Mapping[str, Any]) -> RunRecord:
        """Build a record from its attributes and those of its trajectory."""
        names = {each.name for each in fields(Trajectory)}
        run = {name: value for name, value in values.items() if name in names}
        others = {name: value for name, value in values.items() if name not in names}
        return cls(Trajectory(**run), **others)

    def save(self, path: Path) -> None:
        """Write the file completely or not at all.

        Raises OSError, and any error that invalid arrays of a custom part may raise.
        """
        values = {**vars(self.trajectory), **vars(self)}
        del values["trajectory"]
        write_arrays(path, {**values, "labels": np.array(self.trajectory.labels, dtype=np.str_)})

    @classmethod
    def load(cls, path: Path, samples: float = math.inf) -> RunRecord | None:
        """Read a record; return None unless the file is a complete record of this version.

        None is also returned if it has more than the given number of samples.
        """
        # a damaged file can raise any error: from the archive, its compression, NumPy or JSON
        with suppress(Exception):
            values = read_arrays(path, min(MAX_BYTES, SAMPLE_MEMORY * (1.0 + samples)))
            for name, array in ARRAYS.items():
                if array.element is str:
                    values[name] = tuple(map(str, values[name]))
            _require_arrays(values, samples)
            _require_facts(values)
            return cls._from(values)
        return None


@dataclass(frozen=True)
class StoredArray:
    """Elements and axes of an array or a tuple of texts that a record holds."""

    element: type  #: ``np.float64``, ``np.int64``, ``np.bool_``, or ``str`` for a tuple of texts.
    axes: tuple[str, ...]  #: Letter of each axis, or its size in digits.

    def empty(self) -> Any:
        """Return the array with axes of length zero, except those of a fixed size."""
        if self.element is str:
            return ()
        shape = [int(axis) if axis.isdecimal() else 0 for axis in self.axes]
        return np.empty(shape, self.element)


_ELEMENTS: dict[Any, type] = {
    Array: np.float64,
    IntArray: np.int64,
    BoolArray: np.bool_,
    tuple[str, ...]: str,
}


def _declared() -> tuple[dict[str, StoredArray], dict[str, Any]]:
    """Return the arrays of a record, and the types of its other entries, by name.

    They are declared by the annotations of :class:`.Trajectory` and :class:`RunRecord`.
    """
    annotations = get_type_hints(Trajectory, include_extras=True)
    annotations |= get_type_hints(RunRecord, include_extras=True)
    del annotations["trajectory"]
    arrays = {}
    facts = {}
    for name, annotation in annotations.items():
        if get_origin(annotation) is Annotated:
            kind, axes = get_args(annotation)
            if kind not in _ELEMENTS:
                raise TypeError(f"{name}: no run is stored with arrays of the type {kind}")
            arrays[name] = StoredArray(_ELEMENTS[kind], tuple(axes.split()))
        else:
            facts[name] = annotation
    return arrays, facts


ARRAYS, FACTS = _declared()


def _require_arrays(values: Mapping[str, Any], samples: float) -> None:
    """Raise unless the arrays of a record have consistent shapes and the declared elements.

    The error is ValueError, KeyError or TypeError.
    """
    sizes: dict[str, int] = {}
    for name, array in ARRAYS.items():
        value = values[name]
        if array.element is str:
            shape = (len(value),)
        else:
            shape = value.shape
            if value.size and value.dtype != array.element:
                raise TypeError(f"{name} are not numbers")
        if len(shape) != len(array.axes):
            raise ValueError(f"{name} has the shape {shape}")
        for axis, size in zip(array.axes, shape, strict=True):
            expected = int(axis) if axis.isdecimal() else sizes.setdefault(axis, size)
            if size != expected:
                raise ValueError(f"{name} has the shape {shape}")
    if sizes["N"] > samples:
        raise ValueError(f"it has {sizes['N']} samples")


def _require_facts(values: Mapping[str, Any]) -> None:
    """Raise unless the other entries of a record have their types.

    The error is ValueError, KeyError or TypeError.
    """
    for name, kind in FACTS.items():
        value = values[name]
        if get_origin(kind) is Literal:
            if value not in get_args(kind):
                raise ValueError(f"{name} is {value!r}")
            continue
        accepted = dict if get_origin(kind) is dict else kind
        # True is an int, too
        is_flag = isinstance(value, bool)
        if not isinstance(value, accepted) or is_flag != (kind is bool):
            raise TypeError(f"{name} is {value!r}")


def stored_run(spec: RunSpec, folder: Path) -> RunRecord | None:
    """Return the stored record of a run; None unless everything that it depends on is unchanged."""
    record = RunRecord.load(run_file(folder, *spec.key))
    if record is None or not _is_unchanged(spec, record.fingerprint, record.files):
        return None
    return record


def stored_reason(spec: RunSpec, folder: Path) -> str | None:
    """Return the reason of a stored run, without its arrays; None as :func:`stored_run`."""
    with suppress(Exception):  # a damaged file can raise any error
        facts = read_arrays(run_file(folder, *spec.key), facts_only=True)
        if _is_unchanged(spec, facts["fingerprint"], facts["files"]):
            return str(facts["reason"])
    return None


def _is_unchanged(spec: RunSpec, fingerprint: str, files: Files) -> bool:
    return fingerprint == spec.fingerprint and digests((*files, *spec.files)) == files


def run_file(folder: Path, scenario: str, controller: str, trial: int) -> Path:
    """Return the path of a run's trajectory in a comparison's folder."""
    return folder / TRAJECTORIES / f"{scenario}--{controller}--{trial}.npz"
