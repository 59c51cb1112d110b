"""A figure whose parts are placed in inches, and how it is written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from ...runs.files import replaced
from ..style import Look, shortened

WIDTH = 8.0
"""Width of every figure [in]: at this width the smallest text is 8 pt."""

DPI = 150

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.labelsize": 8.5,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.edgecolor": "#444444",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.6,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.labelcolor": "#222222",
    "ytick.labelcolor": "#222222",
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "hatch.linewidth": 0.35,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.borderpad": 0.0,
    "legend.borderaxespad": 0.0,
    "legend.handlelength": 1.8,
    "path.simplify_threshold": 0.2,
    "text.parse_math": False,  # names may contain anything
}

style = rc_context
"""Use as ``with style(STYLE):`` around everything that draws."""


class Sheet:
    """A figure of the common width; positions are inches from its top left corner."""

    def __init__(self, height: float) -> None:
        self.height = height
        self.figure: Any = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
        self.canvas: Any = FigureCanvasAgg(self.figure)

    def axes(self, left: float, top: float, width: float, height: float, **options: Any) -> Any:
        """Axes whose frame is at this place."""
        bottom = self.height - top - height
        place = (left / WIDTH, bottom / self.height, width / WIDTH, height / self.height)
        return self.figure.add_axes(place, **options)

    def text(self, left: float, top: float, text: str, **options: Any) -> None:
        """Text at a place of the sheet."""
        self.figure.text(left / WIDTH, 1.0 - top / self.height, text, **options)

    def legend(self, handles: Sequence[Any], left: float, top: float, columns: int, **options: Any) -> None:
        """A legend whose upper left corner is at this place."""
        self.figure.legend(
            handles=handles,
            loc="upper left",
            bbox_to_anchor=(left / WIDTH, 1.0 - top / self.height),
            ncols=columns,
            **options,
        )

    def save(self, path: Path) -> None:
        """Write a PNG, whole or not at all."""
        self.canvas.draw()
        pixels = np.asarray(self.canvas.buffer_rgba())[..., :3]
        # 32 shades a channel: nobody sees it, and the file is a quarter smaller
        pixels = np.round(np.round(pixels * (31.0 / 255.0)) * (255.0 / 31.0)).astype(np.uint8)
        with replaced(path) as part:
            Image.fromarray(pixels).save(part, format="PNG", optimize=True, dpi=(DPI, DPI))


def controller_handles(looks: dict[str, Look], names: Sequence[str]) -> list[Any]:
    """Legend entries: one line per controller."""
    return [
        Line2D([], [], color=looks[name].colour, linestyle=looks[name].line, linewidth=2.0, label=shortened(name))
        for name in names
    ]


def rows_of(count: int, columns: int) -> int:
    """How many rows a grid of so many columns needs."""
    return -(-count // columns)


def widths(names: Sequence[str], thickest: float = 2.6, thinnest: float = 1.0) -> dict[str, float]:
    """Line widths for lines that may coincide: those drawn first are wider, so that each remains visible."""
    step = (thickest - thinnest) / max(len(names) - 1, 1)
    return {name: thickest - step * i for i, name in enumerate(names)}
