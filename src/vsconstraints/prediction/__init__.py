"""Laws that plan: the predictive safety filter, and its form for what its model does not know."""

from .predictive import PredictiveControl
from .robust_predictive import RobustPredictive

__all__ = ["PredictiveControl", "RobustPredictive"]
