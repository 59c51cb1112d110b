"""A serial arm as bars and drums: its links between the axes of its joints."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from ...robots.robot import Robot
from ...rows import Array
from .mesh import Mesh

LINK, JOINT = "#C9CED6", "#4A5568"
THICK, THIN = 0.034, 0.022
"""Radii of the first and the last link of an arm that reaches 0.8 m [m]."""

SLIDING = 0.25
"""Radius of what slides, relative to that of a joint."""


def joint_places(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Origins of the joints and of the tip (n + 1, 3), and directions of the joints' axes (n, 3), in the base frame."""
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    J = np.asarray(data.J).reshape(6, -1)
    axes = np.where(np.array(robot.prismatic), J[:3], J[3:]).T
    origins = [np.array(data.oMi[i].translation) for i in range(1, model.njoints)]
    return np.array([*origins, robot.pose(q).t]), axes


def bars_of(robot: Robot, q: Array) -> list[Array]:
    """(p, 3) corners of a bar behind each joint: along its axis, then along the common normal to the next one."""
    places, axes = joint_places(robot, q)
    bars = []
    for before, after, axis in zip(places[:-1], places[1:], axes, strict=True):
        corners = [before]
        elbow = before + float(axis @ (after - before)) * axis
        corners += [point for point in (elbow, after) if np.linalg.norm(point - corners[-1]) > 1e-6]
        bars.append(np.array(corners))
    return bars


def radii_of(robot: Robot, size: float) -> Array:
    """(n,) radius of each link, thinner towards the tip [m]; ``size`` scales it."""
    radii: Array = size * (THICK + (THIN - THICK) * np.arange(robot.n) / robot.n)
    return radii


def add_arm(mesh: Mesh, robot: Robot, q: Array, size: float = 1.0) -> None:
    """Bars with their elbows, drums for joints, and a base; ``size`` scales how thick they are.

    What slides is thin and has no drum; an arm that begins with it has no base.
    """
    places, axes = joint_places(robot, q)
    radii = radii_of(robot, size)
    for place, axis, radius, slides in zip(places, axes, radii, robot.prismatic, strict=False):
        if not slides:
            mesh.tube(np.array([place - 1.35 * radius * axis, place + 1.35 * radius * axis]), 1.25 * radius, JOINT, 14)
    bars = bars_of(robot, q)
    if not robot.prismatic[0]:
        bars[0] = np.concatenate((np.zeros((1, 3)), bars[0]))
        mesh.tube(size * np.array([[0.0, 0.0, -0.005], [0.0, 0.0, 0.04]]), 0.09 * size, JOINT, 24)
    for bar, radius, slides in zip(bars, radii, robot.prismatic, strict=True):
        thickness = (SLIDING if slides else 0.8) * radius
        for a, b in pairwise(bar):
            length = float(np.linalg.norm(b - a))
            if length > 1e-6:
                mesh.tube(np.linspace(a, b, max(2, int(length / (0.05 * size)))), thickness, LINK, 12)
                mesh.ball(b, thickness, LINK, count=12)
