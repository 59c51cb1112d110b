"""What the figures of studies have in common: panels on a sheet, and lines of points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from ..reports.figures.sheet import STYLE, WIDTH, Sheet, style
from ..reports.style import Look, darker, looks
from .laws import LAWS

INK = "#222222"
REFERENCE = {"color": INK, "linewidth": 1.1, "linestyle": (0, (4, 2))}
"""How bounds and references are drawn."""

SHADE = "#F6F0DC"
"""Background of a part of a panel that differs from the rest."""

LOOKS: dict[str, Look] = looks(["tracking", *(law.name for law in LAWS)])

SCENARIO_TITLES: dict[str, str] = {
    "example-2d-fov": "first example",
    "example-2d-fast-high-gain": "first example, fast",
    "case-study-6r": "case study",
    "experiment-1-pbvs": "experiment 1 (PBVS)",
    "experiment-2-ibvs": "experiment 2 (IBVS)",
}


def scenario_title(scenario: str) -> str:
    """What figures and sentences call a scenario."""
    return SCENARIO_TITLES.get(scenario, scenario)


def sentence_start(scenario: str) -> str:
    """The same at the beginning of a sentence."""
    title = scenario_title(scenario)
    return title[:1].upper() + title[1:]


class Grid:
    """Panels in rows and columns, a legend above; use as ``with``: the sheet is written at the end.

    Parameters
    ----------
    path
        Where to.
    rows, columns
        How many panels.
    height
        Of each panel [in].
    legend
        Height that is left free for the legend [in].
    left, gap, below
        Margin at the left, between columns, and below each row [in].
    right
        Margin at the right [in].
    """

    def __init__(
        self,
        path: Path,
        rows: int,
        columns: int,
        *,
        height: float = 1.7,
        legend: float = 0.35,
        left: float = 0.75,
        gap: float = 0.7,
        below: float = 0.5,
        right: float = 0.15,
    ) -> None:
        self.path = path
        self._rc: Any = style(STYLE)
        self._rc.__enter__()
        top, title = legend + 0.08, 0.28
        self.sheet = Sheet(top + title + rows * height + (rows - 1) * 0.15 + below)
        width = (WIDTH - left - right - (columns - 1) * gap) / columns
        self.left, self.legend_top = left, 0.08
        self.axes = [
            [
                self.sheet.axes(left + j * (width + gap), top + title + i * (height + 0.15), width, height)
                for j in range(columns)
            ]
            for i in range(rows)
        ]

    def __enter__(self) -> Grid:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        try:
            if kind is None:
                self.sheet.save(self.path)
        finally:
            self._rc.__exit__(None, None, None)

    def legend(self, handles: Sequence[Any], columns: int) -> None:
        """The legend above the panels."""
        self.sheet.legend(handles, self.left, self.legend_top, columns, columnspacing=1.6, labelspacing=0.5)


def line_handle(name: str, **options: Any) -> Any:
    """A legend entry of a controller, with its marker."""
    look = LOOKS[name]
    return handle(name, look.colour, look.marker, **options)


def handle(label: str, colour: str, marker: str = "", **options: Any) -> Any:
    """A legend entry."""
    return Line2D(
        [], [], **{"color": colour, "marker": marker, "markersize": 5.0, "linewidth": 1.4, "label": label, **options}
    )


def plot(ax: Any, points: Iterable[Mapping[str, Any]], x: str, y: str, look: Look, **options: Any) -> None:
    """Points joined by a line in their order; what is no number is left out."""
    pairs = [(p[x], p[y]) for p in points if math.isfinite(p[x]) and math.isfinite(p[y])]
    if pairs:
        settings = {
            "color": look.colour,
            "marker": look.marker,
            "markersize": 5.0,
            "markeredgecolor": darker(look.colour),
            "markeredgewidth": 0.6,
            "linewidth": 1.4,
            **options,
        }
        ax.plot(*zip(*pairs, strict=True), **settings)


def failed_marks(ax: Any, values: Sequence[float], colour: str, height: float = 0.97) -> None:
    """Crosses near the upper edge, at the x values of runs that failed."""
    if len(values):
        ax.plot(
            values,
            [height] * len(values),
            transform=ax.get_xaxis_transform(),
            linestyle="none",
            marker="x",
            color=colour,
            markersize=6.0,
            markeredgewidth=1.4,
            clip_on=False,
            zorder=5,
        )


def logarithmic(axis: Any, ticks: Sequence[float] | None = None, linear_below: float | None = None) -> None:
    """Make an axis (``ax.xaxis`` or ``ax.yaxis``) logarithmic with plain numbers, once everything is drawn.

    Parameters
    ----------
    axis
        Of matplotlib.
    ticks
        Where; at the decades if None.
    linear_below
        Linear between this value and zero, for data that may be zero.
    """
    if linear_below is None and not math.isfinite(axis.get_minpos()):
        return  # nothing that a logarithmic axis could show
    setter = axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale
    if linear_below is None:
        setter("log")
    else:
        setter("symlog", linthresh=linear_below, linscale=0.6)
    axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value)))
    axis.set_minor_formatter(NullFormatter())
    if ticks is not None:
        axis.set_ticks(list(ticks), [plain(tick) for tick in ticks])
        axis.set_ticks([], minor=True)


def plain(value: float) -> str:
    """A tick's number: plain digits, or a power of ten where they would be long."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e4:
        return f"{value:g}"
    mantissa, exponent = f"{value:.0e}".split("e")
    factor = "" if mantissa == "1" else f"{mantissa}·"
    return f"{factor}10{str(int(exponent)).translate(_SUPERSCRIPTS)}"


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
