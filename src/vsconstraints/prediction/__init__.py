"""Laws that plan: the predictive safety filter, and its form for what its model does not know."""

from typing import TYPE_CHECKING

from ..plugins.lazy import exported

if TYPE_CHECKING:
    from .predictive import PredictiveControl
    from .robust_predictive import RobustPredictive

__all__ = ["PredictiveControl", "RobustPredictive"]
__getattr__, __dir__ = exported(
    __name__,
    {"PredictiveControl": "predictive", "RobustPredictive": "robust_predictive"},
)
