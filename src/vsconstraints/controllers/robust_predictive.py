"""The predictive safety filter for targets, obstacles and disturbances that its model does not know."""

from __future__ import annotations

from inspect import Parameter, Signature, signature
from typing import Any

from .observer import Observed
from .predictive import PredictiveControl

DEFAULTS = {"margin": 0.03, "observer": 0.1, "dead_time": 0.0}


class RobustPredictive(Observed):
    """:class:`.PredictiveControl` with a margin, on rows whose drift is observed and taken to last for the whole plan.

    The plan meets σ(τ) + d̂ τ ≤ …, with the drift d̂ of :class:`.Observed`: what moves unknown to the model is foreseen
    as if its speed stayed as it is. Options are those of both.
    """

    name = "robust-predictive"
    __signature__ = Signature(
        [
            each.replace(default=DEFAULTS.get(each.name, each.default))
            for each in signature(PredictiveControl).parameters.values()
        ]
        + [Parameter(name, Parameter.KEYWORD_ONLY, default=DEFAULTS[name]) for name in ("observer", "dead_time")]
    )

    def __init__(self, **options: Any) -> None:
        options = {**DEFAULTS, **options}
        observer = {name: options.pop(name) for name in ("observer", "dead_time")}
        super().__init__(PredictiveControl(**options), **observer)
