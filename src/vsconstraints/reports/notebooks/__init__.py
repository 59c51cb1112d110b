"""For notebooks and consoles: runs that show themselves, and laws compared as they are, in one line
each.

``from vsconstraints import compare, run`` gives the two functions.
"""

from .comparison import Comparison, compare
from .notebook_run import NotebookRun, Plots, run

__all__ = ["Comparison", "NotebookRun", "Plots", "compare", "run"]
