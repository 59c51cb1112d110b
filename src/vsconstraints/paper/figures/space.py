"""Figs. 3, 9 and 12: arm, target and frames in space."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...reports.plots import WIDTH, Sheet
from ...robots.geometry import Pose
from ...view.arm import bars
from ...view.scene3d import Scene3D, Viewpoint
from ...view.setup_scene import add_robot, add_surroundings, setup_frames
from ...view.solids import tube
from ..case_study import active_spans
from . import lines as paper
from .simulations import SHORT, frame_times

#: Viewpoints of Fig. 3, and of Figs. 9 and 12: centre and half side [m], elevation and azimuth of
#: the view [deg].
PLANE = Viewpoint(np.array([0.1, -0.5, -0.3]), 1.15, 80.0, -90.0)
CUBE = Viewpoint(np.array([0.27, 0.1, 0.33]), 0.43, 22.0, -58.0)


def scene_of(run: Run, view: Viewpoint) -> Scene3D:
    """Build the arm with its camera, the target and forbidden regions in space, without poses."""
    scene = Scene3D()
    scale = view.half / CUBE.half
    add_surroundings(scene, run.setup, view.half)
    add_robot(scene, run.setup, bars(run.setup.scene.robot, scale), scale)
    return scene


def space(sheet: Sheet, left: float, top: float, side: float) -> Any:
    """Create square axes for bodies in space."""
    return sheet.axes_3d(left, top, side, side)


def draw_system(run: Run, view: Viewpoint) -> Sheet:
    """Draw Figs. 3 and 9: the arm at its start, the target, and the frames."""
    sheet = Sheet()
    scene = scene_of(run, view)
    q = run.trajectory.q[0]
    goals = [goal.camera for goal in run.setup.task.goals if goal.camera is not None]
    names = ("C*",) if len(goals) == 1 else ("C*¹", "C*²")
    poses = {
        "F": Pose.identity(),
        "O": Pose(np.eye(3), run.setup.scene.markers.mean(axis=0)),
        "C": run.setup.scene.camera_pose(q),
        **dict(zip(names, goals, strict=True)),
    }
    lengths = dict.fromkeys(poses, 0.2 * view.half)
    lengths["F"] = 0.45 * view.half
    for name, pose in poses.items():
        scene.axes(pose, lengths[name], 0.01 * view.half)
    ax = space(sheet, 0.6, -0.35, 6.2)
    scene.draw(ax, view, setup_frames(run.setup, q, 0.0), whole=False)
    for name, pose in poses.items():
        away = -0.6 * lengths[name]
        beside = pose.act(np.array([away, away, 0.0]))
        ax.text(*beside, name, fontsize=11, fontweight="bold", ha="center", va="center", zorder=50)
    sheet.bottom = 5.3
    return sheet


def draw_frames(case: Run) -> Sheet:
    """Draw Fig. 12: the arm at four times, and the end-effector's path."""
    labels = [point.label for point in case.setup.scene.points]
    sheet = Sheet()
    trail = case.trajectory.points[:, labels.index("tip")]
    for number, time in enumerate(frame_times(case), start=1):
        row, column = divmod(number - 1, 2)
        left = column * (WIDTH / 2) + 0.02
        top = 0.05 + row * 3.4
        k = int(np.argmin(np.abs(case.t - time)))
        samples = np.unique(np.linspace(0, k, 160).astype(int))
        scene = scene_of(case, CUBE)
        scene.add(tube(trail[samples], 0.0045, 6, caps=False), paper.RED)
        frames = setup_frames(case.setup, case.trajectory.q[k], time)
        scene.draw(space(sheet, left, top - 0.35, 3.95), CUBE, frames, whole=False)
        name = f"frame {number}"
        sheet.text(left + 0.12, top + 0.1, name, fontsize=10, fontweight="bold", va="top")
        active = []
        for event, event_name in SHORT.items():
            spans = active_spans(case, event)
            if any(first <= time <= last for first, last in spans):
                active.append(event_name)
        text = "\n".join([f"t = {time:.2f} s, active:", *active])
        sheet.text(left + 0.12, top + 0.29, text, fontsize=8.5, va="top")
    return sheet
