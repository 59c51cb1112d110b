"""Predictive safety filter for targets, obstacles and disturbances unknown to its model."""

from __future__ import annotations

from inspect import Parameter, Signature, signature
from typing import Any

from ..controllers.observer import Observed
from .predictive import PredictiveControl

DEFAULTS = {"margin": 0.03, "observer": 0.1, "dead_time": 0.0}


class RobustPredictive(Observed):
    """:class:`.PredictiveControl` with a margin, on rows whose observed drift fades along the plan.

    The drift d̂ of :class:`.Observed` changes the prediction of a row by d̂ τ_o (1 − e^(−τ/τ_o)),
    with the time constant τ_o of the observer. The drift must fade: the effect of a wrong depth,
    for instance, stops with the camera, so that it cannot be extrapolated over the whole plan. The
    options are those of both classes.
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
