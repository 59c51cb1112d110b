"""Warnings about numbers of a setup that suggest another unit or another camera.

Each check yields sentences that end in a question: "degrees?", "mm?", "Hz?". Bounds are far beyond
the values of the shipped scenarios and of the arms of example-robot-data, so that correct numbers
raise no warning.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..constraints import ConstraintSet, JointRange, JointSpeed
from ..robots.limits import ActuatorLimits
from ..robots.robot import Robot
from ..rows import Array, BoolArray
from ..rows.readable import counted
from ..vision.camera import Camera
from ..vision.scene import Scene
from ..vision.tracking import TrackingGains, VisualTask

#: Field of view above which the focal length may be in another unit [deg]; fisheye lenses reach
#: 130°.
MAX_VIEW = 150.0
#: Distance between markers above which millimetres are suspected [m].
MAX_LENGTH = 3.0
#: Size of an arm, and distance of the target from it, above which millimetres are suspected [m].
FAR = 20.0
#: Joint coordinate above which degrees are suspected [rad]: two turns. Values above ``MANY_TURNS``
#: are placeholders, or belong to joints that turn more often.
TWO_TURNS = 4.0 * np.pi
MANY_TURNS = 1000.0
#: Speed and acceleration of a revolute joint above which degrees are suspected [rad/s, rad/s²].
FAST = 60.0
FASTEST_CHANGE = 600.0
#: Largest plausible speed of a row, as a multiple of the robot's own limit.
BEYOND_ROBOT = 2.0
#: Sampling times above which another unit, and from which a rate in Hz, is suspected [s].
SLOW = 0.1
RATE = 20.0
#: Largest plausible change of φ by u⁺ in one sampling period, as a share of the allowed range.
WHOLE_RANGE = 1.0


def unit_warnings(
    scene: Scene,
    constraints: ConstraintSet,
    task: VisualTask,
    limits: ActuatorLimits,
    q0: Array,
    Ts: float,
) -> list[str]:
    """Return warnings about numbers that suggest another unit or another camera.

    Each warning is one sentence.
    """
    robot = scene.robot
    camera = scene.camera
    return [
        *_of_camera(camera),
        *_of_sampling(task.gains, constraints, Ts),
        *_of_lengths(scene, q0),
        *_of_depths(task),
        *_of_robot(robot, limits),
        *_of_joint_rows(constraints, robot),
        *_of_configurations(robot, task, q0),
    ]


def unit_warnings_at(scene: Scene, what: str, q: Array) -> list[str]:
    """Return the warnings for a scene alone.

    The scene is seen from coordinates ``q`` (n,), which the sentences call ``what``.
    """
    warnings = [*_of_camera(scene.camera), *_of_lengths(scene, q)]
    question = degrees_question(what, scene.robot, q)
    if question:
        warnings.append(question)
    return warnings


def in_degrees(robot: Robot, q: Array) -> BoolArray:
    """Return (n,) flags of the coordinates ``q`` (n,) that look like degrees.

    Only revolute joints can look so: beyond one turn and outside the joint's range, or beyond two
    turns if the joint has no range.
    """
    outside = (q < robot.q_min) | (q > robot.q_max)
    unbounded = ~(np.isfinite(robot.q_min) & np.isfinite(robot.q_max))
    turned = np.abs(q)
    far_outside = outside & (turned > 2.0 * np.pi)
    far = unbounded & (turned > TWO_TURNS)
    suspect = far_outside | far
    return np.asarray(suspect & ~_prismatic(robot))


def degrees_question(what: str, robot: Robot, q: Array) -> str:
    """Return the question whether coordinates (n,) are in degrees.

    The question is empty if they do not look like it.
    """
    numbers = np.flatnonzero(in_degrees(robot, q))
    if not len(numbers):
        return ""
    named = ", ".join(f"{q[j]:.4g} of joint {j + 1}" for j in numbers)
    return f"{what} has {named}: are these degrees, not rad?"


def _prismatic(robot: Robot) -> BoolArray:
    return np.array(robot.prismatic, dtype=np.bool_)


def _beyond(limits: Array, most: float) -> BoolArray:
    """Return (n,) flags of positive limits above ``most``, except for powers of ten.

    Powers of ten are placeholders for unlimited joints.
    """
    tens = np.log10(np.where(np.isfinite(limits), limits, 1.0))
    placeholder = np.abs(tens - np.rint(tens)) < 1e-9
    return np.asarray(np.isfinite(limits) & (limits > most) & ~placeholder)


def _joints(robot: Robot, chosen: BoolArray) -> str:
    numbers = np.flatnonzero(chosen)
    named = ", ".join(f"{j + 1} ({robot.joint_names[j]})" for j in numbers)
    return f"joint {named}" if len(numbers) == 1 else f"joints {named}"


# --- checks, by kind of number ---


def _of_camera(camera: Camera) -> Iterator[str]:
    half_size = 0.5 * np.asarray(camera.size)
    half_view = np.arctan(half_size / np.asarray(camera.focal))
    view = 2.0 * np.degrees(half_view)
    if view.max() > MAX_VIEW:
        focal = " and ".join(dict.fromkeys(f"{F:.4g}" for F in camera.focal))
        yield (
            f"the camera's field of view is {view.max():.0f}°: is the focal length {focal} in "
            f"mm, not px?"
        )
    yield from camera.doubts


def _of_sampling(gains: TrackingGains, constraints: ConstraintSet, Ts: float) -> Iterator[str]:
    damping = gains.damping * np.sqrt(gains.Kp0) * Ts
    unit = "a rate in Hz, or in ms, not s" if Ts >= RATE else "in ms, not s"
    if damping > 2.0:
        yield (
            f"K_v T_s is {damping:.3g}, and beyond 2 sampled tracking is unstable: is the "
            f"sampling time {Ts:g} {unit}?"
        )
        return
    if Ts > SLOW:
        yield f"the sampling time {Ts:g} s means {1.0 / Ts:.3g} commands a second: is it {unit}?"
        return
    band = Ts * constraints.switching_gain / constraints.scale
    beyond = band > WHOLE_RANGE
    if beyond.any():
        i = int(np.argmax(band))
        others = int(beyond.sum()) - 1
        more = f", as in {counted(others, 'other row')}" if others else ""
        yield (
            f"u⁺ = {constraints.switching_gain[i]:g} of {constraints.labels[i]} moves φ by "
            f"{band[i]:.3g} times the "
            f"whole allowed range in one sampling period of {Ts:g} s{more}: is the switching gain "
            f"too large, or meant "
            "for another unit?"
        )


def _of_lengths(scene: Scene, q0: Array) -> Iterator[str]:
    camera = scene.camera
    extent = float(np.ptp(scene.markers, axis=0).max())
    if extent > MAX_LENGTH:
        yield f"the target's markers are {extent:.3g} m apart: are its coordinates in mm, not m?"
    away = float(np.linalg.norm(scene.markers.mean(axis=0)))
    if away > FAR:
        place = "the robot's base" if camera.fixed is None else "the arm's tip"
        yield (
            f"the target's markers are {away:.3g} m from {place}: are their coordinates in mm, "
            f"not m?"
        )
    slides = _prismatic(scene.robot)
    retracted = np.where(slides, 0.0, q0)
    tip = scene.robot.pose(retracted)
    reach = float(np.linalg.norm(tip.t))
    if reach > FAR:
        yield (
            f"the arm's tip is {reach:.3g} m from its base: are the arm's dimensions in mm, not m?"
        )
    slid = np.abs(q0[slides])
    if (slid > FAR).any():
        yield f"a prismatic joint is at {slid.max():.4g} m: is it in mm, not m?"


def _of_depths(task: VisualTask) -> Iterator[str]:
    for number, goal in enumerate(task.goals, start=1):
        # for a goal given by joint coordinates, the target or the arm is what may be far
        if goal.q is None and goal.depth is not None and goal.depth.max() > FAR:
            yield (
                f"goal {number} has the markers {goal.depth.max():.3g} m from the camera: is "
                f"that in mm, not m?"
            )


def _of_robot(robot: Robot, limits: ActuatorLimits) -> Iterator[str]:
    turning = ~_prismatic(robot)
    known_ends = []
    for end in (robot.q_min, robot.q_max):
        known = np.where(np.isfinite(end), end, 0.0)
        known_ends.append(np.abs(known))
    ends = np.maximum(*known_ends)
    wide = turning & (ends > TWO_TURNS) & (ends <= MANY_TURNS)
    if wide.any():
        yield (
            f"the range of {_joints(robot, wide)} of {robot.name} is up to {ends[wide].max():.4g} "
            f"rad, "
            f"{ends[wide].max() / (2.0 * np.pi):.3g} turns: are these degrees, not rad?"
        )
    far = ~turning & (ends > FAR) & (ends <= MANY_TURNS * FAR)
    if far.any():
        yield (
            f"the range of {_joints(robot, far)} of {robot.name} is up to {ends[far].max():.4g} "
            f"m: is it in mm, not m?"
        )
    fast = turning & _beyond(robot.qd_max, FAST)
    if fast.any():
        speed = robot.qd_max[fast].max()
        yield (
            f"the speed of {_joints(robot, fast)} of {robot.name} is up to {speed:.4g} rad/s: are "
            f"these "
            "degrees per second, not rad/s?"
        )
    fixed = robot.q_min == robot.q_max
    if fixed.any():
        yield (
            f"{_joints(robot, fixed)} of {robot.name} cannot move: its range is a single point, "
            f"[{robot.q_min[fixed][0]:g}, {robot.q_max[fixed][0]:g}]: is a range missing in the "
            f"file, or is it to be "
            "locked?"
        )
    acceleration = limits.of_joint("acceleration", robot.n)
    steep = turning & _beyond(acceleration, FASTEST_CHANGE)
    if steep.any():
        yield (
            f"the limit of acceleration of {_joints(robot, steep)} is "
            f"{acceleration[steep].max():.4g} rad/s²: are "
            "these degrees, not rad?"
        )


def _of_joint_rows(constraints: ConstraintSet, robot: Robot) -> Iterator[str]:
    """Check ranges and speeds that a scenario gives in place of the robot's."""
    for rows in constraints.constraints:
        if not isinstance(rows, JointRange | JointSpeed):
            continue
        joints = np.array(rows.joints) - 1
        turning = ~_prismatic(robot)[joints]
        greatest = np.maximum(np.abs(rows.lower), np.abs(rows.upper))
        if isinstance(rows, JointRange):
            of_robot = np.maximum(np.abs(robot.q_min[joints]), np.abs(robot.q_max[joints]))
            known = np.where(np.isfinite(of_robot), of_robot, 0.0)
            wide = turning & (greatest > TWO_TURNS) & (greatest > known)
            unit = "rad"
            suspected = "degrees"
        else:
            of_robot = robot.qd_max[joints]
            wide = turning & (
                greatest > np.where(np.isfinite(of_robot), BEYOND_ROBOT * of_robot, FAST)
            )
            unit = "rad/s"
            suspected = "degrees per second"
        if wide.any():
            i = int(np.argmax(np.where(wide, greatest, 0.0)))
            robots = (
                f", and that of {robot.name} is {of_robot[i]:.4g}"
                if np.isfinite(of_robot[i])
                else ""
            )
            yield (
                f"the {rows.kind} that a row allows joint {rows.joints[i]} is {greatest[i]:.4g} "
                f"{unit}{robots}: are "
                f"these {suspected}, not {unit}?"
            )


def _of_configurations(robot: Robot, task: VisualTask, q0: Array) -> Iterator[str]:
    named = [("q0", q0)]
    named += [
        (f"goal {number}", goal.q)
        for number, goal in enumerate(task.goals, 1)
        if goal.q is not None
    ]
    for what, q in named:
        question = degrees_question(what, robot, q)
        if question:
            yield question
