"""The implicit switch that takes into account the drift it saw a sample ago."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .implicit_switch import ImplicitSwitch


@formula
def implicit_switch_with_drift(row: Row, periods: float) -> Any:
    """max(−u⁺, −φ/(p T_s) − d̂), d̂ = (φ − φ₋)/T_s − v₋ within ±u⁺, 0 at first; φ."""
    seen = (row.phi - row.memory[0]) / row.period - row.last_rate
    drift = np.where(np.isnan(seen), 0.0, np.minimum(np.maximum(seen, -row.switching_gain), row.switching_gain))
    return np.maximum(-row.switching_gain, -row.phi / (periods * row.period) - drift), row.phi


@dataclass(frozen=True)
class ImplicitSwitchWithDrift(ImplicitSwitch):
    """Rows demand what :class:`ImplicitSwitch` does, less the drift d̂ = (φ − φ₋)/T_s − v₋ of the period before.

    v₋ is the L_gφ q̈ that this law commanded then; d̂ is kept within ±u⁺, and 0 at first. A drift that is seen and
    compensated a sample later, as Su, Drakunov and Özgüner (2000) do, leaves φ = O(T_s²) at rest where the implicit
    switch leaves O(T_s). Good at: unknown drifts, at a fraction of the switch's effort. Bad at: commands that are not
    followed at once, by lag, delay or saturation, which it takes for drift, and noise of φ, which it divides by T_s.

    Parameters
    ----------
    periods
        p, in sampling periods; at least 1.
    """

    name = "implicit-switch-with-drift"
    formula = staticmethod(implicit_switch_with_drift)
    uses: ClassVar[tuple[str, ...]] = ("period", "last_rate")
    remembers: ClassVar[tuple[float, ...]] = (np.nan,)
