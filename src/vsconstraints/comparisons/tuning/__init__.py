"""Tuning: every law's options, sought on training scenes by the same tuner with the same number of
evaluations.
"""

from .problem import Budget, Problem
from .tune import Tuned, Tuning, tune

__all__ = ["Budget", "Problem", "Tuned", "Tuning", "tune"]
