"""Units of recorded motion: numbers that suggest degrees, or times that are not seconds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import ConfigurationError
from ..robots.robot import Robot
from ..rows import Array
from ..simulation.units import degrees_question

SLOW = 1.0  #: Median period [s] from which on times seem to be in another unit.
#: The same, if in addition no joint is faster than the second number [rad/s or m/s].
SLOW_AND_STILL = 0.05, 5e-3
LONGEST_GAP = 3600.0  #: Time [s] between two samples from which on a clock was set.
#: Sentence on the units of times.
NAMED_UNITS = "They must be seconds; t_ms, t_us and t_ns name columns in other units"
#: Ratio of the motion by the given speeds to that of the positions, or its inverse, from which on
#: they contradict. Revolutions per minute are 9.55 times radians per second.
CONTRADICTION = 8.0
#: Cosine of given and differenced speeds below which their signs contradict. Noise of a joint at
#: rest, differenced and a sample late, has −0.5.
OPPOSITE = -0.8
MOVED = 1e-6  #: Length of the way of a joint from which on its speeds are checked [rad or m].
SUSTAINED = 0.1  #: Time over which a sustained speed is measured [s].
#: Sustained speed of a joint, as a multiple of the robot's own limit, and distance of a position
#: from the middle of its range, in half ranges, beyond which another unit is suspected.
IMPLAUSIBLE = 3.0


def require_radians(path: Path, robot: Robot, q: Array) -> None:
    """Raise ConfigurationError if positions (N, n) seem to be degrees."""
    farthest = q[np.abs(q).argmax(axis=0), np.arange(robot.n)]
    question = degrees_question(f"{path}: the largest position", robot, farthest)
    if question:
        raise ConfigurationError(f"{question} --degrees converts them")


def seconds(path: Path, t: Array) -> Array:
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


def require_speeds(path: Path, robot: Robot, t: Array, q: Array, qd: Array) -> None:
    """Raise ConfigurationError if speeds contradict the positions in size or in sign."""
    moved = np.diff(q, axis=0)
    told = 0.5 * (qd[1:] + qd[:-1]) * np.diff(t)[:, None]
    size = float(np.abs(moved).sum())
    ratio = float(np.abs(told).sum()) / size if size > 0.0 else 1.0
    if not 1.0 / CONTRADICTION < ratio < CONTRADICTION and size > MOVED:
        raise ConfigurationError(
            f"{path}: speeds are {ratio:.3g} times what the positions change: are they in degrees "
            "per second or in revolutions per minute, or the times in another unit?"
        )
    sizes = np.linalg.norm(told, axis=0) * np.linalg.norm(moved, axis=0)
    turned = ((told * moved).sum(axis=0) < OPPOSITE * sizes) & (np.abs(moved).sum(axis=0) > MOVED)
    if turned.any():
        joints = ", ".join(robot.joint_names[j] for j in np.flatnonzero(turned))
        raise ConfigurationError(
            f"{path}: speeds of {joints} have the opposite sign of the change of their positions: "
            "give both in the same direction"
        )


def sustained_speeds(t: Array, q: Array) -> Array:
    """Return the largest speed (n,) of each joint over :data:`SUSTAINED` [rad/s or m/s].

    One in a hundred of the intervals may be faster, as a glitch or a singularity may cause it.
    """
    period = float(np.median(np.diff(t)))
    width = min(max(1, round(SUSTAINED / period)), len(t) - 1)
    elapsed = (t[width:] - t[:-width])[:, None]
    speeds = np.abs(q[width:] - q[:-width]) / elapsed
    largest: Array = np.quantile(speeds, 0.99, axis=0, method="lower")
    return largest


def require_motion(path: Path, t: Array, speeds: Array) -> None:
    """Raise ConfigurationError if rare samples of a joint that hardly moves seem to be in ms."""
    period = float(np.median(np.diff(t)))
    rare, still = SLOW_AND_STILL
    if period >= rare and 0.0 < speeds.max() < still:
        raise ConfigurationError(
            f"{path}: samples are {period:.4g} s apart, and no joint is faster than "
            f"{speeds.max():.3g} rad/s or m/s: are the times in milliseconds? {NAMED_UNITS}"
        )


def unit_questions(robot: Robot, q: Array, speeds: Array) -> Iterator[str]:
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
