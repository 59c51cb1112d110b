"""Tuning of the options of every law on training scenes.

All laws are tuned by the same tuner with the same number of evaluations.
"""

from .journal import JournalFile
from .problem import Budget, Problem
from .tune import Tuned, Tuning, claim, tune

__all__ = ["Budget", "JournalFile", "Problem", "Tuned", "Tuning", "claim", "tune"]
