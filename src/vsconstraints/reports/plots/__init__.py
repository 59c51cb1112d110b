"""Drawing kit: sheets with panels, legends, colours and scales, and declared figures.

Matplotlib is imported when a sheet is made, not before: reading the lists of figures is cheap.
"""

from ..formats import FORMATS as FORMATS
from ..formats import PNG as PNG
from ..formats import Formats as Formats
from ..formats import formats_of as formats_of
from .sheet import WIDTH as WIDTH
from .sheet import Figure as Figure
from .sheet import Sheet as Sheet
from .style import FAINT as FAINT
from .style import INK as INK
from .style import REFERENCE as REFERENCE
from .style import Look as Look
from .style import Style as Style
from .style import above_legend as above_legend
from .style import band as band
from .style import darker as darker
from .style import decades as decades
from .style import folded as folded
from .style import inside_legend as inside_legend
from .style import line as line
from .style import logarithmic as logarithmic
from .style import looks as looks
from .style import mark_of as mark_of
from .style import markers as markers
from .style import note as note
from .style import shortened as shortened
from .style import signal as signal
from .style import symbol as symbol
from .style import time_axis as time_axis
from .style import widths as widths
from .style import zero_line as zero_line
