"""For notebooks and consoles: runs that show themselves, and laws compared as they are, in one line each.

``from vsconstraints import compare, run`` gives the two functions.
"""

from .comparing import compare
from .comparison import Comparison
from .notebook_run import NotebookRun, run
from .plots import Plots

__all__ = ["Comparison", "NotebookRun", "Plots", "compare", "run"]
