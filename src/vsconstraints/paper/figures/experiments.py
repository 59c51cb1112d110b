"""Figs. 14 to 19: the experiments, simulated."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...reports.plots import INK, Sheet, above_legend, line, signal, symbol
from ...reports.plots.image import Plane, tracks
from ...rows import Array
from ...vision.features import ImagePoints
from . import lines as paper


def is_image_based(run: Run) -> bool:
    """True if the task is defined by the markers' pixels."""
    return isinstance(run.setup.task.feature, ImagePoints)


def image_errors(run: Run) -> Array:
    """Errors (N, 2 m) of u₁, v₁, u₂, … relative to the goal [px]."""
    errors = run.trajectory.features_px - _goal(run)
    return errors.reshape(len(run.t), -1)


def _goal(run: Run) -> Array:
    return np.asarray(run.setup.task.goals[-1].pixels)


def draw_signals(run: Run) -> Sheet:
    """Draw Figs. 14 and 17: errors, control action and visibility constraint functions."""
    image = is_image_based(run)
    sheet = Sheet(paper.LEFT)
    count = 3 if image else 4
    *errors, action, phi = sheet.panels(count, height=1.4, above=0.4, labels=("time [s]", ""))
    if image:
        _draw_image_errors(errors[0], run)
    else:
        paper.pose_errors(errors, run, legend=above_legend)
    qdd = run.trajectory.qdd_command
    names = [rf"$\ddot{{q}}_{{c{k + 1}}}$" for k in range(qdd.shape[1])]
    paper.signals(action, run, qdd, names, "control action\n[rad/s²]", linewidth=1.1)
    above_legend(action, len(names))
    _draw_phi(phi, run)
    return sheet


def _draw_image_errors(ax: Any, run: Run) -> None:
    """Draw the errors of all markers' pixels, vertical ones dashed."""
    for k, values in enumerate(image_errors(run).T):
        marker, vertical = divmod(k, 2)
        direction = "v" if vertical else "u"
        signal(
            ax,
            run.t,
            values,
            color=paper.COLOURS[marker],
            linestyle="--" if vertical else "-",
            linewidth=1.3,
            label=f"${direction}_{marker + 1}$",
        )
    paper.over_time(ax, run, "image\nerrors [px]")
    above_legend(ax, 8)


def _draw_phi(ax: Any, run: Run) -> None:
    """Draw φ of the visibility rows; rows below the panel have no name in the legend."""
    rows = [*run.labels("fov"), *run.labels("occlusion")]
    columns = [run.index(row) for row in rows]
    values = run.trajectory.phi[:, columns]
    nearly_least = float(np.quantile(values, 0.002))
    bottom = max(nearly_least, -1.6) - 0.05
    names = []
    n_shown = 0
    for row, greatest in zip(rows, values.max(axis=0), strict=True):
        name = row.partition("[")[2].rstrip("]")
        if greatest > bottom:
            n_shown += 1
        else:
            name = f"_{name}"  # matplotlib leaves out names with _
        names.append(name)
    paper.signals(ax, run, values, names, "", linewidth=1.2)
    paper.phi_axis(ax, run, (bottom, 0.25), "constraint\nfunctions $\\phi_V$")
    above_legend(ax, max(n_shown, 1))


def draw_tracks(run: Run) -> Sheet:
    """Draw Figs. 15 and 18: tracks in the image, and the target at start and goal."""
    sheet = Sheet(paper.LEFT)
    (ax,) = sheet.views(paper.image_size(run, 3.75))
    entries = paper.draw_tracks(ax, run)
    start = run.trajectory.features_px[0]
    for name, corners, colour in (("start", start, paper.GREEN), ("goal", _goal(run), INK)):
        style = line(f"target, {name}", colour, (0, (2, 2)), linewidth=1.0)
        u, v = np.vstack((corners, corners[:1])).T
        ax.plot(u, v, **style, zorder=3.5)
        entries.append(style)
    sheet.side_legend(entries)
    return sheet


def draw_comparison(exact: Run, erroneous: Run) -> Sheet:
    """Draw Figs. 16 and 19: without and with errors in the gradient vector."""
    styles = (
        line("no errors", paper.BLUE),
        line("30 % error in the gradient", paper.MAGENTA, paper.DASHED),
    )
    runs = (
        (exact, {"color": paper.BLUE}),
        (erroneous, {"color": paper.MAGENTA, "linestyle": paper.DASHED}),
    )
    sheet = Sheet(paper.LEFT)
    if is_image_based(exact):
        sheet.legend(styles)
        (ax,) = sheet.panels(1, height=2.3, labels=("time [s]", ""))
        for run, style in runs:
            for values in image_errors(run).T:
                signal(ax, run.t, values, **style, linewidth=1.2)
        paper.over_time(ax, exact, "visual feature errors [px]")
    else:
        (ax,) = sheet.views(paper.image_size(exact, 3.0))
        plane = Plane.of(exact.setup)
        plane.draw(ax)
        for run, style in runs:
            tracks(ax, run.trajectory.features_px, **style, linewidth=1.8, zorder=4)
        u, v = exact.trajectory.features_px[0].T
        ax.plot(u, v, **symbol("o", *paper.START), zorder=6.2)
        start = symbol("o", *paper.START, label="start")
        sheet.side_legend([*styles, start, *plane.entries("boundary")])
    n = exact.trajectory.qd.shape[1]
    speeds = sheet.panels(n, 3, height=1.2, gap=0.62, above=0.38, labels=("time [s]", ""))
    for k, ax in enumerate(speeds):
        shown = []
        for run, style in runs:
            speed = run.trajectory.qd[:, k]
            signal(ax, run.t, speed, **style, linewidth=1.3)
            shown.append(speed)
        paper.over_time(ax, exact)
        paper.limits_around(ax, np.concatenate(shown), 0.15)
        ax.set_title(rf"$\dot{{q}}_{{c{k + 1}}}$ [rad/s]", loc="left", pad=3)
    return sheet
