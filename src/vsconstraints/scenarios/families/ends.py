"""Start and goals of an attempt: placed, and looked at before anything is built."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import ConfigurationError, SceneError
from ...robots.geometry import Pose
from ...rows import Array
from ...vision.scene import Scene
from ..build import build_scene
from ..reading import Table, made
from .drawing import Placed
from .inverse_kinematics import inverse_kinematics
from .placements import Ends, tip_of
from .reasons import Reason, Rejected


def placed(tables: Table, where: str, folder: Path) -> tuple[Table, Ends]:
    """Tables with values for all placements, and where the robot is at the scene's ends.

    Parameters
    ----------
    tables
        Drawn but for placements.
    where, folder
        As of :func:`vsconstraints.scenarios.build.build`.

    Raises
    ------
    Rejected
        if an end is out of reach or range, or a marker is not in the image there.
    ConfigurationError
        if the tables cannot be read.
    """
    scene = build_scene(tables, where, folder)
    nowhere = Ends(scene, [])
    start = _configuration(tables.get("q0"), nowhere, tables, f"{where}.q0", Reason.START_OUT_OF_REACH)
    ends = Ends(scene, [start])
    tables = {**tables, "q0": start.tolist()}
    task = tables.get("task")
    goals = task.get("goals", []) if isinstance(task, Mapping) else []
    if isinstance(task, Mapping) and isinstance(goals, list):
        found = []
        for i, goal in enumerate(goals):
            goal, q = _goal(goal, ends, f"{where}.task.goals.{i}")
            found.append(goal)
            ends = Ends(scene, [*ends.q, q])
        tables["task"] = {**task, "goals": found}
    _look(ends)
    filled: Table = _filled(tables, ends, {}, where)
    return filled, ends


def last(ends: Ends, goal: Pose, t: float) -> Array:
    """Joint coordinates (n,) at a goal, a pose in the target's frame, at time ``t`` [s] if the target moves.

    Raises
    ------
    Rejected
        if it is out of reach.
    """
    scene, near = ends.scene, ends.q[-1]
    if near is not None and scene.motion is None:
        return near
    tip = tip_of(scene, goal)
    if scene.motion is not None:
        tip = scene.motion.pose(t) @ tip
    q = inverse_kinematics(scene.robot, tip, near if near is not None else _start(ends))
    if q is None:
        raise Rejected(Reason.GOAL_OUT_OF_REACH)
    return q


def _start(ends: Ends) -> Array:
    start = ends.q[0]
    assert start is not None  # only goals may be given by their image alone
    return start


def _goal(goal: Any, ends: Ends, where: str) -> tuple[Any, Array | None]:
    """A goal with its placement's value, and the joint coordinates there; None if its image alone is given."""
    if not isinstance(goal, Mapping):
        return goal, None
    if "camera_at_q" in goal:
        q = _configuration(goal["camera_at_q"], ends, goal, f"{where}.camera_at_q", Reason.GOAL_OUT_OF_REACH)
        return {**goal, "camera_at_q": q.tolist()}, q
    if "camera_pose" in goal:
        camera = made(Pose.from_xyz_rpy, goal["camera_pose"], f"{where}.camera_pose")
        found = inverse_kinematics(ends.scene.robot, tip_of(ends.scene, camera), _start(ends))
        if found is None:
            raise Rejected(Reason.GOAL_OUT_OF_REACH)
        return goal, found
    return goal, None


def _configuration(value: Any, ends: Ends, beside: Mapping[str, Any], where: str, reason: Reason) -> Array:
    if isinstance(value, Placed):
        value = _value(value, ends, dict(beside), where)
        if value is None:
            raise Rejected(reason)
    return ends.scene.robot.configuration(value, where)


def _value(value: Placed, ends: Ends, beside: Table, where: str) -> list[float] | None:
    found: list[float] | None = made(value.kind, value.table, where).value(ends, beside, where)
    return found


def _filled(tree: Any, ends: Ends, beside: Table, where: str) -> Any:
    """Everything in it with the values of the placements that are left."""
    if isinstance(tree, Placed):
        value = _value(tree, ends, beside, where)
        if value is None:
            raise ConfigurationError(f"{where}: {tree.kind.name} stands at q0 and at camera_at_q of goals")
        return value
    if isinstance(tree, dict):
        return {name: _filled(inner, ends, tree, f"{where}.{name}") for name, inner in tree.items()}
    if isinstance(tree, list):
        return [_filled(inner, ends, beside, f"{where}.{i}") for i, inner in enumerate(tree)]
    return tree


RANGES = (Reason.START_OUT_OF_RANGE, Reason.GOAL_OUT_OF_RANGE)
BEHIND = (Reason.START_BEHIND, Reason.GOAL_BEHIND)
UNSEEN = (Reason.START_UNSEEN, Reason.GOAL_UNSEEN)


def _look(ends: Ends) -> None:
    """Raise Rejected if an end is out of range, or a marker not in the image there."""
    known = [(min(i, 1), q) for i, q in enumerate(ends.q) if q is not None]
    for at, q in known:
        outside = ends.scene.robot.outside_ranges(q)
        if outside:
            raise Rejected(RANGES[at], outside[0])
    for at, q in known:
        _see(ends.scene, q, at)


def _see(scene: Scene, q: Array, at: int) -> None:
    try:
        seen = scene.camera.sees(scene.project(scene.camera_pose(q)))
    except SceneError as error:
        raise Rejected(BEHIND[at], str(error)) from error
    if not np.all(seen):
        raise Rejected(UNSEEN[at])
