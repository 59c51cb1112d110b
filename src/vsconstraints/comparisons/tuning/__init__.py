"""Tuning: every law's options, sought on training scenes by the same tuner with the same number of evaluations."""

from .problem import Budget, Problem, Stage
from .result import Tuned, Tuning
from .tune import tune

__all__ = ["Budget", "Problem", "Stage", "Tuned", "Tuning", "tune"]
