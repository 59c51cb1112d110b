"""Checks that a drawn scene must pass.

Start and goals must be reachable, allowed and visible, and the unconstrained baseline must violate
a row.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...constraints import JointSpeed
from ...controllers import Tracking
from ...errors import ConfigurationError, SceneError, VsconstraintsError
from ...robots.geometry import Pose
from ...rows import Array
from ...scenarios.build import build_scene
from ...scenarios.inverse_kinematics import inverse_kinematics, tip_of
from ...scenarios.reading import Table, from_table
from ...simulation import RunScores, Setup, score_run, until_settled
from ...simulation.occluders import LinesOfSight
from .drawing import Placed
from .placements import PLACEMENTS, Ends, Place

#: Least violation, relative to the row's range, at which a row counts as challenged: σ, or φ for
#: speeds. It is ten times what scores neglect, so that scores count the row as challenged, too.
CLEAR = 1e-3


class Reason(StrEnum):
    """Reason for rejecting an attempt.

    The checks are made in the order of the members, cheap ones first.
    """

    START_OUT_OF_REACH = "start out of reach"
    """No configuration within the joint ranges reaches the start pose of the camera."""
    #: as for the start; where the target moves, the goal is taken at the end of the run
    GOAL_OUT_OF_REACH = "goal out of reach"
    START_OUT_OF_RANGE = "start out of joint range"
    GOAL_OUT_OF_RANGE = "goal out of joint range"
    START_BEHIND = "marker behind the camera at the start"
    GOAL_BEHIND = "marker behind the camera at the goal"
    START_UNSEEN = "marker outside the image at the start"
    GOAL_UNSEEN = "marker outside the image at the goal"
    BUILD_REFUSED = "build refused"  #: the scenario of a condition cannot be built
    START_FORBIDDEN = "start forbidden"
    """A row is violated at the start: an obstacle, a collision, a range, the field of view."""
    GOAL_FORBIDDEN = "goal forbidden"
    START_HIDDEN = "marker hidden by the robot at the start"
    GOAL_HIDDEN = "marker hidden by the robot at the goal"
    START_REFUSED = "start refused"  #: the run cannot start for another reason
    #: the unconstrained baseline violates no row, so that laws cannot be compared
    NOT_CHALLENGED = "nothing challenged"
    #: in test sets only: such a scene would test the tracker
    BASELINE_LOST = "unconstrained baseline does not converge"
    #: with an image sensor: no law has a measurement to begin with
    START_UNDETECTED = "no tag in the first image"


class Rejected(Exception):
    """Rejection of an attempt, with its reason and details for a reader."""

    def __init__(self, reason: Reason, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else str(reason))
        self.reason = reason


def placed(tables: Table, where: str, folder: Path) -> tuple[Table, Ends]:
    """Return the tables with the values of their placements, and the configurations at the ends.

    Everything except placements has been drawn already. Raises Rejected if an end is out of reach
    or range, or if a marker is outside the image there. Raises ConfigurationError if the tables
    cannot be read.
    """
    scene = build_scene(tables, where, folder)
    nothing_placed = Ends(scene, [])
    start = _configuration(
        tables.get("q0"), nothing_placed, tables, f"{where}.q0", Reason.START_OUT_OF_REACH
    )
    ends = Ends(scene, [start])
    tables = {**tables, "q0": start.tolist()}
    task = tables.get("task")
    stated: Any = task.get("goals", []) if isinstance(task, Mapping) else None
    if isinstance(task, Mapping) and isinstance(stated, list):
        goals = []
        for i, goal in enumerate(stated):
            placed_goal, q = _goal(goal, ends, f"{where}.task.goals.{i}")
            goals.append(placed_goal)
            ends = Ends(scene, [*ends.q, q])
        tables["task"] = {**task, "goals": goals}
    _check_views(ends)
    filled: Table = _filled(tables, ends, {}, where)
    return filled, ends


def _goal(goal: Any, ends: Ends, where: str) -> tuple[Any, Array | None]:
    """Return a goal with the value of its placement, and the configuration there.

    The configuration is None if the goal is given by its image only.
    """
    if not isinstance(goal, Mapping):
        return goal, None
    if "camera_at_q" in goal:
        q = _configuration(
            goal["camera_at_q"], ends, goal, f"{where}.camera_at_q", Reason.GOAL_OUT_OF_REACH
        )
        return {**goal, "camera_at_q": q.tolist()}, q
    if "camera_pose" in goal:
        camera = from_table(Pose.from_xyz_rpy, goal["camera_pose"], f"{where}.camera_pose")
        tip = tip_of(ends.scene, camera)
        return goal, _reached(ends, tip, near=ends.q[0])
    return goal, None


def _reached(ends: Ends, tip: Pose, near: Array | None) -> Array:
    """Return the configuration near another one at which the tip has a pose."""
    assert near is not None  # only goals can be given by an image alone
    q = inverse_kinematics(ends.scene.robot, tip, near)
    if q is None:
        raise Rejected(Reason.GOAL_OUT_OF_REACH)
    return q


def _configuration(
    value: Any, ends: Ends, beside: Mapping[str, Any], where: str, reason: Reason
) -> Array:
    if isinstance(value, Placed):
        value = _value(value, ends, dict(beside), where)
        if value is None:
            raise Rejected(reason)
    return ends.scene.robot.configuration(value, where)


def _value(placed: Placed, ends: Ends, beside: Table, where: str) -> list[float] | None:
    context = {"place": Place(ends, beside, where)}
    return from_table(PLACEMENTS[placed.name], placed.table, where, context)


def _filled(tree: Any, ends: Ends, beside: Table, where: str) -> Any:
    """Return a tree of tables with values in place of the remaining placements."""
    if isinstance(tree, Placed):
        value = _value(tree, ends, beside, where)
        if value is None:
            raise ConfigurationError(
                f"{where}: {tree.name} is allowed only at q0 and at camera_at_q of goals"
            )
        return value
    if isinstance(tree, dict):
        table = {}
        for name, inner in tree.items():
            table[name] = _filled(inner, ends, tree, f"{where}.{name}")
        return table
    if isinstance(tree, list):
        entries = []
        for i, inner in enumerate(tree):
            entries.append(_filled(inner, ends, beside, f"{where}.{i}"))
        return entries
    return tree


class _EndReasons(NamedTuple):
    """Reasons for rejecting an attempt because of one of its ends."""

    out_of_range: Reason
    behind: Reason
    unseen: Reason


_START = _EndReasons(Reason.START_OUT_OF_RANGE, Reason.START_BEHIND, Reason.START_UNSEEN)
_GOAL = _EndReasons(Reason.GOAL_OUT_OF_RANGE, Reason.GOAL_BEHIND, Reason.GOAL_UNSEEN)


def _check_views(ends: Ends) -> None:
    """Raise Rejected unless all ends are in the ranges and all markers are visible there."""
    scene = ends.scene
    known = []
    for i, q in enumerate(ends.q):
        if q is not None:
            known.append((_START if i == 0 else _GOAL, q))
    for reasons, q in known:
        outside = scene.robot.outside_ranges(q)
        if outside:
            raise Rejected(reasons.out_of_range, outside[0])
    for reasons, q in known:
        camera = scene.camera_pose(q)
        try:
            pixels = scene.project(camera)
        except SceneError as error:
            raise Rejected(reasons.behind, str(error)) from error
        if not np.all(scene.camera.sees(pixels)):
            raise Rejected(reasons.unseen)


def check_ends(setup: Setup, ends: Ends) -> None:
    """Raise Rejected if a row is violated at the start or the last goal.

    The robot must not hide a marker there either.
    """
    duration = (setup.samples - 1) * setup.Ts
    _check_allowed(setup, setup.q0, 0.0, Reason.START_FORBIDDEN)
    end = _end(setup, ends, duration)
    if end is not None:
        _check_allowed(setup, end, duration, Reason.GOAL_FORBIDDEN)
    if setup.on_hidden_markers != "refuse":
        return
    try:
        lines = LinesOfSight(setup.scene)
    except ConfigurationError as error:
        raise ConfigurationError(
            f'{error}; on_hidden_markers = "continue" draws scenes without checking what the '
            "robot hides"
        ) from error
    _check_not_hidden(lines, setup.q0, 0.0, Reason.START_HIDDEN)
    if end is not None:
        _check_not_hidden(lines, end, duration, Reason.GOAL_HIDDEN)


def _end(setup: Setup, ends: Ends, duration: float) -> Array | None:
    """Return the configuration (n,) at the last goal after the duration [s].

    Return None if the goal is given by its image only. Raises Rejected if it is out of reach.
    """
    goal = setup.task.goals[-1].camera
    if goal is None:
        return None
    scene = ends.scene
    q = ends.q[-1]
    if q is not None and scene.motion is None:
        return q
    tip = tip_of(scene, goal)
    if scene.motion is not None:
        tip = scene.motion.pose(duration) @ tip
    return _reached(ends, tip, near=ends.q[0] if q is None else q)


def _check_not_hidden(lines: LinesOfSight, q: Array, t: float, reason: Reason) -> None:
    """Raise Rejected if the robot hides a marker at q (n,) and time t [s]."""
    hidden = lines.hidden(q[None], [t])[0]
    if hidden:
        marker, solid = hidden[0]
        raise Rejected(reason, f"marker {marker} by {solid}")


def _check_allowed(setup: Setup, q: Array, t: float, reason: Reason) -> None:
    """Raise Rejected if a row is violated at rest at q (n,) and time t [s]."""
    try:
        evaluation = setup.world().evaluate(t, q, np.zeros_like(q))
    except SceneError as error:
        raise Rejected(reason, str(error)) from error
    violated = np.flatnonzero(evaluation.sigma > 0.0)
    if len(violated):
        raise Rejected(reason, setup.constraints.labels[violated[0]])


def check_first_image(setup: Setup) -> None:
    """Raise Rejected if the sensor detects no tag in the first image; other sensors pass."""
    if setup.images is None:
        return
    sensor = setup.sensor()
    if sensor.renders:
        try:
            sensor.measured(0, setup.q0, setup.qd0)
        except SceneError as error:
            raise Rejected(Reason.START_UNDETECTED, str(error)) from error


def violated_by_tracking(setup: Setup) -> tuple[str, ...]:
    """Return the labels of the rows that the unconstrained baseline violates.

    Raises Rejected if it violates none or cannot start.
    """
    scores = _track(setup)
    violated = np.flatnonzero(scores.sigma_max > CLEAR * setup.constraints.scale)
    if not len(violated):
        raise Rejected(Reason.NOT_CHALLENGED)
    return tuple(scores.labels[row] for row in violated)


def check_baseline(setup: Setup) -> None:
    """Raise Rejected unless the unconstrained baseline converges within every law's time limit."""
    if _track(until_settled(setup)).status != "converged":
        raise Rejected(Reason.BASELINE_LOST)


def share_to_hold(setup: Setup) -> float:
    """Largest share of the actuators' capacity needed to satisfy a row that the baseline reaches.

    It is evaluated where the unconstrained baseline meets the row's boundary. NaN without limits,
    or if no row is met; see :class:`vsconstraints.simulation.Trajectory`.
    """
    if not setup.limits.any:
        return np.nan
    shares = _track(setup).share_to_hold
    if not np.isfinite(shares).any():
        return np.nan
    return float(np.nanmax(shares))


def _track(setup: Setup) -> RunScores:
    try:
        return score_run(setup, Tracking())
    except VsconstraintsError as error:
        raise Rejected(Reason.START_REFUSED, str(error)) from error


def rest_to_rest(distance: Array, acceleration: Array, speed: Array) -> Array:
    """Return the least time from rest to rest of each joint (n,) [s], taken independently.

    The time is d/w + w/a with the peak speed w = min(v, √(a d)). Distances d ≥ 0 [rad or m] and
    limits a > 0 [rad/s² or m/s²] and v > 0 [rad/s or m/s] are (n,); a missing limit is infinite.
    """
    peak = np.minimum(speed, np.sqrt(acceleration * distance))
    # a joint that need not move, or has no limits, needs no time
    is_moving = (distance > 0.0) & np.isfinite(peak)
    peak = np.where(is_moving, peak, 1.0)
    time = distance / peak + peak / acceleration
    return np.where(is_moving, time, 0.0)


def least_time(setup: Setup, ends: Ends) -> float:
    """Return the least time from rest at the start to rest at the last goal's configuration [s].

    It is the time of the slowest joint. Each joint keeps the actuators' acceleration limit. Its
    speed is limited by the joint-speed rows with their sampling band, and by the robot's own limits
    where these are enforced. Jerk limits, obstacles and the image would add to the time.
    Continuous joints go to the goal's configuration as it is stated: turning the other way may be
    shorter.

    NaN without actuator limits, if the robot does not start at rest, or if the goal does not
    determine the configuration: it is given by its image only, the target moves, or the arm is
    redundant.
    """
    robot = setup.scene.robot
    goal = ends.q[-1]
    if goal is None or ends.scene.motion is not None:
        return math.nan
    if not setup.limits.any or np.any(setup.qd0):
        return math.nan
    time = setup.task.goals[-1].from_time
    evaluation = setup.world().evaluate(time, goal, np.zeros(robot.n))
    if np.linalg.matrix_rank(evaluation.task.J) < robot.n:
        return math.nan
    # not Robot.difference: stored scenes of the test set have this time, of a fixed definition
    way = goal - setup.q0
    acceleration = setup.limits.of_joint("acceleration", robot.n)
    times = rest_to_rest(np.abs(way), acceleration, _speed_limits(setup, way))
    return float(times.max())


def _speed_limits(setup: Setup, way: Array) -> Array:
    """Return the speed limits (n,) in the directions of a way (n,); infinite without limits."""
    robot = setup.scene.robot
    speed = np.full(robot.n, np.inf)
    if setup.limits.ranges:
        speed = robot.qd_max.copy()
    for rows in setup.constraints.constraints:
        if isinstance(rows, JointSpeed):
            joints = np.array(rows.joints) - 1
            # the share of a limit up to which scores count a speed as allowed
            share = 1.0 - rows.margin + setup.Ts * rows.switching_gain
            limit = np.where(way[joints] > 0.0, rows.upper, -rows.lower)
            speed[joints] = np.minimum(speed[joints], share * limit)
    return speed
