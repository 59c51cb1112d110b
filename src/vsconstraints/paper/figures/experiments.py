"""Figs. 14 to 19: the experiments, simulated."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...reports.plots import INK, Sheet, above_legend, line, signal, symbol
from ...reports.plots.image import tracks
from ...rows import Array
from ...vision.features import ImagePoints
from . import lines as paper

VISIBILITY = ("fov", "occlusion")
DASHED: Any = (0, (4, 2))
INITIAL, DESIRED = symbol("o", paper.START, label="initial pose"), symbol("x", INK, label="desired pose")


def visibility_rows(run: Run) -> list[str]:
    """Labels of the rows on where markers are in the image."""
    return [label for label, kind in zip(run.trajectory.labels, run.record.kinds, strict=True) if kind in VISIBILITY]


def is_image_based(run: Run) -> bool:
    """Whether the task is about the markers' pixels."""
    return isinstance(run.setup.task.feature, ImagePoints)


def image_errors(run: Run) -> Array:
    """(N, 2 m) u₁, v₁, u₂, … minus where the goal wants them [px]."""
    goal = run.setup.task.goals[-1].pixels
    return np.asarray((run.trajectory.features_px - goal).reshape(len(run.t), -1))


def draw_signals(run: Run) -> Sheet:
    """Figs. 14 and 17: errors, control action and visibility constraint functions."""
    image = is_image_based(run)
    sheet = Sheet(paper.LEFT)
    *errors, action, phi = sheet.panels(3 if image else 4, height=1.4, above=0.4, labels=("time [s]", ""))
    if image:
        for k, values in enumerate(image_errors(run).T):
            marker, vertical = divmod(k, 2)
            look = {"color": paper.COLOURS[marker], "linestyle": "--" if vertical else "-", "linewidth": 1.3}
            signal(errors[0], run.t, values, **look, label=f"${'v' if vertical else 'u'}_{marker + 1}$")
        paper.over_time(errors[0], run, "image\nerrors [px]")
        above_legend(errors[0], 8)
    else:
        paper.pose_errors(errors, run, legend=above_legend)
    qdd, rows = run.trajectory.qdd_command, visibility_rows(run)
    names = [rf"$\ddot{{q}}_{{c{k + 1}}}$" for k in range(qdd.shape[1])]
    paper.signals(action, run, qdd, names, "control action\n[rad/s²]", linewidth=1.1)
    above_legend(action, len(names))
    values = run.trajectory.phi[:, [run.index(row) for row in rows]]
    least = max(float(np.quantile(values, 0.002)), -1.6) - 0.05
    # what stays below the panel has no name above it, and the others keep their colours
    seen = (values.max(axis=0) > least).tolist()
    names = [f"{'' if see else '_'}{row.partition('[')[2].rstrip(']')}" for row, see in zip(rows, seen, strict=True)]
    paper.signals(phi, run, values, names, "", linewidth=1.2)
    paper.phi_axis(phi, run, (least, 0.25), "constraint\nfunctions $\\phi_V$")
    above_legend(phi, max(sum(seen), 1))
    return sheet


def _poses(ax: Any, run: Run) -> None:
    """Where markers start, and where the goal wants them."""
    ax.plot(*run.setup.task.goals[-1].pixels.T, **DESIRED, zorder=6.3)
    ax.plot(*run.trajectory.features_px[0].T, **INITIAL, zorder=6.2)


def draw_tracks(run: Run) -> Sheet:
    """Figs. 15 and 18: tracks in the image, and the target as the camera sees it in the desired pose."""
    sheet = Sheet(paper.LEFT)
    ax = paper.image_view(sheet, run, 3.75)
    pixels, entries = run.trajectory.features_px, []
    for corners, colour in ((pixels[0], paper.START), (run.setup.task.goals[-1].pixels, INK)):
        ax.plot(*corners[[*range(len(corners)), 0]].T, color=colour, linewidth=1.0, linestyle=(0, (2, 2)), zorder=3.5)
    for i, start in enumerate(pixels[0]):
        paper.track(ax, run, i, color=paper.COLOURS[i])
        ax.annotate(str(i + 1), start, (7, 5), textcoords="offset points", fontsize=8.5, zorder=7)
        entries.append(line(f"marker {i + 1}", paper.COLOURS[i]))
    _poses(ax, run)
    sheet.side_legend([*entries, INITIAL, DESIRED, *paper.boundaries(run)])
    return sheet


def draw_comparison(exact: Run, erroneous: Run) -> Sheet:
    """Figs. 16 and 19: without and with errors in the gradient vector."""
    looks = (line("no errors", paper.BLUE), line("30 % error in the gradient", paper.MAGENTA, DASHED))
    runs = ((exact, {"color": paper.BLUE}), (erroneous, {"color": paper.MAGENTA, "linestyle": DASHED}))
    sheet = Sheet(paper.LEFT)
    if is_image_based(exact):
        sheet.legend(looks)
        (ax,) = sheet.panels(1, height=2.3, labels=("time [s]", ""))
        for run, look in runs:
            for values in image_errors(run).T:
                signal(ax, run.t, values, **look, linewidth=1.2)
        paper.over_time(ax, exact, "visual feature errors [px]")
    else:
        ax = paper.image_view(sheet, exact, 3.0)
        for run, look in runs:
            tracks(ax, run.trajectory.features_px, **look, linewidth=1.8, zorder=4)
        _poses(ax, exact)
        sheet.side_legend([*looks, INITIAL, DESIRED, *paper.boundaries(exact)])
    speeds = sheet.panels(exact.trajectory.qd.shape[1], 3, height=1.2, gap=0.62, above=0.38, labels=("time [s]", ""))
    for k, ax in enumerate(speeds):
        for run, look in runs:
            signal(ax, run.t, run.trajectory.qd[:, k], **look, linewidth=1.3)
        paper.over_time(ax, exact)
        paper.limits_around(ax, np.concatenate([run.trajectory.qd[:, k] for run, _ in runs]), 0.15)
        ax.set_title(rf"$\dot{{q}}_{{c{k + 1}}}$ [rad/s]", loc="left", pad=3)
    return sheet
