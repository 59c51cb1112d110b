"""Figs. 3, 9 and 12: arm, target and frames in space."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...reports.plots import WIDTH, Sheet, band, zero_line
from ...reports.scene3d import Scene3D, Viewpoint, ball, bars, tube
from ...reports.setup_scene import OBSTACLE, add_robot, add_surroundings, setup_frames
from ...robots.geometry import Pose
from ...rows import Array
from ..claims.simulations import SPHERE, phases
from . import lines as paper
from .simulations import SHORT, frame_times

#: What Fig. 3, and what Figs. 9 and 12 show: centre and half side [m], elevation and azimuth of the look at it [deg].
PLANE = Viewpoint(np.array([0.1, -0.5, -0.5]), 1.0, 75.0, -90.0)
CUBE = Viewpoint(np.array([0.27, 0.1, 0.33]), 0.43, 22.0, -58.0)


def scene_of(run: Run, view: Viewpoint) -> Scene3D:
    """The arm with its camera, the target and what is forbidden in space, wherever they are."""
    scene, scale = Scene3D(), view.half / CUBE.half
    add_surroundings(scene, run.setup, view.half)
    add_robot(scene, run.setup, bars(run.setup.scene.robot, scale), scale)
    return scene


def space(sheet: Sheet, left: float, top: float, side: float) -> Any:
    """Square axes for bodies in space."""
    return sheet.axes(left, top, side, side, projection="3d", computed_zorder=False)


def draw_system(run: Run, view: Viewpoint) -> Sheet:
    """Figs. 3 and 9: the arm at its start, the target, and the frames."""
    sheet, scene, q = Sheet(), scene_of(run, view), run.trajectory.q[0]
    goals = [goal.camera for goal in run.setup.task.goals if goal.camera is not None]
    poses = {"F": Pose.identity(), "O": Pose(np.eye(3), run.setup.scene.markers.mean(axis=0))}
    poses["C"] = run.setup.scene.camera_pose(q)
    poses |= dict(zip(("C*",) if len(goals) == 1 else ("C*¹", "C*²"), goals, strict=True))
    lengths = dict.fromkeys(poses, 0.2 * view.half) | {"F": 0.45 * view.half}
    for name, pose in poses.items():
        scene.axes(pose, lengths[name], 0.01 * view.half)
    ax = space(sheet, 0.6, -0.35, 6.2)
    scene.draw(ax, view, setup_frames(run.setup, q, 0.0), whole=False)
    for name, pose in poses.items():
        beside = pose.act(-0.6 * lengths[name] * np.array([1.0, 1.0, 0.0]))
        ax.text(*beside, name, fontsize=11, fontweight="bold", ha="center", va="center", zorder=50)
    sheet.at = 5.3
    return sheet


def add_path(scene: Scene3D, points: Array, radius: float, most: int = 160) -> None:
    """A curve through points (p, 3)."""
    if len(points) > 1:
        chosen = np.unique(np.linspace(0, len(points) - 1, most).astype(int))
        scene.add(tube(points[chosen], radius, 6, caps=False), paper.RED)


def draw_frames(case: Run) -> Sheet:
    """Fig. 12: the arm at four instants, and the end-effector's path around the sphere."""
    sheet, trail = Sheet(), tip_path(case)
    for number, time in enumerate(frame_times(case), start=1):
        row, column = divmod(number - 1, 2)
        left, top = column * (WIDTH / 2) + 0.02, 0.05 + row * 3.4
        k = int(np.argmin(np.abs(case.t - time)))
        scene = scene_of(case, CUBE)
        add_path(scene, trail[: k + 1], 0.0045)
        frames = setup_frames(case.setup, case.trajectory.q[k], time)
        scene.draw(space(sheet, left, top - 0.35, 3.95), CUBE, frames, whole=False)
        sheet.text(left + 0.12, top + 0.1, f"frame {number}", fontsize=10, fontweight="bold", va="top")
        spans = {event: [span for phase in phases(case, event) for span in phase] for event in SHORT}
        active = [SHORT[event] for event, own in spans.items() if any(a <= time <= b for a, b in own)]
        text = "\n".join([f"t = {time:.2f} s, active:", *active])
        sheet.text(left + 0.12, top + 0.29, text, fontsize=8.5, va="top")
    details(sheet, case, trail, 6.95)
    return sheet


def tip_path(run: Run) -> Array:
    """(N, 3) positions of the end-effector."""
    (index,) = [i for i, point in enumerate(run.setup.scene.points) if point.label == "tip"]
    path: Array = run.trajectory.points[:, index]
    return path


def details(sheet: Sheet, case: Run, trail: Array, top: float) -> None:
    """The sphere from nearby, and the distance of the end-effector from it over time."""
    sphere: Any = case.constraint(SPHERE)
    scene, thickness = Scene3D(), 0.0014
    scene.add(ball(sphere.centre, sphere.radius, 40), OBSTACLE)
    away = trail - sphere.centre
    distance = np.linalg.norm(away, axis=1)
    # the line lies on the sphere with its side, as it has a thickness and the path has none
    add_path(scene, (trail + thickness * away / distance[:, None])[distance < 0.09], thickness, 300)
    acts = case.phi(SPHERE) >= 0.0
    # a law that keeps away from the sphere is looked at where it is nearest
    touch = away[acts].mean(axis=0) if acts.any() else away[distance.argmin()]
    azimuth = float(np.rad2deg(np.arctan2(touch[1], touch[0]))) + 20.0
    scene.draw(space(sheet, 0.3, top - 0.15, 2.9), Viewpoint(sphere.centre, 0.068, 18.0, azimuth), whole=False)
    sheet.text(0.14, top + 0.05, "detail: the path and the sphere", fontsize=10, fontweight="bold", va="top")
    plot = sheet.axes(4.35, top + 0.35, WIDTH - 4.35 - 0.2, 1.8)
    band(plot, -100.0, 0.0, "#F9E3B4")
    plot.plot(case.t, 1e3 * (distance - sphere.radius - sphere.margin), color=paper.RED, linewidth=1.8)
    zero_line(plot)
    plot.set_xlim(4.0, float(case.t[-1]))
    plot.set_ylim(-6.0, 40.0)
    plot.set_xlabel("time [s]", labelpad=2)
    plot.set_ylabel("distance of the end-effector\nfrom the sphere [mm]", labelpad=3)
    plot.text(4.15, -3.0, "inside", va="center", fontsize=8, color="#7A5500")
