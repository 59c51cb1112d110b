"""Figs. 2 and 3: the boundary of the FOV constraint, and the planar system."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...constraints import FieldOfView
from ...reports.plots import INK, Sheet, line
from ...reports.plots.image import square
from ...robots.geometry import Pose
from ...vision.camera import Camera
from . import lines as paper

TEXT = """\
The camera moves in this plane and
looks along −z onto the target,
1 m below.

It starts in the desired position, with its
orientation off by π.

red: x axis, green: y axis;
dashed: desired camera frame C*"""


def draw_hyperellipses() -> Sheet:
    """Fig. 2: σ = 0 for a margin of 5 % and n = 2, 4, 8, 16."""
    width, height = size = (640.0, 480.0)
    sheet = Sheet(paper.LEFT)
    (ax,) = sheet.views((4.6, 4.6 * height / width))
    square(ax, (0.0, 0.0), width / 2, height / 2, color=INK, linewidth=2.6, solid_joinstyle="miter")
    entries = [line("image", INK) | {"linewidth": 2.6}]
    camera = Camera((600.0, 600.0), size)
    for n, colour, dash in (
        (2, paper.BLUE, "-"),
        (4, paper.MAGENTA, "--"),
        (8, paper.GREEN, "-."),
        (16, paper.RED, "-"),
    ):
        constraint = FieldOfView(camera, K=1.0, switching_gain=1.0, margin=0.05, n=n)
        for points in constraint.boundary(size):
            ax.plot(*points.T, color=colour, linestyle=dash, linewidth=1.7)
        entries.append(line(f"$\\sigma_V$ = 0 for $n_V$ = {n}", colour, dash))
    ax.set_xlim(-0.53 * width, 0.53 * width)
    ax.set_ylim(0.53 * height, -0.53 * height)
    ax.set_xlabel("u [px]", labelpad=1)
    ax.set_ylabel("v [px], downwards", labelpad=1)
    sheet.side_legend(entries)
    return sheet


def draw_planar_system(fov: Run) -> Sheet:
    """Fig. 3: the arm from above, at its start and its end."""
    scene = fov.setup.scene
    markers, robot, q = scene.markers, scene.robot, fov.trajectory.q[0]
    sheet = Sheet(paper.LEFT)
    (ax,) = sheet.views((4.3, 4.3))
    joints = np.array([[0.0, 0.0, 0.0], *(robot.pose(q, f"link {i}").t for i in (1, 2))])[:, :2]
    for colour, width in (("#4A5568", 11), ("#C9CED6", 7.5)):
        ax.plot(*joints.T, color=colour, linewidth=width, zorder=2, solid_joinstyle="round")
    ax.plot(*joints.T, "o", color="white", markeredgecolor=INK, markeredgewidth=1.2, markersize=14.0, zorder=3)
    for k, offset in enumerate(((12, 2), (11, 2), (14, -14))):
        ax.annotate(f"$q_{k + 1}$", joints[k], offset, textcoords="offset points", fontsize=10, zorder=5)
    ax.fill([-0.13, 0.13, 0.055, -0.055], [0.16, 0.16, 0.0, 0.0], color="#8A93A3", zorder=1.5)
    ax.plot([-0.24, 0.24], [0.16, 0.16], color=INK, linewidth=1.6, zorder=1.6)
    ax.plot(*markers[:, :2].T, color=paper.CYAN, linewidth=3, zorder=2.5)
    for i, (mark, size, offset) in enumerate((("o", 9, (-52, -9)), ("*", 14, (-30, 10)))):
        place = markers[i, :2]
        ax.plot(*place, marker=mark, markersize=size, color=INK, markeredgecolor="white", zorder=4)
        ax.annotate(f"feature {i + 1}", place, offset, textcoords="offset points", fontsize=9, ha="center")
    goal = fov.setup.task.goals[0].camera
    assert goal is not None
    _frame(ax, Pose.identity(), "F", 0.26, (-22, -16))
    _frame(ax, scene.camera_pose(q), "C", 0.36, (-4, -34))
    _frame(ax, goal, "C*", 0.36, (8, 22))
    _frame(ax, Pose(np.eye(3), markers.mean(axis=0)), "O", 0.2, (8, 8))
    ax.set_xlim(-1.15, 1.15)
    ax.set_ylim(-1.85, 0.45)
    ax.set_xlabel("x [m]", labelpad=1)
    ax.set_ylabel("y [m]", labelpad=1)
    left, top = sheet.beside
    sheet.text(left, top + 0.2, TEXT, va="top", fontsize=9, linespacing=1.5)
    return sheet


def _frame(ax: Any, pose: Pose, name: str, length: float, offset: tuple[int, int]) -> None:
    """The x and y axes of a frame; dashed if it is a desired one."""
    origin, dashes = pose.t[:2], "--" if "*" in name else "-"
    for axis, colour in ((0, paper.RED), (1, paper.GREEN)):
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
        tip = origin + length * pose.R[:2, axis]
        ax.annotate("", tip, origin, zorder=6, arrowprops={**arrow, "linestyle": dashes})
    ax.annotate(name, origin, offset, textcoords="offset points", fontsize=11, fontweight="bold", zorder=7)
