"""Figures of a scenario over time: φ and activity, errors, commanded acceleration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.suite import BASELINE
from ...rows import Array
from ...simulation import Tolerances, intervals
from ..plots.sheet import Sheet
from ..plots.style import (
    FAINT,
    INK,
    area,
    band,
    decades,
    line,
    logarithmic,
    note,
    signal,
    windows_of,
    zero_line,
)
from .view import View

BINS = 300
MEAN_BINS = 100
#: Heights of a panel of φ and of a controller's bars; gap between bars of two constraints [in].
PANEL = 1.0
LANE = 0.075
LANE_GAP = 0.09
MAX_PHI = 1e3  # φ is drawn up to this many times its sampling band
MAX_LABEL = 14  # longer labels of rows stand in two lines
ERROR_FLOOR = 1e-2  # errors are drawn down to this fraction of their tolerance


def draw_phi(view: View) -> Sheet | None:
    """Draw φ / (T_s u⁺) in one panel per row, and bars that show when each row is active."""
    if not view.phi_rows and not view.lane_rows:
        return None
    sheet = Sheet(left=1.85, right=0.2)
    named = None if view.phi_rows else view.competitors
    sheet.legend(view.entries(named))
    lane = len(view.competitors) * LANE + LANE_GAP
    lane_count = len(view.lane_rows)
    heights = [PANEL] * len(view.phi_rows)
    if lane_count:
        heights.append(lane * lane_count)
    panels = sheet.panels(len(heights), height=heights, labels=("time [s]", ""))
    for ax, label in zip(panels, view.phi_rows, strict=False):
        _draw_row(ax, view, label)
        text = label
        if len(label) > MAX_LABEL:
            text = label.replace("[", "\n[", 1)
        sheet.name(ax, text)
    if lane_count:
        activity = panels[-1]
        _draw_activity(activity, view, lane)
        for i, label in enumerate(view.lane_rows):
            place = 1.0 - (i + 0.5) / lane_count
            sheet.name(activity, label, place, fontsize=8)
    for ax in panels:
        view.time_axis(ax, view.rows_end)
    return sheet


def _draw_row(ax: Any, view: View, label: str) -> None:
    """Draw φ / (T_s u⁺) of a row into its panel."""
    band(ax, -1.0, 1.0)
    zero_line(ax)
    low = -3.0
    high = 3.0
    for name, run, style in view.lines():
        trajectory = run.trajectory
        if label not in trajectory.labels:
            continue
        i = trajectory.labels.index(label)
        step = run.Ts * run.switching_gain[i]
        relative = trajectory.phi[:, i] / step
        low = min(low, float(np.nanmin(relative, initial=low)))
        is_shown = trajectory.t <= view.rows_end
        windows = windows_of(trajectory.t[is_shown], relative[is_shown], BINS)
        marks = view.marks(name, windows.t, view.rows_end)
        ax.plot(windows.t, windows.greatest, **style, **marks)
        if name != BASELINE:
            high = max(high, float(np.nanmax(relative, initial=high)))
            area(
                ax,
                windows.t,
                windows.least,
                windows.greatest,
                color=style["color"],
                alpha=0.15,
                linewidth=0.0,
                zorder=3,
            )
    low = 1.3 * max(low, -MAX_PHI)
    high = 1.5 * min(high, MAX_PHI)
    ax.set_ylim(low, high)
    logarithmic(ax.yaxis, decades(low, high), 2.0, 1.2)
    ax.set_ylabel("φ / (Tₛ u⁺)", labelpad=1)


def _draw_activity(ax: Any, view: View, height: float) -> None:
    """Draw one thin lane of bars per controller in the band of each row."""
    ax.set_title("when each constraint is active", loc="left", fontsize=8, color=FAINT, pad=2)
    ax.set(ylim=(height * len(view.lane_rows), 0.0), yticks=[])
    ax.grid(False)
    least_length = view.rows_end / 500.0
    for i, label in enumerate(view.lane_rows):
        top = i * height
        if i % 2 == 0:
            band(ax, top, top + height, "#F6F6F6", zorder=0.2)
        for k, name in enumerate(view.competitors):
            run = view.runs[name]
            trajectory = run.trajectory
            if label not in trajectory.labels:
                continue
            row = trajectory.labels.index(label)
            active = trajectory.active[:, row]
            least_gap = max(10.0 * run.Ts, view.rows_end / 200.0)
            bars = []
            for begin, end in intervals(trajectory.t, active, least_gap):
                length = max(end - begin, least_length)
                bars.append((begin, length))
            lane_top = top + 0.5 * LANE_GAP + k * LANE
            ax.broken_barh(
                bars,
                (lane_top, 0.8 * LANE),
                color=view.looks[name].colour,
                linewidth=0.0,
                zorder=2,
            )


def draw_errors(view: View) -> Sheet:
    """Draw each error in a logarithmic panel.

    A line marks the tolerance if it decides whether the goal is reached.
    """
    quantities = [quantity for quantity in _error_quantities(view) if quantity.is_known]
    sheet = Sheet(left=0.62, right=0.2)
    sheet.legend(view.entries())
    panels = sheet.panels(
        len(quantities),
        3,
        height=2.0,
        gap=0.62,
        above=0.04,
        labels=("time [s]", ""),
    )
    for ax, quantity in zip(panels, quantities, strict=True):
        tolerance = quantity.tolerance
        floor = ERROR_FLOOR * tolerance
        greatest = 10.0 * floor
        for error in quantity.errors.values():
            greatest = float(np.nanmax(error, initial=greatest))
        top = 2.0 * greatest
        for name, run, style in view.lines():
            t = run.trajectory.t
            error = np.maximum(quantity.errors[name], 1e-3 * floor)
            signal(ax, t, error, **style, **view.marks(name, t, view.end))
        if quantity.decides:
            ax.axhline(tolerance, color=INK, linestyle=":", linewidth=1.0, zorder=1.6)
            note(ax, "tolerance", tolerance, above=False)
        view.time_axis(ax)
        ax.set_ylim(floor, top)
        logarithmic(ax.yaxis, decades(floor, top))
        ax.set_ylabel(quantity.label, labelpad=2)
    return sheet


class ErrorQuantity(NamedTuple):
    """Error of a kind in all runs of a view.

    ``decides`` is True if its tolerance decides whether the goal is reached; ``errors`` (N,) are
    keyed by controller, in the unit of the label.
    """

    label: str
    tolerance: float
    decides: bool
    errors: dict[str, Array]

    @property
    def is_known(self) -> bool:
        """True if any value is finite."""
        return any(np.isfinite(error).any() for error in self.errors.values())


def _error_quantities(view: View) -> list[ErrorQuantity]:
    """Return the errors of the markers, if they decide about the goal, and of the camera's pose."""
    setup = view.setup
    accepted = Tolerances() if setup is None else setup.tolerances
    decided_by_pose = setup is not None and setup.task.feature.reached_by == "pose"
    image = {}
    position = {}
    angle = {}
    for name, run in view.runs.items():
        trajectory = run.trajectory
        image[name] = trajectory.feature_error_px
        position[name] = 1e3 * trajectory.camera_error[:, 0]
        angle[name] = 1e3 * trajectory.camera_error[:, 1]
    quantities = []
    if setup is not None and not decided_by_pose:
        quantities.append(ErrorQuantity("image error [px]", accepted.feature_px, True, image))
    quantities += [
        ErrorQuantity(
            "position error [mm]", 1e3 * accepted.translation_m, decided_by_pose, position
        ),
        ErrorQuantity(
            "orientation error [mrad]", 1e3 * accepted.rotation_rad, decided_by_pose, angle
        ),
    ]
    return quantities


def draw_acceleration(view: View) -> Sheet:
    """Draw mean and range of q̈_c of all joints in short windows, with equal axes."""
    commands = {}
    for name in view.shown:
        trajectory = view.runs[name].trajectory
        commands[name] = (trajectory.t, trajectory.qdd_command)
    limit = 1.3 * _largest_command(view)
    sheet, panels, colours = joint_panels(view, commands, "q̈ [rad/s²]", (1.0, limit), 0.26)
    for ax, name in zip(panels, commands, strict=True):
        view.title(ax, name)
        t, qdd = commands[name]
        windows = windows_of(t, qdd, MEAN_BINS)
        for mean, colour in zip(windows.mean.T, colours, strict=False):
            ax.plot(windows.t, mean, color=colour, linewidth=1.1, zorder=3)
    return sheet


def _largest_command(view: View) -> float:
    """Return the largest |q̈_c| of all runs, without their largest 0.05 % samples; at least 1."""
    largest = 1.0
    for run in view.runs.values():
        command = run.trajectory.qdd_command
        sizes = np.abs(command[np.isfinite(command)])
        if len(sizes):
            largest = max(largest, float(np.quantile(sizes, 0.9995)))
    return largest


def joint_panels(
    view: View,
    values: Mapping[str, tuple[Array, Array]],
    label: str,
    scale: tuple[float, float],
    above: float,
) -> tuple[Sheet, list[Any], list[Any]]:
    """Draw the range of the joints' values (N, n) at t (N,) in one panel per controller.

    Return the sheet, its panels and the colours of joints. Ranges are those of short windows. Axes
    are linear between ± the first value of ``scale``, logarithmic beyond, and end at ± the second.
    """
    from matplotlib import colormaps

    linear, limit = scale
    n = max(joints.shape[1] for _, joints in values.values())
    colours = []
    entries = []
    for k in range(n):
        colour = colormaps["viridis"](0.92 * k / max(n - 1, 1))
        colours.append(colour)
        entries.append(line(f"joint {k + 1}", colour))
    sheet = Sheet(left=0.62, right=0.2)
    sheet.legend(entries, min(n, 8))
    panels = sheet.panels(
        len(values),
        3,
        height=1.25,
        gap=0.3,
        above=above,
        labels=("time [s]", label),
        same_y=True,
    )
    for ax, (t, joints) in zip(panels, values.values(), strict=True):
        windows = windows_of(t, joints, BINS)
        # Joints that vary most lie below the others.
        variation = np.nan_to_num(windows.greatest - windows.least).mean(axis=0)
        for rank, k in enumerate(np.argsort(-variation, kind="stable")):
            area(
                ax,
                windows.t,
                windows.least[:, k],
                windows.greatest[:, k],
                color=colours[k],
                alpha=0.4,
                linewidth=0.4,
                zorder=2 + 0.01 * rank,
            )
        view.time_axis(ax)
        # Few and short labels, so that those of neighbouring panels do not overlap.
        ax.locator_params(axis="x", nbins=5, steps=[1, 2, 5, 10])
        ax.set_ylim(-limit, limit)
        logarithmic(ax.yaxis, decades(-limit, limit, linear), linear, 0.7)
    return sheet, panels, colours
