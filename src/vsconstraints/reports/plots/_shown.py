"""A figure that notebooks show, whatever they know of matplotlib."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from matplotlib.figure import Figure

SHOWN_DPI = 100
"""Pixels per inch that a notebook gives to it; it has more, so that it is sharp."""


class ShownFigure(Figure):
    """A figure as any other; no window or ``%matplotlib`` is needed to see it in a notebook."""

    def _repr_png_(self) -> tuple[bytes, dict[str, Any]]:
        """The picture, and how large it is shown."""
        file = BytesIO()
        self.savefig(file, format="png")
        width, height = (float(side) for side in self.get_size_inches())
        return file.getvalue(), {"width": round(SHOWN_DPI * width), "height": round(SHOWN_DPI * height)}
