"""Laws that plan, as additions to the core."""

from ..plugins.registry import Part

PART = Part(
    laws={
        "predictive": "vsconstraints.prediction.predictive:PredictiveControl",
        "robust-predictive": "vsconstraints.prediction.robust_predictive:RobustPredictive",
    }
)
