"""Where the robot is when a goal is reached."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import SceneError
from ...robots.geometry import Pose, distance
from ...rows import Array
from ...scenarios.families.placements import inverse_kinematics, tip_of
from ...vision.features import Goal
from ...vision.pose_estimate import estimated_pose
from ...vision.scene import MINIMUM_DEPTH, Scene

TRIES = 20
"""Configurations from which one at the goal is sought, besides those that are near."""

SAME = 1e-6
"""Distance of two poses [m, rad] that counts as none."""

TURNS = 4
"""Of the camera about its optical axis, from which the pose behind an image is sought."""

FARTHEST = 0.1
"""How far markers may be from a goal given as an image, seen from the pose that explains it best, relative to its
width."""


class Reached(NamedTuple):
    """Joint coordinates (n,) at a goal, and by how much its markers are missed there at most [px]."""

    q: Array
    missed: float = 0.0


def goal_configuration(scene: Scene, goal: Goal, q0: Array, t: float) -> Reached:
    """Where the robot is when a goal is reached at time ``t`` [s].

    Where the file says it and the camera is right there, that; else what inverse kinematics finds from there, from the
    start, and then from :data:`TRIES` others. What is given as an image counts as the pose that explains it best.

    Raises
    ------
    SceneError
        if nothing is found within the joints' ranges.
    """
    if goal.q is not None and _there(scene, goal, goal.q, t):
        return Reached(goal.q)
    camera, missed = (goal.camera, 0.0) if goal.camera is not None else _seen_from(scene, goal, q0)
    tip = tip_of(scene, camera)
    if scene.motion is not None:
        tip = scene.motion.pose(t) @ tip
    for near in (*(() if goal.q is None else (goal.q,)), q0, *_others(scene, q0)):
        q = inverse_kinematics(scene.robot, tip, near)
        if q is not None:
            return Reached(q, missed)
    raise SceneError("no configuration within the joints' ranges was found that reaches it: it may be out of reach")


def _there(scene: Scene, goal: Goal, q: Array, t: float) -> bool:
    return goal.camera is not None and max(distance(scene.camera_pose(q, t), goal.camera)) < SAME


def _seen_from(scene: Scene, goal: Goal, q0: Array) -> tuple[Pose, float]:
    """The pose that explains a goal's image best, and by how much it misses the markers at most [px]."""
    camera, found = scene.camera, []
    start, seen = scene.camera_pose(q0), camera.normalised(goal.pixels)
    for turn in np.arange(TURNS) * (2.0 * np.pi / TURNS):
        near = start @ Pose(np.asarray(pin.utils.rotate("z", turn)), np.zeros(3))
        try:
            pose = estimated_pose(scene.markers, seen, near)
        except np.linalg.LinAlgError:  # a search that has left the range of floats
            continue
        P = pose.inverse.act(scene.markers)
        if (P[:, 2] > MINIMUM_DEPTH).all():
            found.append((pose, float(np.abs(camera.pixels(P[:, :2] / P[:, 2:]) - goal.pixels).max())))
    best = min(found, key=lambda one: one[1], default=None)
    if best is None or not best[1] < FARTHEST * camera.size[0]:
        raise SceneError("no pose of the camera was found from which the markers look like this")
    return best


def _others(scene: Scene, q0: Array) -> Array:
    """(TRIES, n) configurations in the joints' ranges, or within half a turn of the start; always the same."""
    robot = scene.robot
    low = np.where(np.isfinite(robot.q_min), robot.q_min, q0 - np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, q0 + np.pi)
    return np.random.default_rng(0).uniform(low, high, (TRIES, robot.n))
