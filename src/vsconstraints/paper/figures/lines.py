"""What the paper's figures have in common: its colours, signals over time, tracks with symbols at their ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ...comparisons.run import Run
from ...reports.plots import INK, Sheet, inside_legend, signal, symbol, time_axis, zero_line
from ...reports.plots.image import Plane
from ...rows import Array

#: One for each of up to six joints, and for each of four markers.
COLOURS = ("#1447C4", "#C2188F", "#2E8B3D", "#E07B00", "#7A4FBF", "#1A1A1A")

BLUE, MAGENTA, GREEN = COLOURS[:3]
RED, CYAN = "#D42A2A", "#00A0C6"
BAND = "#DCE6FA"
#: The paper's light green of starting positions.
START = "#86DC6A"

DASHES = ("-", "--", ":")
PARTS = ("x", "y", "z", r"\alpha", r"\beta", r"\gamma")  #: Of an error of the camera's pose.

LEFT = 0.85


def image_view(sheet: Sheet, run: Run, height: float, upwards: bool = False) -> Any:
    """Axes of the whole image, with what constrains markers in it."""
    plane = Plane.of(run.setup)
    (ax,) = sheet.views((height * plane.size[0] / plane.size[1], height))
    plane.draw(ax, upwards=upwards)
    return ax


def boundaries(run: Run, boundary: str = "boundary") -> list[dict[str, Any]]:
    """Legend entries of the image and what is forbidden in it."""
    return Plane.of(run.setup).entries(boundary)


def track(ax: Any, run: Run, marker: int, **look: Any) -> None:
    """The path of a marker (counted from 0) in the image."""
    ax.plot(*run.trajectory.features_px[:, marker].T, **{"linewidth": 2.0, "zorder": 4, **look})


def ends(ax: Any, pixels: Array, marker: int, mark: str) -> None:
    """Symbols where a marker starts and ends, from the markers' pixels (N, M, 2)."""
    ax.plot(*pixels[-1, marker], **symbol(mark, INK, "white"), zorder=6)
    ax.plot(*pixels[0, marker], **symbol(mark, START), zorder=6.2)


def over_time(ax: Any, run: Run, label: str = "") -> None:
    """From start to end of a run, with the changes of its goal."""
    time_axis(ax, float(run.t[-1]), [goal.from_time for goal in run.setup.task.goals[1:]], label, linewidth=1.8)
    ax.locator_params(axis="y", nbins=4, steps=[1, 2, 2.5, 5, 10])


def signals(ax: Any, run: Run, values: Array, names: Iterable[str], label: str, **look: Any) -> None:
    """Signals (N, k) of a run over time, in the order of the colours."""
    for k, name in enumerate(names):
        signal(ax, run.t, values[:, k], **{"color": COLOURS[k % len(COLOURS)], "label": name, "linewidth": 1.3, **look})
    over_time(ax, run, label)


def pose_errors(
    panels: Sequence[Any], run: Run, parts: Iterable[int] = range(6), legend: Callable[..., None] = inside_legend
) -> None:
    """Errors of the camera's position and orientation in a panel each, some of their six parts."""
    kinds = (("position\nerror [m]", (0, 1, 2)), ("orientation\nerror [rad]", (3, 4, 5)))
    for ax, (label, own) in zip(panels, kinds, strict=True):
        shown = [part for part in own if part in parts]
        for part, dash in zip(shown, DASHES, strict=False):
            look = {"color": (BLUE, MAGENTA, RED)[part % 3], "linestyle": dash, "label": f"$e_{{{PARTS[part]}}}$"}
            signal(ax, run.t, run.trajectory.error[:, part], **look)
        over_time(ax, run, label)
        legend(ax, len(shown))


def phi_axis(ax: Any, run: Run, limits: tuple[float, ...], label: str) -> None:
    """Of values φ of a run's rows, with the line below which they are allowed."""
    zero_line(ax)
    over_time(ax, run, label)
    if limits:
        ax.set_ylim(*limits)


def phi_panel(
    ax: Any,
    run: Run,
    looks: Mapping[str, dict[str, Any]],
    limits: tuple[float, ...],
    label: str = "constraint\nfunction $\\phi$",
) -> None:
    """φ of some of a run's rows, each with a look of its own."""
    for row, look in looks.items():
        signal(ax, run.t, run.phi(row), **look | {"linewidth": 1.2})
    phi_axis(ax, run, limits, label)
    inside_legend(ax, place="lower right")


def limits_around(ax: Any, values: Array, share: float = 0.06) -> None:
    """Vertical limits around values, with a little room."""
    low, high = float(values.min()), float(values.max())
    ax.set_ylim(low - share * (high - low), high + share * (high - low))
