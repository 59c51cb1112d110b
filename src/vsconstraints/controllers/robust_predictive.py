"""The predictive safety filter for targets, obstacles and disturbances that its model does not
know.
"""

from __future__ import annotations

from inspect import Parameter, Signature, signature
from typing import Any

from .observer import Observed
from .predictive import PredictiveControl

DEFAULTS = {"margin": 0.03, "observer": 0.1, "dead_time": 0.0}


class RobustPredictive(Observed):
    """:class:`.PredictiveControl` with a margin, on rows whose drift is observed, which fades along
    the plan.

    What moves a row beside the model, d̂ of :class:`.Observed`, changes what is predicted of it by
    d̂ τ_o (1 − e^(−τ/τ_o)), with the time constant τ_o of the observer: the effect of a wrong
    depth, for instance, stops with the camera, so that what is observed cannot be taken to last for
    the whole plan. Options are those of both.
    """

    name = "robust-predictive"
    __signature__ = Signature(
        [
            each.replace(default=DEFAULTS.get(each.name, each.default))
            for each in signature(PredictiveControl).parameters.values()
        ]
        + [
            Parameter(name, Parameter.KEYWORD_ONLY, default=DEFAULTS[name])
            for name in ("observer", "dead_time")
        ]
    )

    def __init__(self, **options: Any) -> None:
        options = {**DEFAULTS, **options}
        observer = {name: options.pop(name) for name in ("observer", "dead_time")}
        super().__init__(PredictiveControl(**options), **observer)
