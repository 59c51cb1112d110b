"""Figs. 2, 4 to 8, 10 and 11: boundary of the FOV constraint, planar arm, case study over time."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...comparisons.run import Run
from ...constraints import FieldOfView
from ...reports import plots
from ...reports.plots import INK, Sheet, Style, band, inside_legend, line, logarithmic, signal
from ...reports.plots.image import Plane, rectangle
from ...rows import Array
from ...vision.camera import Camera
from ..case_study import BORDERS, EVENTS, RANGE, SPEED, SPHERE, active_spans, at_once, phases
from ..scenes import BOWL_ROW, HEART, NOTCH, OTHER_ROW, SECOND, TIP
from . import lines as paper

VIEW = 3.7
FASTER: Style = {"color": "#F2A900", "linestyle": (0, (3, 2))}
PLANAR = (0, 1, 5)  #: Components of the pose error that are not zero.

SHORT = {RANGE: "joint 6 range", SPEED: "joint 2 speed", SPHERE: "sphere"}
SHORT |= {label: f"FOV, feature {i}" for i, label in enumerate(BORDERS, start=1)}


def draw_hyperellipses() -> Sheet:
    """Draw Fig. 2: σ = 0 for a margin of 5 % and n = 2, 4, 8, 16."""
    width = 640.0
    height = 480.0
    size = (width, height)
    sheet = Sheet(paper.LEFT)
    camera = Camera((600.0, 600.0), size)
    (ax,) = sheet.views((4.6, 4.6 * height / width))
    border = {"color": INK, "linewidth": 2.6}
    rectangle(ax, np.zeros(2), 0.5 * np.array([width, height]), solid_joinstyle="miter", **border)
    entries = [line("image", INK) | border]
    exponents = (2, 4, 8, 16)
    dashes = ("-", "--", "-.", "-")
    for n, colour, dash in zip(exponents, paper.COLOURS, dashes, strict=False):
        view = FieldOfView(camera, K=1.0, switching_gain=1.0, margin=0.05, n=n)
        for points in view.boundary(size):
            u, v = points.T
            ax.plot(u, v, color=colour, linestyle=dash, linewidth=1.7)
        entries.append(line(f"$\\sigma_V$ = 0 for $n_V$ = {n}", colour, dash))
    ax.set_xlim(-0.53 * width, 0.53 * width)
    ax.set_ylim(0.53 * height, -0.53 * height)
    ax.set_xlabel("u [px]", labelpad=1)
    ax.set_ylabel("v [px], downwards", labelpad=1)
    sheet.side_legend(entries)
    return sheet


def draw_fov(fov: Run) -> Sheet:
    """Draw Fig. 4: tracks; errors, joints and φ of the second feature."""
    sheet = Sheet(paper.LEFT)
    (ax,) = sheet.views((VIEW, VIEW))
    sheet.side_legend(paper.draw_tracks(ax, fov, upwards=True))
    *errors, joints, phi = sheet.panels(4, 2, height=1.45, gap=0.9, labels=("time [s]", ""))
    paper.pose_errors(errors, fov, PLANAR)
    names = [f"$q_{k}$" for k in (1, 2, 3)]
    paper.signals(joints, fov, fov.trajectory.q, names, "joint positions\n[rad]")
    inside_legend(joints, 3)
    paper.phi_panel(phi, fov, {SECOND: line(r"$\phi_{V,2}$", paper.CYAN)}, (-1.1, 0.2))
    return sheet


def draw_fast(fast: Run, high: Run) -> Sheet:
    """Draw Fig. 5: tracks and φ of the second feature for a small and a large switching gain."""
    sheet = Sheet(paper.LEFT)
    (ax,) = sheet.views((VIEW, VIEW))
    entries = paper.draw_tracks(ax, fast, upwards=True)
    for i in range(2):
        u, v = high.trajectory.features_px[:, i].T
        ax.plot(u, v, **FASTER, linewidth=2.0, zorder=4.5)
    sheet.side_legend([*entries, line("both features, $u^+$ = 50", **FASTER)])
    whole, near = sheet.panels(2, height=1.7, above=0.25, labels=("time [s]", ""))
    styles = (
        (fast, {"color": paper.BLUE, "label": "$u^+$ = 10"}),
        (high, {"color": FASTER["color"], "label": "$u^+$ = 50"}),
    )
    for ax in (whole, near):
        for run, style in styles:
            signal(ax, run.t, run.phi(SECOND), **style, linewidth=1.4)
    paper.phi_axis(whole, fast, (-1.1, 0.3), r"$\phi_{V,2}$")
    paper.phi_axis(near, fast, (-0.3, 0.2), r"$\phi_{V,2}$, near zero")
    bound = fast.bound(SECOND)
    band(near, -bound, bound, paper.BAND, label="$\\pm T_s u^+$ for $u^+$ = 10")
    near.set_xlim(0.0, 2.0)
    whole.tick_params(labelbottom=True)
    inside_legend(whole, 2, "lower right")
    inside_legend(near, place="upper right")
    return sheet


class Obstacle(NamedTuple):
    """Obstacle of the first marker: row, name, centre and half width of the detail [px].

    ``phi`` holds limits of φ; ``other`` is the obstacle's row of the other marker.
    """

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
    """Draw Figs. 6 to 8: tracks with a detail, errors, and φ of the border's and obstacle's row.

    The obstacle's row of the other marker gets a separate panel, together with the first marker's.
    """
    sheet = Sheet(paper.LEFT)
    sheet.bottom = 0.28
    whole, detail = sheet.views((3.0, 3.0), (2.05, 2.05), gap=0.45)
    entries = paper.draw_tracks(whole, run, upwards=True)
    rectangle(whole, np.array(met.centre), met.half, color=INK, linewidth=0.9, zorder=7)
    Plane.of(run.setup).draw_part(detail, np.array(met.centre), np.full(2, met.half))
    detail.invert_yaxis()
    detail.set_title("detail", loc="left", fontsize=8.5, pad=3)
    detail.set_xlabel("u [px]", labelpad=1)
    paper.track(detail, run, 0)
    is_violated = run.sigma(met.row) > 0.0
    if is_violated.any():
        path = run.trajectory.features_px[:, 0]
        u, v = np.where(is_violated[:, None], path, np.nan).T
        detail.plot(u, v, color=paper.RED, linewidth=2.6, zorder=5)
        entries.append(line(r"$\sigma$ > 0", paper.RED))
    sheet.side_legend(entries)
    panels = sheet.panels(4 if met.other else 3, height=1.2, labels=("time [s]", ""))
    paper.pose_errors(panels[:2], run, PLANAR)
    styles = {SECOND: line("FOV, second feature", paper.CYAN)}
    styles[met.row] = line(f"{met.name}, first feature", paper.GREEN, "-.")
    paper.phi_panel(panels[2], run, styles, met.phi)
    if met.other:  # some of its rows leave their bands by orders of magnitude
        bound = run.bound(met.other)
        styles = {met.other: line(f"{met.name}, second feature", paper.MAGENTA)}
        styles[met.row] = line(f"{met.name}, first feature", paper.GREEN)
        band(panels[3], -bound, bound, paper.BAND)
        paper.phi_panel(panels[3], run, styles, (), f"$\\phi$ of the {met.name}")
        logarithmic(panels[3].yaxis, (-1e4, -1e2, -1.0, 0.0, 1.0, 1e2), bound, 1.0)
        panels[3].set_ylim(top=1e4)
    return sheet


def frame_times(run: Run) -> list[float]:
    """Return the four times that Fig. 12 shows.

    They lie in the middle of: three simultaneous events; sliding of the third feature; sliding of
    the second feature in the second phase; sliding at the sphere.
    """
    count = at_once(run)
    three = run.t[count == count.max()]
    third_feature, _ = phases(run, BORDERS[2])
    _, second_feature = phases(run, BORDERS[1])
    _, sphere = phases(run, SPHERE)
    times = []
    for spans in ([(three[0], three[-1])], third_feature, second_feature, sphere):
        if spans:
            begin, end = spans[0]
            middle = 0.5 * (begin + end)
            nearest = np.argmin(np.abs(run.t - middle))
            times.append(float(run.t[nearest]))
    return times


def draw_tracks(case: Run) -> Sheet:
    """Draw Fig. 10: tracks in the image, position and orientation errors."""
    sheet = Sheet(paper.LEFT)
    (ax,) = sheet.views(paper.image_size(case, 3.9))
    sheet.side_legend(paper.draw_tracks(ax, case))
    paper.pose_errors(sheet.panels(2, height=1.45, labels=("time [s]", "")), case)
    return sheet


def draw_signals(case: Run) -> Sheet:
    """Draw Fig. 11: joints, speeds, max φ, and the times at which each constraint is active."""
    sheet = Sheet(1.12)
    panels = sheet.panels(4, height=1.5, above=0.4, labels=("time [s]", ""))
    q = case.trajectory.q
    qd = case.trajectory.qd
    _joint_panel(panels[0], case, q, ("q", "joint positions\n[rad]"), RANGE)
    _joint_panel(panels[1], case, qd, (r"\dot{q}", "joint speeds\n[rad/s]"), SPEED)
    signal(panels[2], case.t, case.trajectory.phi.max(axis=1), color=paper.BLUE, linewidth=1.2)
    paper.phi_axis(panels[2], case, (-0.2, 0.04), r"greatest $\phi_i$")
    _lanes(panels[3], case)
    for number, time in enumerate(frame_times(case), start=1):
        for ax in panels:
            ax.axvline(time, color="#666666", linestyle="--", linewidth=0.9, zorder=1.4)
        panels[3].annotate(
            f"frame {number}",
            (time, 1.0),
            (0, 2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            color=plots.FAINT,
        )
    return sheet


def _joint_panel(ax: Any, run: Run, values: Array, texts: tuple[str, str], event: str) -> None:
    """Draw a signal (N, n) of all joints, and the upper limit of the event's joint.

    ``texts`` are the symbol of the signal and the label of the vertical axis.
    """
    symbol, label = texts
    limited = f"{event}.upper"
    names = [f"${symbol}_{k + 1}$" for k in range(values.shape[1])]
    paper.signals(ax, run, values, names, label)
    paper.limits_around(ax, values)
    plots.above_legend(ax, 6)
    constraint: Any = run.constraint(limited)
    joint = int(constraint.joints[0])
    # active limit: value of the row's joint plus its clearance
    clearance = run.trajectory.clearance[:, run.index(limited)]
    limit = float(np.median(values[:, joint - 1] + clearance))
    style = {"color": paper.COLOURS[joint - 1], "linewidth": 1.4}
    ax.axhline(limit, **plots.REFERENCE | style, zorder=1.7)
    plots.note(ax, f"limit of joint {joint}", limit, across=0.26)


def _lanes(ax: Any, run: Run) -> None:
    """Draw the active times of each event, and mark the events active at the times of Fig. 12."""
    shown = [event for event in EVENTS if active_spans(run, event)]
    bar = {"color": INK, "linewidth": 2.6, "solid_capstyle": "butt", "zorder": 3}
    mark = plots.symbol("o", "white", size=7.0)
    times = frame_times(run)
    for lane, event in enumerate(shown):
        for first, last in active_spans(run, event):
            ax.plot([first, last], [lane, lane], **bar)
            inside = [time for time in times if first <= time <= last]
            ax.plot(inside, [lane] * len(inside), **mark, zorder=4)
    paper.over_time(ax, run)
    ax.set_yticks(range(len(shown)), [SHORT[event] for event in shown])
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0, pad=3)
