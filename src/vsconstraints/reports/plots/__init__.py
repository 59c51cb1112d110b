"""The figure kit: sheets with panels, legends, colours and scales, and how a figure is declared and written.

Matplotlib is loaded when a sheet is made, not before: tables of figures cost nothing to look at.
"""

from .decimate import extremes, window_means, zigzag
from .figure import Figure
from .formats import FORMATS, PNG, Formats, formats_of
from .marks import (
    REFERENCE,
    above_legend,
    area,
    band,
    decades,
    inside_legend,
    line,
    logarithmic,
    patch,
    plain,
    signal,
    time_axis,
    zero_line,
)
from .sheet import WIDTH, Sheet
from .style import INK, Look, darker, looks, shortened

__all__ = [
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
    "patch",
    "plain",
    "shortened",
    "signal",
    "time_axis",
    "window_means",
    "zero_line",
    "zigzag",
]
