"""Recorded motion of a robot's joints: matched by name, checked, and put on the scoring grid."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline

from ..errors import ConfigurationError, listed
from ..robots.robot import Robot
from ..rows import Array, BoolArray
from ..simulation.units import degrees_question
from .files import Clock, read_columns

#: Two samples have a gap between them if they are farther apart than this factor times the median
#: period, and than this time [s].
GAP = 5.0, 0.02
SLOW = 1.0  #: Median period [s] from which on times seem to be in another unit.
ON_GRID = 1e-6  #: Largest distance of a time from the grid, as a share of the sampling time.
#: Ratio of the motion by the given speeds to that of the positions, or its inverse, from which on
#: they contradict. Revolutions per minute are 9.55 times radians per second.
CONTRADICTION = 8.0
#: Cosine of given and differenced speeds below which their signs contradict. Noise of a joint at
#: rest, differenced and a sample late, has −0.5.
OPPOSITE = -0.8
LONGEST_GAP = 3600.0  #: Time [s] between two samples from which on a clock was set.


@dataclass(frozen=True)
class Recording:
    """Motion of n joints at N times, in the order of the robot's joints."""

    t: Array  #: (N,) increasing, from 0 [s].
    q: Array  #: (N, n) [rad or m].
    qd: Array | None = None  #: (N, n) [rad/s or m/s]; None if unknown.
    qdd: Array | None = None  #: (N, n) commanded accelerations, which hold until the next sample.
    pixels: Array | None = None  #: (N, M, 2) markers on the sensor, from its centre [px], or NaN.
    remarks: tuple[str, ...] = ()  #: Remarks for a reader of the scores.

    def on_grid(self, Ts: float) -> Recording:
        """Return the motion at the times k T_s; unchanged if it is recorded at these.

        Positions are interpolated by cubics with the recorded speeds or, without, by those of
        Akima. Commands hold, and pixels are interpolated linearly. Raises ConfigurationError if
        the recording is shorter than T_s.
        """
        N = math.floor(self.t[-1] / Ts + ON_GRID) + 1
        grid = Ts * np.arange(N)
        if N < 2:
            raise ConfigurationError(
                f"the recording lasts {self.t[-1]:.3g} s, less than a sampling time, {Ts} s"
            )
        as_it_is = len(self.t) == N and np.abs(self.t - grid).max() <= ON_GRID * Ts
        pixels = self.pixels
        if pixels is not None and not as_it_is:
            pixels = _pixels_at(grid, self.t, pixels)
        if as_it_is and self.qd is not None:
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
    columns = pixels.reshape(len(t), -1).T
    found: Array = np.column_stack([np.interp(grid, t, values) for values in columns])
    return found.reshape(-1, *pixels.shape[1:])


def read_recording(
    path: Path,
    robot: Robot,
    markers: int = 0,
    *,
    start: float = 0.0,
    end: float = math.inf,
    degrees: bool = False,
    clock: Clock = "header",
    topic: str = "",
) -> Recording:
    """Read the motion of a robot's joints from a file; see docs/score.md for its columns.

    It is that from ``start`` to ``end`` [s] after the first sample. With ``degrees``, revolute
    joints are converted to radians. ``clock`` and ``topic`` are of bags. Raises ConfigurationError,
    which names place and remedy: for missing joints, for values that seem to be degrees, and for
    times that run backwards.
    """
    raw = read_columns(path, clock, topic)
    part = _part(raw.t, start, end)
    columns = {name: values[part] for name, values in raw.columns.items()}
    found = {
        "t": raw.t[part],
        "q": _joints(path, robot, columns, "position"),
        "qd": _joints(path, robot, columns, "velocity"),
        "qdd": _joints(path, robot, columns, "command"),
        "pixels": _markers(path, columns, markers),
    }
    motion = {name: values for name, values in found.items() if values is not None}
    if "q" not in motion:
        raise _missing_joints(path, robot, columns)
    remarks = []
    known = np.isfinite(motion["t"]) & np.isfinite(motion["q"]).all(axis=1)
    if not known.all():
        remarks.append(f"{np.count_nonzero(~known)} samples without all joints are left out")
    if known.sum() < 2:
        raise ConfigurationError(f"{path} has less than two samples with all joints")
    motion = {name: values[known] for name, values in motion.items()}
    again = _repeated(path, motion["t"])
    if again.any():
        remarks.append(f"{np.count_nonzero(again)} samples repeat a time and are left out")
    motion = {name: values[~again] for name, values in motion.items()}
    motion["t"] = _seconds(path, motion["t"])
    for name in ("qd", "qdd"):
        if name in motion and not np.isfinite(motion[name]).all():
            remarks.append(f"incomplete columns of {name} are left out")
            del motion[name]
    if degrees:
        factor = np.where(robot.prismatic, 1.0, np.pi / 180.0)
        motion |= {name: factor * motion[name] for name in ("q", "qd", "qdd") if name in motion}
    _require_radians(path, robot, motion["q"])
    # a continuous joint may be reported within a turn
    motion["q"] = np.where(robot.continuous, np.unwrap(motion["q"], axis=0), motion["q"])
    if "qd" in motion:
        _require_speeds(path, robot, motion["t"], motion["q"], motion["qd"])
    return Recording(**motion, remarks=(*remarks, *_gaps(motion["t"])))


def _part(t: Array, start: float, end: float) -> slice:
    """Return the samples from the first at or after ``start`` to before the next at ``end``."""
    begin = int(np.argmax(t >= start)) if (t >= start).any() else len(t)
    after = np.flatnonzero(t[begin:] >= end)
    return slice(begin, begin + int(after[0]) if len(after) else None)


def _require_radians(path: Path, robot: Robot, q: Array) -> None:
    """Raise ConfigurationError if positions (N, n) seem to be degrees."""
    farthest = q[np.abs(q).argmax(axis=0), np.arange(robot.n)]
    question = degrees_question(f"{path}: the largest position", robot, farthest)
    if question:
        raise ConfigurationError(f"{question} --degrees converts them")


def _names(joint: str, number: int, what: str) -> Iterable[str]:
    """Return the names that a column of a joint may have."""
    short = {"position": "q", "velocity": "qd", "command": "qdd"}[what]
    bare = (joint,) if what == "position" else ()
    given = (f"{joint}.{what}", f"{what}.{joint}", f"{short}[{joint}]")
    return (*given, *bare, f"{short}[{number}]", f"{short}{number}")


def _joints(path: Path, robot: Robot, columns: dict[str, Array], what: str) -> Array | None:
    """Return the columns (N, n) of all joints; None if one is missing."""
    found = []
    for number, joint in enumerate(robot.joint_names, start=1):
        name = next((name for name in _names(joint, number, what) if name in columns), None)
        if name is None:
            return None
        found.append(columns[name])
    return np.column_stack(found)


def _missing_joints(path: Path, robot: Robot, columns: dict[str, Array]) -> ConfigurationError:
    """Return the error for a recording without the positions of all joints."""
    missing = [
        joint
        for number, joint in enumerate(robot.joint_names, start=1)
        if not any(name in columns for name in _names(joint, number, "position"))
    ]
    there = ", ".join(listed(list(columns), "columns")) or "none"
    return ConfigurationError(
        f"{path} has no positions of {', '.join(missing)}, joints of {robot.name}: name the "
        f"columns as the joints, or q1 to q{robot.n} in their order. It has {there}"
    )


def _markers(path: Path, columns: dict[str, Array], count: int) -> Array | None:
    """Return pixels (N, count, 2) of the columns u1, v1, …, or u[1], v[1], …; None if none is."""
    pairs = []
    missing = []
    for number in range(1, count + 1):
        for axis in "uv":
            names = (f"{axis}{number}", f"{axis}[{number}]")
            name = next((name for name in names if name in columns), None)
            if name is None:
                missing.append(names[0])
            else:
                pairs.append(columns[name])
    if not pairs:
        return None
    if missing:
        raise ConfigurationError(
            f"{path} has pixels, but no columns {', '.join(missing)}: give those of all {count} "
            "markers, empty where one is not seen"
        )
    return np.stack(pairs, axis=1).reshape(-1, count, 2)


def _repeated(path: Path, t: Array) -> BoolArray:
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


def _seconds(path: Path, t: Array) -> Array:
    """Return increasing times from 0; raise ConfigurationError if they cannot be seconds."""
    if len(t) < 2:
        raise ConfigurationError(f"{path}: all samples have the same time")
    steps = np.diff(t)
    period = float(np.median(steps))
    if period >= SLOW:
        raise ConfigurationError(
            f"{path}: samples are {period:.4g} s apart: are the times in ms or ns? They must be "
            "seconds; a column t_ns has nanoseconds"
        )
    k = int(steps.argmax())
    if steps[k] > LONGEST_GAP:
        raise ConfigurationError(
            f"{path}: time stamps jump by {steps[k]:.4g} s after sample {k + 1}, {t[k]:.4g} s "
            "after the first: a clock was set, or a first stamp is 0. Score one part with --start "
            "and --end; for a bag, --clock log takes the times of recording"
        )
    since: Array = t - t[0]
    return since


def _require_speeds(path: Path, robot: Robot, t: Array, q: Array, qd: Array) -> None:
    """Raise ConfigurationError if speeds contradict the positions in size or in sign."""
    moved = np.diff(q, axis=0)
    told = 0.5 * (qd[1:] + qd[:-1]) * np.diff(t)[:, None]
    size = float(np.abs(moved).sum())
    ratio = float(np.abs(told).sum()) / size if size > 0.0 else 1.0
    if not 1.0 / CONTRADICTION < ratio < CONTRADICTION and size > ON_GRID:
        raise ConfigurationError(
            f"{path}: speeds are {ratio:.3g} times what the positions change: are they in degrees "
            "per second or in revolutions per minute, or the times in another unit?"
        )
    sizes = np.linalg.norm(told, axis=0) * np.linalg.norm(moved, axis=0)
    turned = ((told * moved).sum(axis=0) < OPPOSITE * sizes) & (np.abs(moved).sum(axis=0) > ON_GRID)
    if turned.any():
        joints = ", ".join(robot.joint_names[j] for j in np.flatnonzero(turned))
        raise ConfigurationError(
            f"{path}: speeds of {joints} have the opposite sign of the change of their positions: "
            "give both in the same direction"
        )


def _gaps(t: Array) -> list[str]:
    """Return sentences on gaps between samples."""
    steps = np.diff(t)
    wide = np.flatnonzero(steps > max(GAP[0] * float(np.median(steps)), GAP[1]))
    gaps = [
        f"no sample for {steps[k]:.3g} s from t = {t[k]:.4g} s on, a gap or a jump of the clock: "
        "motion there is interpolated"
        for k in wide
    ]
    return listed(gaps, "gaps")
