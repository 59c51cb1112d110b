"""Units of recorded motion: numbers that suggest degrees, or times that are not seconds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import ConfigurationError
from ..robots.robot import Robot
from ..rows import Array, BoolArray
from ..simulation.units import degrees_question

#: Sustained speed of a recorded motion, as a multiple of the robot's own limit, and distance of a
#: position from the middle of its range, in half ranges, beyond which another unit is suspected.
IMPLAUSIBLE = 3.0
SLOW = 1.0  #: Median period [s] from which on times seem to be in another unit.
#: The same, if in addition no joint is faster than :data:`STILL` [rad/s or m/s].
SLOW_IF_STILL = 0.05
STILL = 5e-3
AT_REST = 2e-3  #: Range of a joint at rest with the noise of its encoder [rad or m].
#: Similarity of successive steps from which on motion is steady: 1 for equal ones, and about −0.5
#: for white noise.
STEADY = 0.5
LONGEST_GAP = 3600.0  #: Time [s] between two samples from which on a clock was set.
#: Sentence on the units of times.
NAMED_UNITS = "A column t_s, t_ms, t_us or t_ns states the unit"
#: Ratio of the motion by the given speeds to that of the positions, or its inverse, from which on
#: they contradict. Revolutions per minute are 9.55 times radians per second.
CONTRADICTION = 8.0
#: Cosine of given and differenced speeds below which their signs contradict. Noise of a joint at
#: rest, differenced and a sample late, has −0.5.
OPPOSITE = -0.8
#: Path length above which speeds are checked [rad or m]: their size by that of all joints together,
#: the sign of each joint's by its own.
LEAST_PATH_LENGTH = 1e-6
SUSTAINED = 0.1  #: Time over which a sustained speed is measured [s].


def require_radians(path: Path, robot: Robot, q: Array) -> None:
    """Raise ConfigurationError if positions (N, n) seem to be degrees."""
    farthest_samples = np.abs(q).argmax(axis=0)
    farthest = q[farthest_samples, np.arange(robot.n)]
    question = degrees_question(f"{path}: the largest position", robot, farthest)
    if question:
        raise ConfigurationError(f"{question} --degrees converts them")


def require_seconds(path: Path, t: Array, unit_stated: bool = False) -> None:
    """Raise ConfigurationError if increasing times (N,) cannot be seconds.

    Their unit is not questioned if the file states it.
    """
    if len(t) < 2:
        raise ConfigurationError(
            f"{path}: all samples have the same time: record that of each; for a bag whose headers "
            "have no stamps, --clock log takes the times of recording"
        )
    steps = np.diff(t)
    period = float(np.median(steps))
    if period >= SLOW and not unit_stated:
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


def require_speeds(path: Path, robot: Robot, t: Array, q: Array, qd: Array) -> None:
    """Raise ConfigurationError if speeds contradict the positions in size or in sign.

    Samples have times ``t`` (N,), positions ``q`` (N, n) and speeds ``qd`` (N, n).
    """
    moved = np.diff(q, axis=0)
    mean_speed = 0.5 * (qd[1:] + qd[:-1])
    by_speed = mean_speed * np.diff(t)[:, None]
    path_lengths = np.abs(moved).sum(axis=0)
    total = float(path_lengths.sum())
    ratio = float(np.abs(by_speed).sum()) / total if total > LEAST_PATH_LENGTH else 1.0
    if not 1.0 / CONTRADICTION < ratio < CONTRADICTION:
        raise ConfigurationError(
            f"{path}: speeds are {ratio:.3g} times what the positions change: are they in degrees "
            "per second or in revolutions per minute, or the times in another unit?"
        )
    product = (by_speed * moved).sum(axis=0)
    sizes = np.linalg.norm(by_speed, axis=0) * np.linalg.norm(moved, axis=0)
    turned = (product < OPPOSITE * sizes) & (path_lengths > LEAST_PATH_LENGTH)
    if turned.any():
        joints = ", ".join(robot.joint_names[j] for j in np.flatnonzero(turned))
        raise ConfigurationError(
            f"{path}: speeds of {joints} have the opposite sign of the change of their positions: "
            "give both in the same direction"
        )


def sustained_speeds(t: Array, q: Array) -> Array:
    """Return the largest speed (n,) of each joint over :data:`SUSTAINED` [rad/s or m/s].

    ``q`` (N, n) are the positions at the times ``t`` (N,). One in a hundred of the intervals may be
    faster, as a glitch or a singularity may cause it.
    """
    period = float(np.median(np.diff(t)))
    samples = max(1, round(SUSTAINED / period))
    width = min(samples, len(t) - 1)
    elapsed = (t[width:] - t[:-width])[:, None]
    speeds = np.abs(q[width:] - q[:-width]) / elapsed
    largest: Array = np.quantile(speeds, 0.99, axis=0, method="lower")
    return largest


def time_questions(path: Path, robot: Robot, t: Array, q: Array, speeds: Array) -> Iterator[str]:
    """Yield the question whether times are milliseconds, for rare samples of slow joints.

    ``q`` (N, n) are the positions at the times ``t`` (N,), and ``speeds`` (n,) those of
    :func:`sustained_speeds`. Raises ConfigurationError if that is
    likely: a joint moves steadily, and a thousand times its speed is a speed of the robot. An arm
    at rest moves as slowly, but only by the noise of its encoders.
    """
    period = float(np.median(np.diff(t)))
    if period < SLOW_IF_STILL or not 0.0 < speeds.max() < STILL:
        return
    question = (
        f"samples are {period:.4g} s apart, and no joint is faster than {speeds.max():.3g} rad/s "
        f"or m/s: are the times in milliseconds? {NAMED_UNITS}"
    )
    possible = (1e3 * speeds <= IMPLAUSIBLE * robot.qd_max).all()
    if possible and moves_steadily(q).any():
        raise ConfigurationError(f"{path}: {question}")
    yield question


def moves_steadily(q: Array) -> BoolArray:
    """Return (n,) flags of joints that move farther than a joint at rest, and in steady steps.

    ``q`` (N, n) are their positions. Two successive steps of a motion that is sampled often are
    alike, and those of noise are not.
    """
    steps = np.diff(q, axis=0)
    first = steps[:-1]
    second = steps[1:]
    product = (first * second).sum(axis=0)
    squares = first * first + second * second
    size = squares.sum(axis=0)
    alike = 2.0 * product > STEADY * size
    far = np.ptp(q, axis=0) > AT_REST
    return np.asarray(far & alike)


def motion_questions(robot: Robot, q: Array, speeds: Array) -> Iterator[str]:
    """Yield the question whether a recorded motion is in another unit, by its speed or range.

    ``q`` (N, n) are its positions and ``speeds`` (n,) its sustained speeds. Unlike positions
    that seem to be degrees, these may also occur in a simulation, so that they are not refused.
    """
    unit = "are positions in degrees, which --degrees converts, or times in another unit?"
    fast = np.isfinite(robot.qd_max) & (speeds > IMPLAUSIBLE * robot.qd_max)
    if fast.any():
        j = int(np.argmax(np.where(fast, speeds, 0.0)))
        times = speeds[j] / robot.qd_max[j]
        yield (
            f"{robot.joint_names[j]} moves at {speeds[j]:.3g} rad/s or m/s, {times:.2g} times the "
            f"limit of {robot.name}: {unit}"
        )
        return
    for j, joint in enumerate(robot.joint_names):
        lower = robot.q_min[j]
        upper = robot.q_max[j]
        if not -np.inf < lower < upper < np.inf:
            continue
        away = np.abs(q[:, j] - 0.5 * (lower + upper))
        farthest = int(away.argmax())
        if away[farthest] > 0.5 * IMPLAUSIBLE * (upper - lower):
            yield f"{joint} is far beyond its range, at {q[farthest, j]:.4g}: {unit}"
            return
