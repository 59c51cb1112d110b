"""The figure kit: sheets with panels, legends, colours and scales, and how a figure is declared and written.

Matplotlib is loaded when a sheet is made, not before: tables of figures cost nothing to look at.
"""

from .marks import REFERENCE as REFERENCE
from .marks import above_legend as above_legend
from .marks import band as band
from .marks import decades as decades
from .marks import inside_legend as inside_legend
from .marks import line as line
from .marks import logarithmic as logarithmic
from .marks import note as note
from .marks import signal as signal
from .marks import symbol as symbol
from .marks import time_axis as time_axis
from .marks import widths as widths
from .marks import zero_line as zero_line
from .sheet import FORMATS as FORMATS
from .sheet import PNG as PNG
from .sheet import WIDTH as WIDTH
from .sheet import Figure as Figure
from .sheet import Formats as Formats
from .sheet import Sheet as Sheet
from .sheet import formats_of as formats_of
from .style import FAINT as FAINT
from .style import INK as INK
from .style import Look as Look
from .style import darker as darker
from .style import looks as looks
from .style import shortened as shortened
