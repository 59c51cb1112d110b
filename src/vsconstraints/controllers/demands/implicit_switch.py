"""The paper's switch, solved for the end of the sampling period."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .base import Demand


@formula
def implicit_switch(row: Row, periods: float) -> Any:
    """max(−u⁺, −φ/(p T_s))."""
    return np.maximum(-row.switching_gain, -row.phi / (periods * row.period))


@dataclass(frozen=True)
class ImplicitSwitch(Demand):
    """Rows demand that φ is no more than zero p periods from now, and never more than −u⁺: max(−u⁺, −φ/(p T_s)).

    The paper's switch by the implicit Euler method (Acary and Brogliato 2010): with p = 1 it is the v in [−u⁺, v_track]
    that is complementary to φ + T_s v ≤ 0. Good at: the switch's promise, without second derivatives, and without its
    chattering. Bad at: φ comes to rest at p T_s L_fφ, beyond zero where the unknown drift L_fφ leads there. p > 1
    averages noise, and suits commands that are followed late.

    Parameters
    ----------
    periods
        p, in sampling periods; at least 1: below, φ is thrown beyond its goal and comes back.
    """

    periods: float = 1.0

    name = "implicit-switch"
    formula = staticmethod(implicit_switch)
    uses: ClassVar[tuple[str, ...]] = ("period",)
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"periods": (1.0, 50.0)}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.periods < 1.0:
            raise self.refusal("periods", "at least 1")
