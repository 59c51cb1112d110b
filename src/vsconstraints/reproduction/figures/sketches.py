"""Figs. 2 and 3: the boundary of the FOV constraint, and the planar system."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.patches import Circle, Polygon, Rectangle

from ...camera import Camera
from ...constraints import FieldOfView
from ...geometry import Pose
from ...reports.figures.sheet import Sheet
from ...rows import Array
from ..runs import Run
from .page import BLUE, CYAN, DARK, GREEN, LEFT, MAGENTA, RED, line_handle


def draw_hyperellipses(path: Path) -> None:
    """Fig. 2: σ = 0 for a margin of 5 % and n = 2, 4, 8, 16."""
    width, height = size = (640.0, 480.0)
    shown = 4.6
    sheet = Sheet(0.15 + shown * height / width + 0.5)
    ax = sheet.axes(LEFT, 0.15, shown, shown * height / width)
    ax.add_patch(Rectangle((-width / 2, -height / 2), width, height, fill=False, edgecolor=DARK, linewidth=2.6))
    handles = [line_handle(DARK, "-", "image", 2.6)]
    camera = Camera((600.0, 600.0), size)
    for n, colour, line in ((2, BLUE, "-"), (4, MAGENTA, "--"), (8, GREEN, "-."), (16, RED, "-")):
        constraint = FieldOfView(camera, K=1.0, switching_gain=1.0, margin=0.05, n=n)
        for points in constraint.boundary(size):
            ax.plot(*points.T, color=colour, linestyle=line, linewidth=1.7)
        handles.append(line_handle(colour, line, f"$\\sigma_V$ = 0 for $n_V$ = {n}"))
    ax.set_xlim(-0.53 * width, 0.53 * width)
    ax.set_ylim(0.53 * height, -0.53 * height)
    ax.set_xlabel("u [px]", labelpad=1)
    ax.set_ylabel("v [px], downwards", labelpad=1)
    sheet.legend(handles, LEFT + shown + 0.35, 0.25, 1, labelspacing=0.8)
    sheet.save(path)


def draw_planar_system(fov: Run, path: Path) -> None:
    """Fig. 3: the arm from above, at its start and its end."""
    scene = fov.setup.scene
    markers = scene.markers
    sheet = Sheet(4.9)
    ax = sheet.axes(LEFT, 0.15, 4.3, 4.3)
    q = fov.trajectory.q[0]
    joints = np.array([[0.0, 0.0, 0.0], *(scene.robot.pose(q, f"link {i}").t for i in (1, 2))])[:, :2]
    round_line: dict[str, Any] = {"solid_capstyle": "round", "solid_joinstyle": "round"}
    ax.plot(*joints.T, color="#4A5568", linewidth=11, zorder=2, **round_line)
    ax.plot(*joints.T, color="#C9CED6", linewidth=7.5, zorder=2.1, **round_line)
    for k, (joint, offset) in enumerate(zip(joints, ((12, 2), (11, 2), (14, -14)), strict=True)):
        ax.add_patch(Circle(tuple(joint), 0.055, facecolor="white", edgecolor=DARK, linewidth=1.2, zorder=3))
        ax.annotate(f"$q_{k + 1}$", joint, offset, textcoords="offset points", fontsize=10, zorder=5)
    ax.add_patch(Polygon([(-0.13, 0.16), (0.13, 0.16), (0.055, 0.0), (-0.055, 0.0)], facecolor="#8A93A3", zorder=1.5))
    ax.plot([-0.24, 0.24], [0.16, 0.16], color=DARK, linewidth=1.6, zorder=1.6)
    ax.plot(*markers[:, :2].T, color=CYAN, linewidth=3, zorder=2.5)
    for i, marker in enumerate(markers):
        ax.plot(*marker[:2], marker="o*"[i], markersize=(9, 14)[i], color=DARK, markeredgecolor="white", zorder=4)
        ax.annotate(
            f"feature {i + 1}",
            marker[:2],
            ((-52, -9), (-30, 10))[i],
            textcoords="offset points",
            fontsize=9,
            ha="center",
        )
    goal = fov.setup.task.goals[0].camera
    assert goal is not None
    _frame(ax, Pose.identity(), "F", 0.26, (-22, -16))
    _frame(ax, scene.camera_pose(fov.trajectory.q[0]), "C", 0.36, (-4, -34))
    _frame(ax, goal, "C*", 0.36, (8, 22), dashed=True)
    middle = markers.mean(axis=0)
    _frame(ax, Pose(np.eye(3), middle), "O", 0.2, (8, 8))
    ax.set_aspect("equal")
    ax.set_xlim(-1.15, 1.15)
    ax.set_ylim(-1.85, 0.45)
    ax.set_xlabel("x [m]", labelpad=1)
    ax.set_ylabel("y [m]", labelpad=1)
    text = (
        "The camera moves in this plane and\nlooks along −z onto the target,\n1 m below.\n\n"
        "It starts in the desired position, with its\norientation off by π.\n\n"
        "red: x axis, green: y axis;\ndashed: desired camera frame C*"
    )
    sheet.text(LEFT + 4.3 + 0.3, 0.3, text, va="top", fontsize=9, linespacing=1.5)
    sheet.save(path)


def _frame(ax: Any, pose: Pose, name: str, length: float, offset: tuple[int, int], dashed: bool = False) -> None:
    origin: Array = pose.t[:2]
    for axis, colour in ((0, RED), (1, GREEN)):
        tip = origin + length * pose.R[:2, axis]
        ax.annotate(
            "", tip, origin, zorder=6,
            arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0,
                        "linestyle": "--" if dashed else "-"},
        )  # fmt: skip
    ax.annotate(name, origin, offset, textcoords="offset points", fontsize=11, fontweight="bold", zorder=7)
