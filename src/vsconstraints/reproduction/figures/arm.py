"""The arm in space: Figs. 9 and 12."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...geometry import Pose
from ...reports.figures.sheet import WIDTH, Sheet
from ...robot import Robot
from ...rows import Array
from ..claims.case_study import SPHERE, phases
from ..runs import Run
from .case_study import SHORT, frame_times
from .mesh import Mesh, view
from .page import BLUE, DARK, RED

LINK, JOINT, TARGET, ORANGE = "#C9CED6", "#4A5568", "#F4F1E6", "#F0A202"
THICK, THIN = 0.034, 0.022
"""Radii of the first and the last link [m]."""


LABEL_AT = {
    "F": np.array([0.0, -0.14, 0.02]),
    "O": np.array([-0.03, -0.03, 0.0]),
    "C": np.array([0.0, 0.0, -0.04]) + np.array([0.1, 0.02, 0.0]),
    "C*¹": np.array([-0.03, -0.03, -0.03]),
    "C*²": np.array([0.02, 0.11, -0.02]),
}
"""Where the names of the frames of Fig. 9 stand, in each frame [m]."""


def skeleton(robot: Robot, q: Array) -> list[Pose]:
    """Poses of base, links in their order, and tip at ``q`` (n,)."""
    links = [f"link {i}" for i in range(1, robot.n)]
    return [Pose.identity(), *(robot.pose(q, link) for link in links), robot.pose(q)]


def add_arm(mesh: Mesh, robot: Robot, q: Array) -> None:
    """Links as bars between the origins of the DH frames, with their elbows, and joints as drums."""
    poses = skeleton(robot, q)
    corners, radius = [poses[0].t], THICK
    for k, (before, after) in enumerate(pairwise(poses)):
        # from one frame to the next: along the joint's axis, then along the common normal
        d = float(before.R[:, 2] @ (after.t - before.t))
        elbow = before.t + d * before.R[:, 2]
        for point in (elbow, after.t):
            if np.linalg.norm(point - corners[-1]) > 1e-6:
                corners.append(point)
        radius = THICK + (THIN - THICK) * k / robot.n
        axis = before.R[:, 2]
        mesh.tube(
            np.array([before.t - 1.35 * radius * axis, before.t + 1.35 * radius * axis]), 1.25 * radius, JOINT, 14
        )
    radii = np.linspace(THICK, THIN, len(corners))
    for k, (a, b) in enumerate(pairwise(corners)):
        pieces = max(2, int(np.linalg.norm(b - a) / 0.05))
        mesh.tube(np.linspace(a, b, pieces), 0.8 * radii[k], LINK, 12)
        mesh.ball(b, 0.8 * radii[k], LINK, count=12)
    mesh.tube(np.array([[0.0, 0.0, -0.005], [0.0, 0.0, 0.04]]), 0.09, JOINT, 24)


def add_target(mesh: Mesh, markers: Array, radius: float = 0.012) -> None:
    """The target's plate with its markers."""
    centre = markers.mean(axis=0)
    plate = centre + 1.25 * (markers - centre)
    mesh.add(plate, TARGET, shaded=False)
    for k in range(4):
        mesh.tube(np.array([plate[k], plate[(k + 1) % 4]]), 0.003, DARK, 6)
    for marker in markers:
        mesh.ball(marker, radius, DARK, count=10)


def add_path(mesh: Mesh, points: Array, radius: float, colour: str, most: int = 160) -> None:
    """A curve through points (p, 3)."""
    if len(points) > 1:
        chosen = np.unique(np.linspace(0, len(points) - 1, most).astype(int))
        mesh.tube(points[chosen], radius, colour, 6, caps=False)


def tip_path(run: Run) -> Array:
    """(N, 3) positions of the end-effector."""
    (index,) = [i for i, point in enumerate(run.setup.scene.points) if point.label == "tip"]
    path: Array = run.trajectory.points[:, index]
    return path


def _active(run: Run, time: float) -> str:
    names = [name for event, name in SHORT.items() for span in phases(run, event) for a, b in span if a <= time <= b]
    return "\n".join(names)


def draw_frames(case: Run, path: Path) -> None:
    """Fig. 12: the arm at four instants, and the end-effector's path around the sphere."""
    sheet = Sheet(9.6)
    side = 3.95
    trail, sphere = tip_path(case), case.constraint(SPHERE)
    for number, time in enumerate(frame_times(case), start=1):
        row, column = divmod(number - 1, 2)
        left, top = column * (WIDTH / 2) + 0.02, 0.05 + row * 3.4
        ax = sheet.axes(left, top - 0.35, side, side, projection="3d", computed_zorder=False)
        k = int(np.argmin(np.abs(case.t - time)))
        mesh = Mesh()
        add_arm(mesh, case.setup.scene.robot, case.trajectory.q[k])
        add_target(mesh, case.setup.scene.markers)
        _sphere(mesh, sphere, 20)
        camera = case.setup.scene.camera_pose(case.trajectory.q[k])
        mesh.pyramid(camera, 0.05, 0.05, 0.08, BLUE)
        add_path(mesh, trail[: k + 1], 0.0045, RED)
        mesh.draw(ax)
        view(ax, (0.27, 0.1, 0.33), 0.43, 22.0, -58.0)
        sheet.text(left + 0.12, top + 0.1, f"frame {number}", fontsize=10, fontweight="bold", va="top")
        sheet.text(left + 0.12, top + 0.29, f"t = {time:.2f} s, active:\n{_active(case, time)}", fontsize=8.5, va="top")
    _details(sheet, case, sphere, trail, 6.95)
    sheet.save(path)


def _sphere(mesh: Mesh, sphere: Any, count: int) -> None:
    mesh.ball(sphere.centre, sphere.radius, ORANGE, count=count)


def _details(sheet: Sheet, case: Run, sphere: Any, trail: Array, top: float) -> None:
    """The sphere from nearby, and the distance of the end-effector from it over time."""
    ax = sheet.axes(0.3, top - 0.15, 2.9, 2.9, projection="3d", computed_zorder=False)
    mesh = Mesh()
    _sphere(mesh, sphere, 40)
    away = trail - sphere.centre
    distance = np.sqrt((away * away).sum(axis=1))
    near, thickness = distance < 0.09, 0.0014
    # the line lies on the sphere with its side, as it has a thickness and the path has none
    add_path(mesh, (trail + thickness * away / distance[:, None])[near], thickness, RED, 300)
    mesh.draw(ax)
    touch = trail[case.phi(SPHERE) >= 0.0].mean(axis=0) - sphere.centre
    azimuth = float(np.rad2deg(np.arctan2(touch[1], touch[0]))) + 20.0
    view(ax, sphere.centre, 0.068, 18.0, azimuth)
    sheet.text(0.14, top + 0.05, "detail: the path and the sphere", fontsize=10, fontweight="bold", va="top")
    plot = sheet.axes(4.35, top + 0.35, WIDTH - 4.35 - 0.2, 1.8)
    plot.axhspan(-100.0, 0.0, color="#F9E3B4", linewidth=0.0)
    plot.plot(case.t, 1e3 * (distance - sphere.radius - sphere.margin), color=RED, linewidth=1.8)
    plot.axhline(0.0, color=DARK, linewidth=0.9)
    plot.set_xlim(4.0, float(case.t[-1]))
    plot.set_ylim(-6.0, 40.0)
    plot.set_xlabel("time [s]", labelpad=2)
    plot.set_ylabel("distance of the end-effector\nfrom the sphere [mm]", labelpad=3)
    plot.text(4.15, -3.0, "inside", va="center", fontsize=8, color="#7A5500")


def draw_system(case: Run, path: Path) -> None:
    """Fig. 9: the arm at its start, the target, the sphere and the frames."""
    sheet = Sheet(5.3)
    ax = sheet.axes(0.6, -0.35, 6.2, 6.2, projection="3d", computed_zorder=False)
    scene, goals = case.setup.scene, case.setup.task.goals
    mesh = Mesh()
    add_arm(mesh, scene.robot, case.trajectory.q[0])
    add_target(mesh, scene.markers)
    sphere: Any = case.constraint(SPHERE)
    _sphere(mesh, sphere, 24)
    centre = scene.markers.mean(axis=0)
    x, y = scene.markers[1] - scene.markers[0], scene.markers[3] - scene.markers[0]
    R = np.stack(
        (x / np.linalg.norm(x), y / np.linalg.norm(y), np.cross(x, y) / np.linalg.norm(np.cross(x, y))), axis=1
    )
    camera = scene.camera_pose(case.trajectory.q[0])
    poses = {"F": Pose.identity(), "O": Pose(R, centre), "C": camera}
    poses |= {name: goal.camera for name, goal in zip(("C*¹", "C*²"), goals, strict=True) if goal.camera is not None}
    for name, pose in poses.items():
        mesh.frame(pose, 0.2 if name == "F" else 0.09, 0.004)
    mesh.pyramid(camera, 0.05, 0.05, 0.08, BLUE)
    mesh.draw(ax)
    view(ax, (0.27, 0.1, 0.33), 0.43, 22.0, -58.0)
    for name, pose in poses.items():
        beside = pose.t + pose.R @ (LABEL_AT[name])
        ax.text(*beside, name, fontsize=11, fontweight="bold", ha="center", va="center", zorder=50)
    sheet.save(path)
