"""Gain of velocity laws, constant or adaptive, and the task that follows from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from ...errors import ConfigurationError
from ...rows import Array, Task
from ..ranges import Declared, Range, positive_number
from .base import VelocityController


def adaptive_gain(error: float, at_zero: float, at_infinity: float, slope_at_zero: float) -> float:
    """Return λ(x) = (λ₀ − λ_∞) exp(−λ'₀ x / (λ₀ − λ_∞)) + λ_∞ [1/s] at x = ``error``.

    λ falls from λ₀ at x = 0, with the slope −λ'₀, to λ_∞. It is the gain of ViSP's
    ``vpAdaptiveGain`` (Kermorgant and Chaumette, "Dealing with constraints in sensor-based robot
    control", IEEE Transactions on Robotics 30(1), 2014, section V).
    """
    span = at_zero - at_infinity
    if span == 0.0:
        return at_zero
    return span * math.exp(-slope_at_zero / span * error) + at_infinity


class VelocityLaw(VelocityController):
    """Velocity law with the task J q̇ = −λ e − ∂s/∂t.

    Parameters
    ----------
    gain
        λ [1/s]. If ``gain_at_zero`` is given, λ where the error is large.
    gain_at_zero
        λ where the error is zero [1/s], at least ``gain``: ViSP's adaptive gain, see
        :func:`.adaptive_gain`, of the largest |eᵢ|. None: λ is constant.
    slope_at_zero
        By how much the adaptive gain falls with the error where that is zero [1/s per unit of the
        error].
    """

    #: The drift of rows is a matter of accelerations; only with a dead time does it change φ.
    ignores = (*VelocityController.ignores, "observer")
    ranges: ClassVar[Mapping[str, Declared]] = {"gain": Range(0.2, 20.0), "K": Range(0.3, 10.0)}

    def __init__(
        self,
        *,
        gain: float = 2.0,
        gain_at_zero: float | None = None,
        slope_at_zero: float = 30.0,
    ) -> None:
        self.gain = positive_number("gain", gain)
        self.slope_at_zero = positive_number("slope_at_zero", slope_at_zero)
        self.gain_at_zero = None
        if gain_at_zero is not None:
            self.gain_at_zero = positive_number("gain_at_zero", gain_at_zero)
            if self.gain_at_zero < self.gain:
                raise ConfigurationError(
                    f"gain_at_zero must be at least the gain far from the goal, {self.gain:g}, not "
                    f"{self.gain_at_zero:g}: the adaptive gain falls with the error"
                )

    def gain_of(self, error: Array) -> float:
        """Return λ [1/s] at an error (k,)."""
        if self.gain_at_zero is None:
            return self.gain
        largest = float(np.abs(error).max(initial=0.0))
        return adaptive_gain(largest, self.gain_at_zero, self.gain, self.slope_at_zero)

    def task_of(self, task: Task) -> tuple[Array, Array]:
        """Return J (k, n) and v (k,) of the task J q̇ = v, with the law's gain."""
        return task.velocity_form(self.gain_of(task.error))
