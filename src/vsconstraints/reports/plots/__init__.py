"""The figure kit: sheets with panels, legends, colours and scales, and how a figure is declared and written.

Matplotlib is loaded when a sheet is made, not before: tables of figures cost nothing to look at.
"""

from .marks import (
    REFERENCE,
    above_legend,
    area,
    band,
    decades,
    extremes,
    inside_legend,
    line,
    logarithmic,
    note,
    patch,
    plain,
    signal,
    symbol,
    time_axis,
    widths,
    window_means,
    zero_line,
)
from .sheet import FORMATS, PNG, WIDTH, Figure, Formats, Sheet, formats_of
from .style import FAINT, INK, Look, darker, looks, shortened

__all__ = [
    "FAINT",
    "FORMATS",
    "INK",
    "PNG",
    "REFERENCE",
    "WIDTH",
    "Figure",
    "Formats",
    "Look",
    "Sheet",
    "above_legend",
    "area",
    "band",
    "darker",
    "decades",
    "extremes",
    "formats_of",
    "inside_legend",
    "line",
    "logarithmic",
    "looks",
    "note",
    "patch",
    "plain",
    "shortened",
    "signal",
    "symbol",
    "time_axis",
    "widths",
    "window_means",
    "zero_line",
]
