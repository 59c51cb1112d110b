"""Common parts of the paper's figures: colours, signals over time, tracks with end symbols."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...reports.plots import INK, Style, inside_legend, line, signal, symbol, time_axis, zero_line
from ...reports.plots.image import Plane
from ...rows import Array

#: Colours of up to six joints, and of four markers.
COLOURS = ("#1447C4", "#C2188F", "#2E8B3D", "#E07B00", "#7A4FBF", "#1A1A1A")

BLUE, MAGENTA, GREEN = COLOURS[:3]
RED = "#D42A2A"
CYAN = "#00A0C6"
BAND = "#DCE6FA"
#: Face and edge of symbols at the start, at the end of the first phase, and at the end.
START = ("#86DC6A", INK)
SWITCH = ("white", INK)
END = (INK, "white")
DASHED: Any = (0, (4, 2))

PARTS = ("x", "y", "z", r"\alpha", r"\beta", r"\gamma")  #: Components of the camera's pose error.

LEFT = 0.85


def track(ax: Any, run: Run, marker: int, **style: Any) -> None:
    """Draw the path of a marker (counted from 0) in the image.

    Symbols mark its start and the end of each phase.
    """
    tracks = run.trajectory.features_px
    u, v = tracks[:, marker].T
    marks = "o*" if tracks.shape[1] == 2 else "o^s*"
    mark = marks[marker]
    usual = {"color": COLOURS[marker], "linewidth": 2.0, "zorder": 4}
    ax.plot(u, v, **{**usual, **style})
    for goal in run.setup.task.goals[1:]:
        k = int(np.searchsorted(run.t, goal.from_time - 1e-9))
        ax.plot(u[k], v[k], **symbol(mark, *SWITCH), zorder=5.9)
    ax.plot(u[-1], v[-1], **symbol(mark, *END), zorder=6)
    ax.plot(u[0], v[0], **symbol(mark, *START), zorder=6.2)


def draw_tracks(ax: Any, run: Run, upwards: bool = False) -> list[Style]:
    """Draw the whole image with the paths of all markers; return entries for a legend."""
    plane = Plane.of(run.setup)
    count = run.trajectory.features_px.shape[1]
    plane.draw(ax, upwards=upwards)
    for i in range(count):
        track(ax, run, i)
    entries = [line(f"feature {i + 1}", COLOURS[i]) for i in range(count)]
    shown = {"start": START, "end of phase 1": SWITCH, "end": END}
    if len(run.setup.task.goals) == 1:
        del shown["end of phase 1"]
    entries += [symbol("o", *colours, label=name) for name, colours in shown.items()]
    return [*entries, *plane.entries("boundary")]


def image_size(run: Run, height: float) -> tuple[float, float]:
    """Width and height of axes for the image [in]."""
    width_px, height_px = map(float, run.setup.scene.camera.size)
    return height * width_px / height_px, height


def over_time(ax: Any, run: Run, label: str = "") -> None:
    """Set the time axis from start to end of a run, with the changes of its goal."""
    changes = [goal.from_time for goal in run.setup.task.goals[1:]]
    time_axis(ax, float(run.t[-1]), changes, label, linewidth=1.8)
    ax.locator_params(axis="y", nbins=4, steps=[1, 2, 2.5, 5, 10])


def signals(
    ax: Any, run: Run, values: Array, names: Iterable[str], label: str, **style: Any
) -> None:
    """Draw signals (N, k) of a run over time, in the order of the colours."""
    for k, name in enumerate(names):
        usual = {"color": COLOURS[k % len(COLOURS)], "label": name, "linewidth": 1.3}
        signal(ax, run.t, values[:, k], **{**usual, **style})
    over_time(ax, run, label)


def pose_errors(
    panels: Sequence[Any],
    run: Run,
    parts: Iterable[int] = range(6),
    legend: Callable[..., None] = inside_legend,
) -> None:
    """Draw some components of the camera's position and orientation error, one panel each."""
    kinds = (("position\nerror [m]", (0, 1, 2)), ("orientation\nerror [rad]", (3, 4, 5)))
    for ax, (label, components) in zip(panels, kinds, strict=True):
        shown = [part for part in components if part in parts]
        for part, dash in zip(shown, ("-", "--", ":"), strict=False):
            style = {
                "color": (BLUE, MAGENTA, RED)[part % 3],
                "linestyle": dash,
                "label": f"$e_{{{PARTS[part]}}}$",
            }
            signal(ax, run.t, run.trajectory.error[:, part], **style)
        over_time(ax, run, label)
        legend(ax, len(shown))


def phi_axis(ax: Any, run: Run, limits: tuple[float, ...], label: str) -> None:
    """Format a panel for values φ of rows, with a line at the boundary of the allowed values."""
    zero_line(ax)
    over_time(ax, run, label)
    if limits:
        ax.set_ylim(*limits)


def phi_panel(
    ax: Any,
    run: Run,
    styles: Mapping[str, Style],
    limits: tuple[float, ...],
    label: str = "constraint\nfunction $\\phi$",
) -> None:
    """Draw φ of some of a run's rows, each with its own style."""
    for row, style in styles.items():
        signal(ax, run.t, run.phi(row), **style | {"linewidth": 1.2})
    phi_axis(ax, run, limits, label)
    inside_legend(ax, place="lower right")


def limits_around(ax: Any, values: Array, share: float = 0.06) -> None:
    """Set vertical limits around values, with a margin."""
    low = float(values.min())
    high = float(values.max())
    margin = share * (high - low)
    ax.set_ylim(low - margin, high + margin)
