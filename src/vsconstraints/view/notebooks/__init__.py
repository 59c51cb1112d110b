"""Functions for notebooks and consoles: run a law or compare laws in one line each.

``from vsconstraints import compare, run`` gives the two functions.
"""

from .comparison import Comparison, compare
from .notebook_run import NotebookRun, Plots, run

__all__ = ["Comparison", "NotebookRun", "Plots", "compare", "run"]
