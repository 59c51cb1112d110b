"""What an attempt at a scene must pass: ends that are reachable, allowed and seen, and something to
compare.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from ...constraints import JointSpeed
from ...controllers import Tracking
from ...errors import ConfigurationError, SceneError, VsconstraintsError
from ...robots.geometry import Pose
from ...rows import Array
from ...simulation import RunScores, Setup, score_run, until_settled
from ...simulation.image_sensor import ImageSensor
from ...simulation.occluders import LinesOfSight
from ..build import build_scene
from ..reading import Table, from_table
from .drawing import Placed
from .placements import PLACEMENTS, Ends, Place, inverse_kinematics, tip_of

#: Least σ, or φ of speeds, relative to its range, from which on tracking alone violates a row: ten
#: times what scores neglect, so that what is challenged here is challenged there.
CLEAR = 1e-3


class Reason(StrEnum):
    """Why an attempt is rejected: the checks' names, in the order in which they are made, the cheap
    ones first.
    """

    START_OUT_OF_REACH = "start out of reach"
    """No joint coordinates within the ranges put the camera where it shall start."""
    #: the same of a goal; where the target moves, of where the goal is at last
    GOAL_OUT_OF_REACH = "goal out of reach"
    START_OUT_OF_RANGE = "start out of joint range"
    GOAL_OUT_OF_RANGE = "goal out of joint range"
    START_BEHIND = "marker behind the camera at the start"
    GOAL_BEHIND = "marker behind the camera at the goal"
    START_UNSEEN = "marker outside the image at the start"
    GOAL_UNSEEN = "marker outside the image at the goal"
    BUILD_REFUSED = "build refused"  #: the scenario of one of the conditions cannot be built
    START_FORBIDDEN = "start forbidden"
    """A row is violated at the start: an obstacle, a collision, a range, the field of view."""
    GOAL_FORBIDDEN = "goal forbidden"
    START_HIDDEN = "marker hidden by the robot at the start"
    GOAL_HIDDEN = "marker hidden by the robot at the goal"
    START_REFUSED = "start refused"  #: anything else for which a run cannot start
    #: tracking alone violates no row: there is nothing to compare
    NOT_CHALLENGED = "nothing challenged"
    #: in a test set: it would test the tracker
    BASELINE_LOST = "unconstrained baseline does not converge"
    #: in a condition by images no law has anything to begin with
    START_UNDETECTED = "no tag in the first image"


class Rejected(Exception):
    """An attempt is given up for a reason, with details for a reader."""

    def __init__(self, reason: Reason, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else str(reason))
        self.reason = reason


def placed(tables: Table, where: str, folder: Path) -> tuple[Table, Ends]:
    """Tables, drawn but for placements, with values for these, and where the robot is at the
    scene's ends.

    Raises Rejected if an end is out of reach or range, or a marker is not in the image there;
    ConfigurationError if the tables cannot be read.
    """
    scene = build_scene(tables, where, folder)
    start = _configuration(
        tables.get("q0"), Ends(scene, []), tables, f"{where}.q0", Reason.START_OUT_OF_REACH
    )
    ends = Ends(scene, [start])
    tables = {**tables, "q0": start.tolist()}
    task = tables.get("task")
    goals = task.get("goals", []) if isinstance(task, Mapping) else []
    if isinstance(task, Mapping) and isinstance(goals, list):
        known = []
        for i, goal in enumerate(goals):
            goal, q = _goal(goal, ends, f"{where}.task.goals.{i}")
            known.append(goal)
            ends = Ends(scene, [*ends.q, q])
        tables["task"] = {**task, "goals": known}
    _check_views(ends)
    filled: Table = _filled(tables, ends, {}, where)
    return filled, ends


def _goal(goal: Any, ends: Ends, where: str) -> tuple[Any, Array | None]:
    """A goal with its placement's value, and the joint coordinates there; None if it says its image
    only.
    """
    if isinstance(goal, Mapping) and "camera_at_q" in goal:
        q = _configuration(
            goal["camera_at_q"], ends, goal, f"{where}.camera_at_q", Reason.GOAL_OUT_OF_REACH
        )
        return {**goal, "camera_at_q": q.tolist()}, q
    if isinstance(goal, Mapping) and "camera_pose" in goal:
        camera = from_table(Pose.from_xyz_rpy, goal["camera_pose"], f"{where}.camera_pose")
        return goal, _reached(ends, tip_of(ends.scene, camera), ends.q[0])
    return goal, None


def _reached(ends: Ends, tip: Pose, near: Array | None) -> Array:
    assert near is not None  # only goals may say their image only
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
    return from_table(
        PLACEMENTS[placed.name], placed.table, where, {"place": Place(ends, beside, where)}
    )


def _filled(tree: Any, ends: Ends, beside: Table, where: str) -> Any:
    """Everything in it with the values of the placements that are left."""
    if isinstance(tree, Placed):
        value = _value(tree, ends, beside, where)
        if value is None:
            raise ConfigurationError(
                f"{where}: {tree.name} stands at q0 and at camera_at_q of goals"
            )
        return value
    if isinstance(tree, dict):
        return {name: _filled(inner, ends, tree, f"{where}.{name}") for name, inner in tree.items()}
    if isinstance(tree, list):
        return [_filled(inner, ends, beside, f"{where}.{i}") for i, inner in enumerate(tree)]
    return tree


def _check_views(ends: Ends) -> None:
    scene = ends.scene
    known = [(min(i, 1), q) for i, q in enumerate(ends.q) if q is not None]
    for at, q in known:
        outside = scene.robot.outside_ranges(q)
        if outside:
            raise Rejected((Reason.START_OUT_OF_RANGE, Reason.GOAL_OUT_OF_RANGE)[at], outside[0])
    for at, q in known:
        try:
            seen = scene.camera.sees(scene.project(scene.camera_pose(q)))
        except SceneError as error:
            raise Rejected((Reason.START_BEHIND, Reason.GOAL_BEHIND)[at], str(error)) from error
        if not np.all(seen):
            raise Rejected((Reason.START_UNSEEN, Reason.GOAL_UNSEEN)[at])


def check_ends(setup: Setup, ends: Ends) -> None:
    """Raise Rejected if a row is violated at the start or the last goal, or the robot hides a
    marker there.
    """
    duration = (setup.samples - 1) * setup.Ts
    goal = setup.task.goals[-1].camera
    end = None
    _check_allowed(setup, setup.q0, 0.0, Reason.START_FORBIDDEN)
    if goal is not None:
        scene = ends.scene
        near = ends.q[-1] if ends.q[-1] is not None else ends.q[0]
        end = ends.q[-1]
        if end is None or scene.motion is not None:
            tip = tip_of(scene, goal)
            end = _reached(
                ends, tip if scene.motion is None else scene.motion.pose(duration) @ tip, near
            )
        _check_allowed(setup, end, duration, Reason.GOAL_FORBIDDEN)
    if setup.on_hidden_markers != "refuse":
        return
    try:
        lines = LinesOfSight(setup.scene)
    except ConfigurationError as error:
        raise ConfigurationError(
            f'{error}; on_hidden_markers = "continue" draws scenes without a look at what the '
            f"robot hides"
        ) from error
    for q, t, reason in ((setup.q0, 0.0, Reason.START_HIDDEN), (end, duration, Reason.GOAL_HIDDEN)):
        hidden = [] if q is None else lines.hidden(q[None], [t])[0]
        if hidden:
            raise Rejected(reason, f"marker {hidden[0][0]} by {hidden[0][1]}")


def _check_allowed(setup: Setup, q: Array, t: float, reason: Reason) -> None:
    try:
        sigma = setup.world().evaluate(t, q, np.zeros_like(q)).sigma
    except SceneError as error:
        raise Rejected(reason, str(error)) from error
    violated = np.flatnonzero(sigma > 0.0)
    if len(violated):
        raise Rejected(reason, setup.constraints.labels[violated[0]])


def check_first_image(setup: Setup) -> None:
    """Raise Rejected if the control sees images, and none of its tags in the first one."""
    sensor = setup.sensor() if setup.images is not None else None
    if isinstance(sensor, ImageSensor):
        try:
            sensor.measured(0, setup.q0, setup.qd0)
        except SceneError as error:
            raise Rejected(Reason.START_UNDETECTED, str(error)) from error


def violated_by_tracking(setup: Setup) -> tuple[str, ...]:
    """Labels of the rows that tracking alone violates; raises Rejected if there is none, or it
    cannot start.
    """
    scores = _track(setup)
    violated = scores.sigma_max > CLEAR * setup.constraints.scale
    challenged = tuple(label for label, row in zip(scores.labels, violated, strict=True) if row)
    if not challenged:
        raise Rejected(Reason.NOT_CHALLENGED)
    return challenged


def check_baseline(setup: Setup) -> None:
    """Raise Rejected unless tracking alone converges in the time that every law is given."""
    if _track(until_settled(setup)).status != "converged":
        raise Rejected(Reason.BASELINE_LOST)


def share_to_hold(setup: Setup) -> float:
    """The greatest share of all that the actuators can do that it takes to satisfy a row where
    tracking alone meets it.

    NaN without limits, or where no row is met; see :class:`vsconstraints.simulation.Trajectory`.
    """
    shares = _track(setup).share_to_hold if setup.limits.any else np.empty(0)
    return float(np.nanmax(shares)) if np.isfinite(shares).any() else np.nan


def _track(setup: Setup) -> RunScores:
    try:
        return score_run(setup, Tracking())
    except VsconstraintsError as error:
        raise Rejected(Reason.START_REFUSED, str(error)) from error


def rest_to_rest(distance: Array, acceleration: Array, speed: Array) -> Array:
    """(n,) least time from rest to rest of joints by themselves [s]: d/w + w/a with the peak speed
    w = min(v, √(a d)).

    Distances d ≥ 0 [rad or m], limits a > 0 [rad/s² or m/s²] and v > 0 [rad/s or m/s] are (n,);
    infinite where there is none.
    """
    w = np.minimum(speed, np.sqrt(acceleration * distance))
    # a joint that need not move, or is without any limit, is there at once
    moving = (distance > 0.0) & np.isfinite(w)
    w = np.where(moving, w, 1.0)
    return np.where(moving, distance / w + w / acceleration, 0.0)


def least_time(setup: Setup, ends: Ends) -> float:
    """Least time from rest at the start to rest at the joint coordinates of the last goal [s].

    It is that of the slowest joint: each keeps the actuators' limit of acceleration, and of speeds
    what the rows of joint speeds leave with their sampling band, or the robot's own where limits
    keep it. Jerk, obstacles and the image take more.

    NaN without limits of actuators, where the robot does not start at rest, and where the goal is
    not one place of the joints: it is known by its image alone, the target moves, or joints are
    left free by it (a redundant arm).
    """
    robot = setup.scene.robot
    goal = ends.q[-1]
    if goal is None or ends.scene.motion is not None or not setup.limits.any or np.any(setup.qd0):
        return math.nan
    there = setup.world().evaluate(setup.task.goals[-1].from_time, goal, np.zeros(robot.n))
    if np.linalg.matrix_rank(there.task.J) < robot.n:
        return math.nan
    way = goal - setup.q0
    speed = robot.qd_max.copy() if setup.limits.ranges else np.full(robot.n, np.inf)
    for rows in setup.constraints.constraints:
        if isinstance(rows, JointSpeed):
            at = np.array(rows.joints) - 1
            # the share of a limit up to which scores count a speed as allowed
            share = 1.0 - rows.margin + setup.Ts * rows.switching_gain
            speed[at] = np.minimum(
                speed[at], share * np.where(way[at] > 0.0, rows.upper, -rows.lower)
            )
    return float(
        rest_to_rest(np.abs(way), setup.limits.of_joint("acceleration", robot.n), speed).max()
    )
