"""Figs. 14 to 19: the experiments, simulated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...features import ImagePoints
from ...reports.figures.sheet import WIDTH, Sheet
from ..runs import Run
from .case_study import COLOURS
from .page import (
    AXES,
    BLUE,
    DARK,
    JOINTS,
    LEFT,
    MAGENTA,
    RIGHT,
    START,
    Page,
    end_symbol,
    image_handles,
    image_plane,
    limits_around,
    line_handle,
    signal,
    symbol_handle,
    time_axis,
    track,
    zero_line,
)


def visibility_rows(run: Run) -> list[str]:
    """Labels of the rows on where markers are in the image."""
    return [label for label, kind in zip(run.trajectory.labels, run.record.kinds, strict=True) if kind in VISIBILITY]


VISIBILITY = ("fov", "occlusion")


def draw_signals(run: Run, path: Path) -> None:
    """Figs. 14 and 17: errors, control action and visibility constraint functions."""
    image = isinstance(run.setup.task.feature, ImagePoints)
    page = Page([], 3 if image else 4, columns=1, panel_height=1.4, row_gap=0.42, views_top=0.42)
    *errors, action, phi = page.panels
    if image:
        _image_errors(errors[0], run)
    else:
        _pose_errors(errors[0], errors[1], run)
    qdd = run.trajectory.qdd_command
    for k in range(qdd.shape[1]):
        signal(
            action, run, qdd[:, k], color=JOINTS[k % len(JOINTS)], linewidth=1.1, label=rf"$\ddot{{q}}_{{c{k + 1}}}$"
        )
    time_axis(action, run, "control action\n[rad/s²]")
    _above(action, qdd.shape[1])
    for k, label in enumerate(visibility_rows(run)):
        colour = COLOURS[k % len(COLOURS)]
        signal(phi, run, run.phi(label), color=colour, label=label.partition("[")[2].rstrip("]"), linewidth=1.2)
    zero_line(phi)
    time_axis(phi, run, "constraint\nfunctions $\\phi_V$")
    least = float(np.quantile(run.trajectory.phi[:, [run.index(row) for row in visibility_rows(run)]], 0.002))
    phi.set_ylim(max(least, -1.6) - 0.05, 0.25)
    _above(phi, 4)
    page.sheet.save(path)


def _above(ax: Any, columns: int) -> None:
    ax.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.02), ncols=columns, handlelength=1.5, columnspacing=1.2, fontsize=8.5
    )


def _pose_errors(position: Any, orientation: Any, run: Run) -> None:
    for ax, first, unit, names in (
        (position, 0, "position\nerror [m]", "xyz"),
        (orientation, 3, "orientation\nerror [rad]", (r"\alpha", r"\beta", r"\gamma")),
    ):
        for j, ((colour, line), name) in enumerate(zip(AXES, names, strict=True)):
            signal(ax, run, run.trajectory.error[:, first + j], color=colour, linestyle=line, label=f"$e_{{{name}}}$")
        time_axis(ax, run, unit)
        _above(ax, 3)


def image_errors(run: Run) -> np.ndarray:
    """(N, 2 m) u₁, v₁, u₂, … minus where the goal wants them [px]."""
    goal = run.setup.task.goals[-1].pixels
    return np.asarray((run.trajectory.features_px - goal).reshape(len(run.t), -1))


def _image_errors(ax: Any, run: Run) -> None:
    errors = image_errors(run)
    for k in range(errors.shape[1]):
        marker, vertical = divmod(k, 2)
        signal(
            ax, run, errors[:, k], color=COLOURS[marker % len(COLOURS)], linestyle="--" if vertical else "-",
            linewidth=1.3, label=f"${'v' if vertical else 'u'}_{marker + 1}$",
        )  # fmt: skip
    time_axis(ax, run, "image\nerrors [px]")
    _above(ax, errors.shape[1])


def draw_tracks(run: Run, path: Path) -> None:
    """Figs. 15 and 18: tracks in the image, and the target as the camera sees it in the desired pose."""
    width, height = run.setup.scene.camera.size
    shown = 5.0
    page = Page([(shown, shown * height / width)], 0)
    ax = page.views[0]
    image_plane(ax, run)
    goal = run.setup.task.goals[-1].pixels
    pixels = run.trajectory.features_px
    _outline(ax, pixels[0], START)
    _outline(ax, goal, DARK)
    for i in range(pixels.shape[1]):
        track(ax, run, i, color=COLOURS[i % len(COLOURS)])
        end_symbol(ax, goal[i], "x", DARK, DARK, 6.3)
        end_symbol(ax, pixels[0, i], "o", START, DARK, 6.2)
        ax.annotate(str(i + 1), pixels[0, i], (7, 5), textcoords="offset points", fontsize=8.5, zorder=7)
    handles = [line_handle(c, "-", f"marker {i + 1}") for i, c in enumerate(COLOURS[: pixels.shape[1]])]
    ends = [symbol_handle("o", START, "initial pose"), symbol_handle("x", DARK, "desired pose")]
    page.legend([*handles, *ends, *image_handles("boundary")])
    page.sheet.save(path)


def _outline(ax: Any, corners: Any, colour: str) -> None:
    closed = np.concatenate((corners, corners[:1]))
    ax.plot(*closed.T, color=colour, linewidth=1.0, linestyle=(0, (2, 2)), zorder=3.5)


def draw_comparison(exact: Run, erroneous: Run, path: Path) -> None:
    """Figs. 16 and 19: without and with errors in the gradient vector."""
    image = isinstance(exact.setup.task.feature, ImagePoints)
    joints = exact.trajectory.qd.shape[1]
    top_height, row, gap = (2.3, 1.2, 0.4) if image else (3.0, 1.2, 0.4)
    rows = -(-joints // 3)
    top = 0.45 if image else 0.12
    grid_top = top + top_height + 0.8
    sheet = Sheet(grid_top + rows * (row + gap) + 0.1)
    runs = ((exact, BLUE, "-", "no errors"), (erroneous, MAGENTA, (0, (4, 2)), "30 % error in the gradient"))
    handles = [line_handle(colour, line, name) for _, colour, line, name in runs]
    if image:
        ax = sheet.axes(LEFT, top, WIDTH - LEFT - RIGHT, top_height)
        for run, colour, line, _ in runs:
            errors = image_errors(run)
            for k in range(errors.shape[1]):
                signal(ax, run, errors[:, k], color=colour, linestyle=line, linewidth=1.2)
        time_axis(ax, exact, "visual feature errors [px]")
        ax.set_xlabel("time [s]", labelpad=2)
        sheet.legend(handles, LEFT, 0.14, 2)
    else:
        width, height = exact.setup.scene.camera.size
        ax = sheet.axes(LEFT, top, top_height * width / height, top_height)
        image_plane(ax, exact)
        for run, colour, line, _ in runs:
            for i in range(run.trajectory.features_px.shape[1]):
                track(ax, run, i, color=colour, linestyle=line, linewidth=1.8)
        for i, goal in enumerate(exact.setup.task.goals[-1].pixels):
            end_symbol(ax, goal, "x", DARK, DARK, 6.3)
            end_symbol(ax, exact.trajectory.features_px[0, i], "o", START, DARK, 6.2)
        ends = [symbol_handle("o", START, "initial pose"), symbol_handle("x", DARK, "desired pose")]
        boundary = image_handles("boundary")
        sheet.legend([*handles, *ends, *boundary], LEFT + top_height * width / height + 0.3, 0.2, 1, labelspacing=0.75)
    _speeds(sheet, runs, grid_top, row, gap)
    sheet.save(path)


def _speeds(sheet: Sheet, runs: Any, top: float, height: float, gap: float) -> None:
    joints = runs[0][0].trajectory.qd.shape[1]
    columns, across = 3, 0.62
    width = (WIDTH - LEFT - RIGHT - (columns - 1) * across) / columns
    for k in range(joints):
        r, c = divmod(k, columns)
        ax = sheet.axes(LEFT + c * (width + across), top + r * (height + gap), width, height)
        values = np.concatenate([run.trajectory.qd[:, k] for run, *_ in runs])
        for run, colour, line, _ in runs:
            signal(ax, run, run.trajectory.qd[:, k], color=colour, linestyle=line, linewidth=1.3)
        time_axis(ax, runs[0][0], "")
        limits_around(ax, float(values.min()), float(values.max()), 0.15)
        ax.set_title(rf"$\dot{{q}}_{{c{k + 1}}}$ [rad/s]", loc="left", pad=3, fontsize=9)
        last = k + columns >= joints
        ax.tick_params(labelbottom=last)
        if last:
            ax.set_xlabel("time [s]", labelpad=2)
