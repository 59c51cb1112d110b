"""Figs. 9 to 12: the case study, and its arm in space."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...reports.plots import (
    FAINT,
    INK,
    REFERENCE,
    WIDTH,
    Sheet,
    above_legend,
    band,
    line,
    note,
    signal,
    symbol,
    zero_line,
)
from ...reports.scene3d import Placement, Scene3D, Viewpoint, ball, bars, tube
from ...reports.setup_scene import setup_frames
from ...robots.geometry import Pose
from ...rows import Array
from ..claims.case_study import BORDERS, EVENTS, RANGE, SPEED, SPHERE, at_once, phases, switch_sample
from . import lines as paper

SYMBOLS = ("o", "^", "s", "*")  #: The paper's symbols of the four markers: circle, triangle, square, star.

SHORT = {RANGE: "joint 6 range", SPEED: "joint 2 speed", SPHERE: "sphere"}
SHORT |= {label: f"FOV, feature {i}" for i, label in enumerate(BORDERS, start=1)}

ORANGE = "#F0A202"

#: Where the names of the frames of Fig. 9 stand, in each frame [m].
LABEL_AT = {
    "F": (0.0, -0.14, 0.02),
    "O": (-0.03, -0.03, 0.0),
    "C": (0.1, 0.02, -0.04),
    "C*¹": (-0.03, -0.03, -0.03),
    "C*²": (0.02, 0.11, -0.02),
}
#: What Figs. 9 and 12 show: centre and half side [m], elevation and azimuth of the look at it [deg].
CUBE = Viewpoint(np.array([0.27, 0.1, 0.33]), 0.43, 22.0, -58.0)


def frame_times(run: Run) -> list[float]:
    """Four instants that Fig. 12 shows: in the middle of three events at once, of the third feature's sliding, of the
    second feature's sliding in the second phase, and of the sphere's.
    """  # noqa: D205
    count = at_once(run)
    three = run.t[count == count.max()]
    spans = [(three[0], three[-1]), *phases(run, BORDERS[2])[0][:1], *phases(run, BORDERS[1])[1][:1]]
    spans += phases(run, SPHERE)[1][:1]
    return [float(run.t[np.argmin(np.abs(run.t - 0.5 * (a + b)))]) for a, b in spans]


def draw_tracks(case: Run) -> Sheet:
    """Fig. 10: tracks in the image, position and orientation errors."""
    sheet = Sheet(paper.LEFT)
    ax = paper.image_view(sheet, case, 3.9)
    pixels, entries = case.trajectory.features_px, []
    for i, mark in enumerate(SYMBOLS):
        paper.track(ax, case, i, color=paper.COLOURS[i])
        paper.ends(ax, pixels, i, mark)
        ax.plot(*pixels[switch_sample(case), i], **symbol(mark, "white"), zorder=5.9)
        entries.append(symbol(mark, "white") | line(f"feature {i + 1}", paper.COLOURS[i]))
    for face, edge, name in (
        (paper.START, INK, "start"),
        ("white", INK, "end of phase 1"),
        (INK, "white", "end of phase 2"),
    ):
        entries.append(symbol("o", face, edge, label=name))
    sheet.side_legend([*entries, *paper.boundaries(case, "boundary of the FOV constraint")])
    paper.pose_errors(sheet.panels(2, height=1.45, labels=("time [s]", "")), case)
    return sheet


def draw_signals(case: Run) -> Sheet:
    """Fig. 11: joints, speeds, max φ, and when each constraint is active."""
    sheet = Sheet(1.12)
    panels = sheet.panels(4, height=1.5, above=0.4, labels=("time [s]", ""))
    for ax, values, label, name, limited in (
        (panels[0], case.trajectory.q, "joint positions\n[rad]", "q", f"{RANGE}.upper"),
        (panels[1], case.trajectory.qd, "joint speeds\n[rad/s]", r"\dot{q}", f"{SPEED}.upper"),
    ):
        paper.signals(ax, case, values, (f"${name}_{k + 1}$" for k in range(values.shape[1])), label)
        paper.limits_around(ax, values)
        above_legend(ax, 6)
        _limit(ax, case, limited, values)
    signal(panels[2], case.t, case.trajectory.phi.max(axis=1), color=paper.BLUE, linewidth=1.2)
    paper.phi_axis(panels[2], case, (-0.2, 0.04), r"greatest $\phi_i$")
    _lanes(panels[3], case)
    for number, time in enumerate(frame_times(case), start=1):
        for ax in panels:
            ax.axvline(time, color="#666666", linestyle="--", linewidth=0.9, zorder=1.4)
        place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "ha": "center"}
        panels[3].annotate(f"frame {number}", (time, 1.0), (0, 2), **place, fontsize=8, color=FAINT)
    return sheet


def _limit(ax: Any, run: Run, label: str, values: Any) -> None:
    """Dashed line at the limit that acts: the value that the row's joint had, and its clearance."""
    constraint: Any = run.constraint(label)
    joint = int(constraint.joints[0])
    clearance = run.trajectory.clearance[:, run.index(label)]
    limit = float(np.median(values[:, joint - 1] + clearance))
    ax.axhline(limit, **REFERENCE | {"color": paper.COLOURS[joint - 1], "linewidth": 1.4}, zorder=1.7)
    note(ax, f"limit of joint {joint}", limit, across=0.26)


def _lanes(ax: Any, run: Run) -> None:
    """When each event is active, and which are in the instants of Fig. 12."""
    shown = [event for event in EVENTS if any(phases(run, event))]
    for lane, event in enumerate(shown):
        for first, last in (span for phase in phases(run, event) for span in phase):
            ax.plot([first, last], [lane, lane], color=INK, linewidth=2.6, solid_capstyle="butt", zorder=3)
            inside = [time for time in frame_times(run) if first <= time <= last]
            ax.plot(inside, [lane] * len(inside), **symbol("o", "white", size=7.0), zorder=4)
    paper.over_time(ax, run)
    ax.set_yticks(range(len(shown)), [SHORT[event] for event in shown])
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0, pad=3)


def add_path(scene: Scene3D, points: Array, radius: float, colour: str, most: int = 160) -> None:
    """A curve through points (p, 3)."""
    if len(points) > 1:
        chosen = np.unique(np.linspace(0, len(points) - 1, most).astype(int))
        scene.add(tube(points[chosen], radius, 6, caps=False), colour)


def system(case: Run, k: int) -> tuple[Scene3D, dict[str, Placement]]:
    """The arm and what its camera sees in a sample, the target's plate with its markers, and the sphere."""
    world, q, sphere = case.setup.scene, case.trajectory.q[k], case.constraint(SPHERE)
    scene = Scene3D()
    scene.parts += bars(world.robot, 1.0)
    scene.target(world.markers, 0.003, 0.012)
    _add_sphere(scene, sphere, 20)
    view = np.array([[x, y, 0.08] for x, y in ((-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05))])
    scene.pyramid(view, paper.BLUE, "camera")
    return scene, setup_frames(case.setup, q, float(case.t[k]))


def _add_sphere(scene: Scene3D, sphere: Any, count: int) -> None:
    scene.add(ball(sphere.centre, sphere.radius, count), ORANGE)


def _space(sheet: Sheet, left: float, top: float, side: float) -> Any:
    """Square axes for bodies in space."""
    return sheet.axes(left, top, side, side, projection="3d", computed_zorder=False)


def draw_frames(case: Run) -> Sheet:
    """Fig. 12: the arm at four instants, and the end-effector's path around the sphere."""
    sheet = Sheet()
    trail = tip_path(case)
    for number, time in enumerate(frame_times(case), start=1):
        row, column = divmod(number - 1, 2)
        left, top = column * (WIDTH / 2) + 0.02, 0.05 + row * 3.4
        k = int(np.argmin(np.abs(case.t - time)))
        scene, frames = system(case, k)
        add_path(scene, trail[: k + 1], 0.0045, paper.RED)
        scene.draw(_space(sheet, left, top - 0.35, 3.95), CUBE, frames, whole=False)
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
    _add_sphere(scene, sphere, 40)
    away = trail - sphere.centre
    distance = np.sqrt((away * away).sum(axis=1))
    # the line lies on the sphere with its side, as it has a thickness and the path has none
    add_path(scene, (trail + thickness * away / distance[:, None])[distance < 0.09], thickness, paper.RED, 300)
    acts = case.phi(SPHERE) >= 0.0
    # a law that keeps away from the sphere is looked at where it is nearest
    touch = (trail[acts].mean(axis=0) if acts.any() else trail[distance.argmin()]) - sphere.centre
    azimuth = float(np.rad2deg(np.arctan2(touch[1], touch[0]))) + 20.0
    detail = Viewpoint(sphere.centre, 0.068, 18.0, azimuth)
    scene.draw(_space(sheet, 0.3, top - 0.15, 2.9), detail, whole=False)
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


def draw_system(case: Run) -> Sheet:
    """Fig. 9: the arm at its start, the target, the sphere and the frames."""
    sheet = Sheet()
    ax = _space(sheet, 0.6, -0.35, 6.2)
    world, goals = case.setup.scene, case.setup.task.goals
    scene, frames = system(case, 0)
    x, y = world.markers[1] - world.markers[0], world.markers[3] - world.markers[0]
    R = np.stack([axis / np.linalg.norm(axis) for axis in (x, y, np.cross(x, y))], axis=1)
    poses = {"F": Pose.identity(), "O": Pose(R, world.markers.mean(axis=0))}
    poses["C"] = world.camera_pose(case.trajectory.q[0])
    poses |= {name: goal.camera for name, goal in zip(("C*¹", "C*²"), goals, strict=True) if goal.camera is not None}
    for name, pose in poses.items():
        scene.axes(pose, 0.2 if name == "F" else 0.09, 0.004)
    scene.draw(ax, CUBE, frames, whole=False)
    for name, pose in poses.items():
        beside = pose.act(np.array(LABEL_AT[name]))
        ax.text(*beside, name, fontsize=11, fontweight="bold", ha="center", va="center", zorder=50)
    sheet.at = 5.3
    return sheet
