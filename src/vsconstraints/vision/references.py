"""Reference trajectories s_ref(t) of eq. (5): where the feature should be on its way to a goal."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInput
from ..rows import Array


class Reference(ABC):
    """How s_ref moves while a goal holds, relative to the feature's value at the goal."""

    @abstractmethod
    def at(self, elapsed: float, start: Array) -> tuple[Array, Array, Array]:
        """s_ref less the feature's value at the goal, ṡ_ref and s̈_ref, each (k,).

        Parameters
        ----------
        elapsed
            Time since the goal's first sample [s].
        start
            (k,) the feature less its value at the goal, in that sample.
        """


@dataclass(frozen=True)
class MinimumJerk(Reference):
    """From where the feature is to the goal on a straight line, at rest at both ends: start · (1 − 10τ³ + 15τ⁴ − 6τ⁵).

    Attributes
    ----------
    duration
        Time from start to goal [s]; τ is the share of it that has passed.
    """

    duration: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.duration) and self.duration > 0.0):
            raise InvalidInput(f"the duration of a reference trajectory must be positive, not {self.duration}")

    def at(self, elapsed: float, start: Array) -> tuple[Array, Array, Array]:
        """See :meth:`Reference.at`."""
        tau = min(max(elapsed / self.duration, 0.0), 1.0)
        left = 1.0 - tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
        rate = -30.0 * tau**2 * (1.0 - tau) ** 2 / self.duration
        acceleration = -60.0 * tau * (1.0 - tau) * (1.0 - 2.0 * tau) / self.duration**2
        return left * start, rate * start, acceleration * start
