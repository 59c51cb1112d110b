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
from .files import Clock, Columns, read_columns

#: Two samples have a gap between them if they are farther apart than this factor times the median
#: period, and than this time [s].
GAP = 5.0, 0.02
SLOW = 1.0  #: Median period [s] from which on times seem to be in another unit.
#: The same, if in addition no joint is faster than this [rad/s or m/s].
SLOW_AND_STILL = 0.05, 5e-3
ON_GRID = 1e-6  #: Largest distance of a time from the grid, as a share of the sampling time.
#: Ratio of the motion by the given speeds to that of the positions, or its inverse, from which on
#: they contradict. Revolutions per minute are 9.55 times radians per second.
CONTRADICTION = 8.0
#: Cosine of given and differenced speeds below which their signs contradict. Noise of a joint at
#: rest, differenced and a sample late, has −0.5.
OPPOSITE = -0.8
LONGEST_GAP = 3600.0  #: Time [s] between two samples from which on a clock was set.
#: Sustained speed of a joint, as a multiple of the robot's own limit, and distance of a position
#: from the middle of its range, in half ranges, beyond which another unit is suspected.
IMPLAUSIBLE = 3.0
#: Sentence on the units of times.
NAMED_UNITS = "They must be seconds; t_ms, t_us and t_ns name columns in other units"
SUSTAINED = 0.1  #: Time over which such a speed is measured [s].


@dataclass(frozen=True)
class Recording:
    """Motion of n joints at N times, in the order of the robot's joints."""

    t: Array  #: (N,) increasing, from 0 [s].
    q: Array  #: (N, n) [rad or m].
    qd: Array | None = None  #: (N, n) [rad/s or m/s]; None if unknown.
    qdd: Array | None = None  #: (N, n) commanded accelerations, which hold until the next sample.
    pixels: Array | None = None  #: (N, M, 2) markers on the sensor, from its centre [px], or NaN.
    remarks: tuple[str, ...] = ()  #: Remarks for a reader of the scores.
    begin: float = 0.0  #: Time of the first sample, from the scenario's t = 0 on [s].

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
    zero: float = 0.0,
    degrees: bool = False,
    clock: Clock = "header",
    topic: str = "",
) -> Recording:
    """Read the motion of a robot's joints from a file; see docs/score.md for its columns.

    It is that from ``start`` to ``end`` [s] after the first sample. The scenario begins, t = 0, at
    ``zero`` [s] after the first sample; earlier samples are left out. With ``degrees``, revolute
    joints are converted to radians. ``clock`` and ``topic`` are of bags. Raises ConfigurationError,
    which names place and remedy: for missing joints, for values that seem to be degrees, and for
    times that run backwards or seem to be in another unit.
    """
    raw = read_columns(path, clock, topic)
    part = _part(raw.t, max(start, zero), end)
    columns = Columns(
        raw.t[part], {name: values[part] for name, values in raw.columns.items()}, raw.others
    )
    found = {
        "t": columns.t,
        "q": _joints(robot, columns, "position"),
        "qd": _joints(robot, columns, "velocity"),
        "qdd": _joints(robot, columns, "command"),
        "pixels": _markers(path, columns, markers),
    }
    motion = {name: values for name, values in found.items() if values is not None}
    if "q" not in motion:
        raise _missing_joints(path, robot, columns)
    remarks = [*_left_out(robot, columns)]
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
    begin = float(motion["t"][0]) - zero
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
    speeds = _sustained_speeds(motion["t"], motion["q"])
    _require_motion(path, motion["t"], speeds)
    remarks += [*_unit_questions(robot, motion["q"], speeds), *_gaps(motion["t"])]
    return Recording(**motion, remarks=tuple(remarks), begin=begin)


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


def _column_name(columns: Columns, joint: str, number: int, what: str) -> str:
    """Return the name of the column of a joint; empty if there is none.

    Raises ConfigurationError if that column is not of numbers.
    """
    names = list(_names(joint, number, what))
    for name in names:
        if name in columns.columns:
            return name
    for name in names:
        if name in columns.others:
            raise ConfigurationError(columns.others[name])
    return ""


def _joints(robot: Robot, columns: Columns, what: str) -> Array | None:
    """Return the columns (N, n) of all joints; None if one is missing."""
    found = []
    for number, joint in enumerate(robot.joint_names, start=1):
        name = _column_name(columns, joint, number, what)
        if not name:
            return None
        found.append(columns.columns[name])
    return np.column_stack(found)


def _without(robot: Robot, columns: Columns, what: str) -> list[str]:
    """Return the names of the joints without a column."""
    return [
        joint
        for number, joint in enumerate(robot.joint_names, start=1)
        if not _column_name(columns, joint, number, what)
    ]


def _left_out(robot: Robot, columns: Columns) -> Iterable[str]:
    """Yield a sentence for speeds and for commands that only some joints have."""
    for what, plural in (("velocity", "speeds"), ("command", "commanded accelerations")):
        missing = _without(robot, columns, what)
        if 0 < len(missing) < robot.n:
            yield (
                f"{plural} of {', '.join(missing)} are missing: those of the other joints are "
                "left out"
            )


def _missing_joints(path: Path, robot: Robot, columns: Columns) -> ConfigurationError:
    """Return the error for a recording without the positions of all joints."""
    missing = _without(robot, columns, "position")
    names = [*columns.columns, *columns.others]
    there = ", ".join(listed(names, "columns")) or "none"
    return ConfigurationError(
        f"{path} has no positions of {', '.join(missing)}, joints of {robot.name}: name the "
        f"columns as the joints, or q1 to q{robot.n} in their order. It has {there}"
    )


def _markers(path: Path, columns: Columns, count: int) -> Array | None:
    """Return pixels (N, count, 2) of the columns u1, v1, …, or u[1], v[1], …; None if none is."""
    pairs = []
    missing = []
    for number in range(1, count + 1):
        for axis in "uv":
            names = (f"{axis}{number}", f"{axis}[{number}]")
            name = next((name for name in names if name in columns.columns), None)
            if name is None:
                missing.append(names[0])
            else:
                pairs.append(columns.columns[name])
    unreadable = [columns.others[name] for name in missing if name in columns.others]
    if unreadable:
        raise ConfigurationError(unreadable[0])
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
            f"{path}: samples are {period:.4g} s apart: are the times in milliseconds or "
            f"nanoseconds? {NAMED_UNITS}"
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


def _sustained_speeds(t: Array, q: Array) -> Array:
    """Return the largest speed (n,) of each joint over :data:`SUSTAINED` [rad/s or m/s].

    One in a hundred of the intervals may be faster, as a glitch or a singularity may cause it.
    """
    period = float(np.median(np.diff(t)))
    width = min(max(1, round(SUSTAINED / period)), len(t) - 1)
    elapsed = (t[width:] - t[:-width])[:, None]
    speeds = np.abs(q[width:] - q[:-width]) / elapsed
    largest: Array = np.quantile(speeds, 0.99, axis=0, method="lower")
    return largest


def _require_motion(path: Path, t: Array, speeds: Array) -> None:
    """Raise ConfigurationError if rare samples of a joint that hardly moves seem to be in ms."""
    period = float(np.median(np.diff(t)))
    rare, still = SLOW_AND_STILL
    if period >= rare and 0.0 < speeds.max() < still:
        raise ConfigurationError(
            f"{path}: samples are {period:.4g} s apart, and no joint is faster than "
            f"{speeds.max():.3g} rad/s or m/s: are the times in milliseconds? {NAMED_UNITS}"
        )


def _unit_questions(robot: Robot, q: Array, speeds: Array) -> Iterable[str]:
    """Yield the question whether positions are in degrees, if their size or speed suggests it.

    Unlike positions that :func:`.in_degrees` finds, a simulated arm may have such ones.
    """
    known = np.isfinite(robot.qd_max)
    fast = known & (speeds > IMPLAUSIBLE * robot.qd_max)
    bounded = np.isfinite(robot.q_min) & np.isfinite(robot.q_max) & (robot.q_max > robot.q_min)
    lower = np.where(bounded, robot.q_min, 0.0)
    upper = np.where(bounded, robot.q_max, 0.0)
    away = np.abs(q - 0.5 * (lower + upper))
    far = bounded & (away.max(axis=0) > 0.5 * IMPLAUSIBLE * (upper - lower))
    unit = "are positions in degrees, which --degrees converts, or times in another unit?"
    if fast.any():
        j = int(np.argmax(np.where(fast, speeds, 0.0)))
        yield (
            f"{robot.joint_names[j]} moves at {speeds[j]:.3g} rad/s or m/s, "
            f"{speeds[j] / robot.qd_max[j]:.2g} times the limit of {robot.name}: {unit}"
        )
    elif far.any():
        j = int(np.argmax(far))
        yield (
            f"{robot.joint_names[j]} is far beyond its range, at "
            f"{q[away[:, j].argmax(), j]:.4g}: {unit}"
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
