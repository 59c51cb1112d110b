"""Figs. 2 to 8: the boundary of the FOV constraint, the planar arm and its examples."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...comparisons.run import Run
from ...constraints import FieldOfView
from ...reports.plots import INK, Sheet, band, inside_legend, line, logarithmic, signal, symbol
from ...reports.plots.image import Plane, square
from ...robots.geometry import Pose
from ...vision.camera import Camera
from ..claims.planar import BOWL_ROW, HEART, NOTCH, OTHER_ROW, SECOND, TIP
from . import lines as paper

TEXT = """\
The camera moves in this plane and
looks along −z onto the target,
1 m below.

It starts in the desired position, with its
orientation off by π.

red: x axis, green: y axis;
dashed: desired camera frame C*"""

VIEW = 3.7
MARKERS = ((paper.BLUE, "o", "first feature"), (paper.MAGENTA, "*", "second feature"))
FASTER: dict[str, Any] = {"color": "#F2A900", "linestyle": (0, (3, 2))}
PLANAR = (0, 1, 5)  #: Parts of the pose's error that are not zero.


def draw_hyperellipses() -> Sheet:
    """Fig. 2: σ = 0 for a margin of 5 % and n = 2, 4, 8, 16."""
    width, height = size = (640.0, 480.0)
    sheet = Sheet(paper.LEFT)
    (ax,) = sheet.views((4.6, 4.6 * height / width))
    square(ax, (0.0, 0.0), width / 2, height / 2, color=INK, linewidth=2.6, solid_joinstyle="miter")
    entries = [line("image", INK) | {"linewidth": 2.6}]
    camera = Camera((600.0, 600.0), size)
    looks = ((paper.BLUE, "-"), (paper.MAGENTA, "--"), (paper.GREEN, "-."), (paper.RED, "-"))
    for n, (colour, dash) in zip((2, 4, 8, 16), looks, strict=True):
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


def _tracks(ax: Any, run: Run, **look: Any) -> None:
    for i, (colour, mark, _) in enumerate(MARKERS):
        paper.track(ax, run, i, color=colour, **look)
        paper.ends(ax, run.trajectory.features_px, i, mark)


def _entries(run: Run) -> list[dict[str, Any]]:
    return [
        *(symbol(mark, paper.START, label=f"start of the {name}") for _, mark, name in MARKERS),
        *(symbol(mark, INK, "white", label=f"end of the {name}") for _, mark, name in MARKERS),
        *paper.boundaries(run, "boundary of the FOV constraint"),
    ]


def draw_fov(fov: Run) -> Sheet:
    """Fig. 4: tracks; errors, joints and φ of the second feature."""
    sheet = Sheet(paper.LEFT)
    _tracks(paper.image_view(sheet, fov, VIEW, upwards=True), fov)
    sheet.side_legend([*(line(name, colour) for colour, _, name in MARKERS), *_entries(fov)])
    *errors, joints, phi = sheet.panels(4, 2, height=1.45, gap=0.9, labels=("time [s]", ""))
    paper.pose_errors(errors, fov, PLANAR)
    paper.signals(joints, fov, fov.trajectory.q, (f"$q_{k}$" for k in (1, 2, 3)), "joint positions\n[rad]")
    inside_legend(joints, 3)
    paper.phi_panel(phi, fov, {SECOND: line(r"$\phi_{V,2}$", paper.CYAN)}, (-1.1, 0.2))
    return sheet


def draw_fast(fast: Run, high: Run) -> Sheet:
    """Fig. 5: tracks and φ of the second feature for a small and a large switching gain."""
    sheet = Sheet(paper.LEFT)
    ax = paper.image_view(sheet, fast, VIEW, upwards=True)
    _tracks(ax, fast, linewidth=2.4)
    for i in range(2):
        paper.track(ax, high, i, **FASTER, zorder=4.5)
    slower = [line(f"{name}, $u^+$ = 10", colour) for colour, _, name in MARKERS]
    sheet.side_legend([*slower, line("both features, $u^+$ = 50", **FASTER), *_entries(fast)])
    whole, near = sheet.panels(2, height=1.7, above=0.25, labels=("time [s]", ""))
    for ax, low, top, what in ((whole, -1.1, 0.3, ""), (near, -0.3, 0.2, ", near zero")):
        for run, colour, name in ((fast, paper.BLUE, "$u^+$ = 10"), (high, FASTER["color"], "$u^+$ = 50")):
            signal(ax, run.t, run.phi(SECOND), color=colour, label=name, linewidth=1.4)
        paper.phi_axis(ax, fast, (low, top), r"$\phi_{V,2}$" + what)
    bound = fast.bound(SECOND)
    band(near, -bound, bound, paper.BAND, label="$\\pm T_s u^+$ for $u^+$ = 10")
    near.set_xlim(0.0, 2.0)
    whole.tick_params(labelbottom=True)
    inside_legend(whole, 2, "lower right")
    inside_legend(near, place="upper right")
    return sheet


class Obstacle(NamedTuple):
    """What the first marker meets: its row and name, a detail [px], limits of φ, and a row of the other marker."""

    row: str
    name: str
    centre: tuple[float, float]
    half: float
    phi: tuple[float, float]
    other: str = ""


IN_BOWL = Obstacle(BOWL_ROW, "bowl", (-50.0, 86.0), 40.0, (-2.2, 0.3), OTHER_ROW)
AT_CONVEX = Obstacle(HEART, "heart", TIP, 25.0, (-2.2, 0.3))
AT_CONCAVE = Obstacle(HEART, "heart", NOTCH, 25.0, (-2.2, 1.1))


def draw_obstacle(run: Run, met: Obstacle) -> Sheet:
    """Figs. 6 to 8: tracks with a detail, errors, and φ of the border's and the obstacle's row.

    The obstacle's row of the other marker gets a panel of its own, beside the first's.
    """
    sheet, plane = Sheet(paper.LEFT), Plane.of(run.setup)
    sheet.at = 0.28
    whole, detail = sheet.views((3.0, 3.0), (2.05, 2.05), gap=0.45)
    plane.draw(whole, upwards=True)
    _tracks(whole, run)
    square(whole, met.centre, met.half, met.half, color=INK, linewidth=0.9, zorder=7)
    entries = [line(name, colour) for colour, _, name in MARKERS]
    entries += [symbol("o", paper.START, label="start"), symbol("o", INK, "white", label="end")]
    plane.draw_part(detail, np.array(met.centre), np.full(2, met.half))
    detail.invert_yaxis()
    detail.set_title("detail", loc="left", fontsize=8.5, pad=3)
    detail.set_xlabel("u [px]", labelpad=1)
    paper.track(detail, run, 0, color=paper.BLUE)
    paper.ends(detail, run.trajectory.features_px, 0, "o")
    outside = np.where((run.sigma(met.row) > 0.0)[:, None], run.trajectory.features_px[:, 0], np.nan)
    if np.isfinite(outside).any():
        detail.plot(*outside.T, color=paper.RED, linewidth=2.6, zorder=5)
        entries.append(line(r"$\sigma$ > 0", paper.RED))
    sheet.side_legend(entries)
    panels = sheet.panels(4 if met.other else 3, height=1.2, labels=("time [s]", ""))
    paper.pose_errors(panels[:2], run, PLANAR)
    looks = {SECOND: line("FOV, second feature", paper.CYAN)}
    looks[met.row] = line(f"{met.name}, first feature", paper.GREEN, "-.")
    paper.phi_panel(panels[2], run, looks, met.phi)
    if met.other:  # some of its rows leave their bands by orders of magnitude
        bound = run.bound(met.other)
        looks = {met.other: line(f"{met.name}, second feature", paper.MAGENTA)}
        looks[met.row] = line(f"{met.name}, first feature", paper.GREEN)
        band(panels[3], -bound, bound, paper.BAND)
        paper.phi_panel(panels[3], run, looks, (), f"$\\phi$ of the {met.name}")
        logarithmic(panels[3].yaxis, (-1e4, -1e2, -1.0, 0.0, 1.0, 1e2), bound, 1.0)
        panels[3].set_ylim(top=1e4)
    return sheet
