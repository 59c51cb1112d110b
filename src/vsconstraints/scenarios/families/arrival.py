"""Whether any law could arrive in time: the least time in which the arm's limits let it be at rest at its goal."""

from __future__ import annotations

import math

import numpy as np

from ...constraints import JointSpeed
from ...rows import Array
from ...simulation import Setup
from .placements import Ends


def rest_to_rest(distance: Array, acceleration: Array, speed: Array) -> Array:
    """(n,) least time from rest to rest of joints by themselves [s]: d/w + w/a with the peak speed w = min(v, √(a d)).

    A joint accelerates as hard as it can up to w, keeps w where that is its limit v, and brakes as hard: what is best
    for a double integrator with bounded input and speed.

    Parameters
    ----------
    distance
        (n,) d ≥ 0 [rad or m].
    acceleration, speed
        (n,) a > 0 [rad/s² or m/s²] and v > 0 [rad/s or m/s]; infinite where there is no limit.
    """
    w = np.minimum(speed, np.sqrt(acceleration * distance))
    # who need not move, or is without any limit, is there at once
    moving = (distance > 0.0) & np.isfinite(w)
    w = np.where(moving, w, 1.0)
    return np.where(moving, distance / w + w / acceleration, 0.0)


def least_time(setup: Setup, ends: Ends) -> float:
    """Least time from rest at the start to rest at the joint coordinates of the last goal [s].

    It is that of the slowest joint: each keeps the actuators' limit of acceleration, and of speeds what the rows of
    joint speeds leave with their sampling band, or the robot's own speed where limits keep it. Jerk, obstacles and the
    image take more. Other joint coordinates with the same goal are not looked at, nor tolerances of the goal.

    NaN without limits of actuators, where the robot does not start at rest, and where the goal is not one place of the
    joints: it is known by its image alone, the target moves, or joints are left free by it (a redundant arm).
    """
    start, goal, n = setup.q0, ends.q[-1], setup.scene.robot.n
    if goal is None or ends.scene.motion is not None or not setup.limits.any or np.any(setup.qd0):
        return math.nan
    there = setup.scene.evaluate(0.0, goal, np.zeros(n))
    if np.linalg.matrix_rank(setup.task.feature.evaluate(there, setup.task.goals[-1], None).J) < n:
        return math.nan
    way = goal - start
    acceleration = setup.limits.of_joint("acceleration", n)
    return float(rest_to_rest(np.abs(way), acceleration, _speeds(setup, way)).max())


def _speeds(setup: Setup, way: Array) -> Array:
    """(n,) the greatest speed of each joint in the direction in which it goes."""
    robot = setup.scene.robot
    greatest = robot.qd_max.copy() if setup.limits.ranges else np.full(robot.n, np.inf)
    for rows in setup.constraints.constraints:
        if isinstance(rows, JointSpeed):
            at = np.array(rows.joints) - 1
            # the share of a limit up to which scores hold a speed for kept
            share = 1.0 - rows.margin + setup.Ts * rows.switching_gain
            greatest[at] = np.minimum(greatest[at], share * np.where(way[at] > 0.0, rows.upper, -rows.lower))
    return greatest
