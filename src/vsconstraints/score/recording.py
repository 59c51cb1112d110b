"""Recorded motion of a robot's joints: matched by name, checked, and put on the scoring grid."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline

from ..errors import ConfigurationError, format_value, listed, unknown_name
from ..robots.robot import Robot
from ..rows import Array, BoolArray
from .files import Clock, Columns, is_bag, read_columns
from .plausible import (
    motion_questions,
    require_radians,
    require_seconds,
    require_speeds,
    sustained_speeds,
    time_questions,
)

#: Two samples have a gap between them if they are farther apart than this number of median periods,
#: and than this time [s].
GAP_PERIODS = 5.0
GAP_TIME = 0.02
#: Recorded quantities of joints: the words for each in names of columns, and its plural.
QUANTITIES = {
    "q": ("position", "positions"),
    "qd": ("velocity", "speeds"),
    "qdd": ("command", "commanded accelerations"),
}
ON_GRID = 1e-6  #: Largest distance of a time from the grid, as a share of the sampling time.


@dataclass(frozen=True)
class Recording:
    """Motion of n joints at N times, in the order of the robot's joints."""

    t: Array  #: (N,) increasing, from 0 [s].
    q: Array  #: (N, n) [rad or m].
    qd: Array | None = None  #: (N, n) [rad/s or m/s]; None if unknown.
    qdd: Array | None = None  #: (N, n) commanded accelerations, which hold until the next sample.
    pixels: Array | None = None  #: (N, M, 2) markers on the sensor, from its centre [px], or NaN.
    remarks: tuple[str, ...] = ()  #: Remarks for a reader of the scores.
    begin: float = 0.0  #: Time of the first of these samples, after the first one of the file [s].

    def on_grid(self, Ts: float) -> Recording:
        """Return the motion at the times k T_s, with speeds; unchanged if it is recorded like this.

        Positions are interpolated by cubics with the recorded speeds or, without, by those of
        Akima. Speeds are derivatives of the cubics. Commands hold, and pixels are interpolated
        linearly. Raises ConfigurationError if the recording is shorter than T_s.
        """
        N = math.floor(self.t[-1] / Ts + ON_GRID) + 1
        grid = Ts * np.arange(N)
        if N < 2:
            raise ConfigurationError(
                f"the recording lasts {self.t[-1]:.3g} s, less than a sampling time, {Ts} s"
            )
        is_on_grid = len(self.t) == N and np.abs(self.t - grid).max() <= ON_GRID * Ts
        pixels = self.pixels
        if pixels is not None and not is_on_grid:
            pixels = _pixels_at(grid, self.t, pixels)
        if is_on_grid and self.qd is not None:
            return replace(self, t=grid, pixels=pixels)
        if self.qd is not None:
            curve = CubicHermiteSpline(self.t, self.q, self.qd)
        else:
            curve = Akima1DInterpolator(self.t, self.q, method="makima")
        inside = np.minimum(grid, self.t[-1])
        held = np.searchsorted(self.t, inside + ON_GRID * Ts, side="right") - 1
        return replace(
            self,
            t=grid,
            q=curve(inside),
            qd=curve(inside, 1),
            qdd=None if self.qdd is None else self.qdd[held],
            pixels=pixels,
        )


def _pixels_at(grid: Array, t: Array, pixels: Array) -> Array:
    """Interpolate pixels (N, M, 2) linearly; NaN unless seen at the samples on both sides."""
    coordinates = pixels.reshape(len(t), -1).T
    found: Array = np.column_stack([np.interp(grid, t, values) for values in coordinates])
    return found.reshape(-1, *pixels.shape[1:])


def read_recording(
    path: Path,
    robot: Robot,
    markers: int = 0,
    *,
    part: tuple[float, float] = (0.0, math.inf),
    degrees: bool = False,
    clock: Clock = "header",
    topic: str = "",
    names: Mapping[str, str] | None = None,
) -> Recording:
    """Read the motion of a robot's joints from a file; see docs/score.md for its columns.

    ``part`` is its start and end [s] after the first sample. With ``degrees``, revolute joints are
    converted to radians. ``clock`` and ``topic`` are of bags. ``names`` are those of joints in the
    file, from :func:`names_in_file`, where they differ from the robot's. Raises ConfigurationError,
    which names place and remedy: for missing joints, for values that seem to be degrees, and for
    times that run backwards or seem to be in another unit.
    """
    columns = _part(read_columns(path, clock, topic), *part)
    given = names or {}
    in_file = {joint: given.get(joint, joint) for joint in robot.joint_names}
    motion, remarks = _motion(path, robot, in_file, columns)
    pixels = _markers(path, columns, markers)
    if pixels is not None:
        motion["pixels"] = pixels
    motion, left_out = _usable(path, motion)
    begin = float(motion["t"][0])
    questions = _convert(path, robot, motion, degrees, columns.unit_stated)
    remarks += [*left_out, *questions, *_gaps(motion["t"])]
    return Recording(**motion, remarks=tuple(remarks), begin=begin)


def _convert(
    path: Path, robot: Robot, motion: dict[str, Array], degrees: bool, unit_stated: bool
) -> list[str]:
    """Let the times of a motion begin at 0, and convert its angles to radians, in place.

    Return questions about its units. Raises as :func:`read_recording`.
    """
    require_seconds(path, motion["t"], unit_stated)
    t = motion["t"] - motion["t"][0]
    if degrees:
        factor = np.where(robot.prismatic, 1.0, np.pi / 180.0)
        for name in QUANTITIES:
            if name in motion:
                motion[name] = factor * motion[name]
    q = motion["q"]
    require_radians(path, robot, q)
    # a continuous joint may be reported within a turn
    q = np.where(robot.continuous, np.unwrap(q, axis=0), q)
    if "qd" in motion:
        require_speeds(path, robot, t, q, motion["qd"])
    motion["t"] = t
    motion["q"] = q
    speeds = sustained_speeds(t, q)
    questions = [] if unit_stated else list(time_questions(path, robot, t, q, speeds))
    return [*questions, *motion_questions(robot, q, speeds)]


def _motion(
    path: Path, robot: Robot, names: Mapping[str, str], columns: Columns
) -> tuple[dict[str, Array], list[str]]:
    """Return t (N,), q (N, n) and, if recorded, qd and qdd, with remarks on incomplete ones.

    ``names`` are those in the file of all joints.
    """
    motion = {"t": columns.t}
    remarks = []
    for name, (what, plural) in QUANTITIES.items():
        found = _of_joints(names, columns, name, what)
        missing = [joint for joint in names if joint not in found]
        if not missing:
            motion[name] = np.column_stack([found[joint] for joint in names])
        elif name == "q":
            raise _missing_joints(path, robot, names, columns, missing)
        elif found:
            remarks.append(
                f"{plural} of {', '.join(missing)} are missing: those of the other joints are "
                "left out"
            )
    return motion, remarks


def _usable(path: Path, motion: Mapping[str, Array]) -> tuple[dict[str, Array], list[str]]:
    """Return the complete samples of a motion, each time once, with remarks on the others."""
    remarks = []
    known = np.isfinite(motion["t"]) & np.isfinite(motion["q"]).all(axis=1)
    unknown = np.count_nonzero(~known)
    if unknown:
        remarks.append(f"{unknown} samples without all joints are left out")
    if known.sum() < 2:
        raise ConfigurationError(f"{path} has less than two samples with all joints")
    repeats = _repeats(path, motion["t"][known])
    repeated = np.count_nonzero(repeats)
    if repeated:
        remarks.append(f"{repeated} samples repeat a time and are left out")
    usable = {name: values[known][~repeats] for name, values in motion.items()}
    for name in ("qd", "qdd"):
        if name in usable and not np.isfinite(usable[name]).all():
            remarks.append(f"incomplete columns of {name} are left out")
            del usable[name]
    return usable, remarks


def _part(recorded: Columns, start: float, end: float) -> Columns:
    """Return the samples from the first at or after ``start`` to before the next at ``end``."""
    t = recorded.t
    begin = _first(t >= start)
    part = slice(begin, begin + _first(t[begin:] >= end))
    numbers = {name: values[part] for name, values in recorded.numbers.items()}
    return recorded._replace(t=t[part], numbers=numbers)


def _first(flags: BoolArray) -> int:
    """Return the index of the first flag that is set; the number of flags if none is."""
    return int(flags.argmax()) if flags.any() else len(flags)


def _of_joints(
    names_in_file: Mapping[str, str], columns: Columns, name: str, what: str
) -> dict[str, Array]:
    """Return the columns (N,) of a quantity by joint, of the joints that have one.

    ``name`` is its key in :data:`QUANTITIES`, and ``what`` its word in names of columns.
    """
    found = {}
    for number, (joint, there) in enumerate(names_in_file.items(), start=1):
        names = [f"{there}.{what}", f"{what}.{there}", f"{name}[{there}]"]
        if name == "q":
            names.append(there)
        names += [f"{name}[{number}]", f"{name}{number}"]
        values = columns.find(names)
        if values is not None:
            found[joint] = values
    return found


def _missing_joints(
    path: Path, robot: Robot, names: Mapping[str, str], columns: Columns, missing: Sequence[str]
) -> ConfigurationError:
    """Return the error for a recording without the positions of some joints."""
    sought = [joint if names[joint] == joint else f"{joint}={names[joint]}" for joint in missing]
    without = f"{path} has no positions of {', '.join(sought)}"
    if is_bag(path):
        return _missing_in_bag(without, robot, columns, missing[0])
    recorded = [*columns.numbers, *columns.others]
    there = ", ".join(listed(recorded, "columns")) or "none"
    return ConfigurationError(
        f"{without}, joints of {robot.name}: name the columns as the joints, or q1 to q{robot.n} "
        f"in their order. It has {there}"
    )


def _missing_in_bag(without: str, robot: Robot, columns: Columns, joint: str) -> ConfigurationError:
    """Return the error for a bag without the positions of some joints, whose names are fixed.

    ``without`` names them, and ``joint`` is one of them.
    """
    ending = ".position"
    recorded = [name.removesuffix(ending) for name in columns.numbers if name.endswith(ending)]
    there = ", ".join(listed(recorded, "joints")) or "none"
    alike = (name for name in recorded if name.endswith(joint))
    example = shlex.quote(f"{joint}={next(alike, 'NAME')}")
    return ConfigurationError(
        f"{without}; the joints of {robot.name} are {', '.join(robot.joint_names)}, and those with "
        f"positions in the bag {there}. Name each that is called otherwise there, such as --joint "
        f"{example}, or rename it in the robot of the scenario"
    )


def names_in_file(robot: Robot, texts: Sequence[str]) -> dict[str, str]:
    """Return the names in a recording of a robot's joints by joint, from texts ``JOINT=NAME``.

    They are those of the joints that the texts name. Raises ConfigurationError for another text,
    an unknown joint, a joint that is given twice, and two joints with the same name.
    """
    names = dict[str, str]()
    for text in texts:
        joint, _, there = text.partition("=")
        if not (joint and there):
            raise ConfigurationError(
                f"--joint is JOINT=NAME, the name in the scenario and that in the recording, not "
                f"{format_value(text)}"
            )
        if joint not in robot.joint_names:
            raise unknown_name(f"joint of {robot.name}", joint, robot.joint_names)
        if joint in names:
            raise ConfigurationError(
                f"--joint gives the joint {joint} two names, {names[joint]} and {there}"
            )
        names[joint] = there
    joints = dict[str, str]()  # by name in the recording
    for joint in robot.joint_names:
        there = names.get(joint, joint)
        if there in joints:
            raise ConfigurationError(
                f"two joints of {robot.name} have the same name in the recording, {there}: "
                f"{joints[there]} and {joint}"
            )
        joints[there] = joint
    return names


def _markers(path: Path, columns: Columns, count: int) -> Array | None:
    """Return pixels (N, count, 2) of the columns u1, v1, …, or u[1], v[1], …; None if none is."""
    found = []
    missing = []
    for number in range(1, count + 1):
        for axis in "uv":
            name = f"{axis}{number}"
            values = columns.find([name, f"{axis}[{number}]"])
            if values is None:
                missing.append(name)
            else:
                found.append(values)
    if not found:
        return None
    if missing:
        raise ConfigurationError(
            f"{path} has pixels, but no columns {', '.join(missing)}: give those of all {count} "
            "markers, empty where one is not seen"
        )
    return np.stack(found, axis=1).reshape(-1, count, 2)


def _repeats(path: Path, t: Array) -> BoolArray:
    """Return flags (N,) of the samples that repeat a time.

    Raises ConfigurationError if times run backwards.
    """
    steps = np.diff(t)
    back = np.flatnonzero(steps < 0.0)
    if len(back):
        k = int(back[0])
        raise ConfigurationError(
            f"{path}: time stamps run backwards by {-steps[k]:.4g} s after sample {k + 1}, "
            f"{t[k]:.4g} s after the first: a clock was set, or two sources are mixed. Score one "
            "part with --start and --end; for a bag, --clock log takes the times of recording"
        )
    return np.concatenate(([False], steps == 0.0))


def _gaps(t: Array) -> list[str]:
    """Return sentences on gaps between samples."""
    steps = np.diff(t)
    longest = max(GAP_PERIODS * float(np.median(steps)), GAP_TIME)
    gaps = [
        f"no sample for {steps[k]:.3g} s from t = {t[k]:.4g} s on, a gap or a jump of the clock: "
        "motion there is interpolated"
        for k in np.flatnonzero(steps > longest)
    ]
    return listed(gaps, "gaps")
