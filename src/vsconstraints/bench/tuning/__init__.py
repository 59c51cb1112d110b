"""Tuning of the options of every law on training scenes.

All laws are tuned by the same tuner with the same number of evaluations.
"""

from .problem import Budget, Problem
from .tune import Tuned, Tuning, tune

__all__ = ["Budget", "Problem", "Tuned", "Tuning", "tune"]
