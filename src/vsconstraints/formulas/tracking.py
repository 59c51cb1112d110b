"""The tracking law, eq. (42)."""

from __future__ import annotations

import math
from typing import Any

from . import formula


@formula
def gains(squared_error: float, Kp0: float, slope: float, damping: float) -> tuple[float, float]:
    """K_p(‖e‖) = K_p(0) exp(−slope/K_p(0) ‖e‖) and K_v = damping √K_p."""
    Kp = Kp0 * math.exp(-slope / Kp0 * math.sqrt(squared_error))
    return Kp, damping * math.sqrt(Kp)


@formula
def demanded(error: Any, rate: Any, drift: Any, Kp: float, Kv: float) -> Any:
    """B = −K_p e − K_v ė − J̇_s q̇ − ∂ṡ/∂t, of one feature."""
    return -Kp * error - Kv * rate - drift


@formula
def goal_at(begins: Any, t: float) -> int:
    """Index of the goal that holds at time t [s], of goals that begin at these times (g,), met up to rounding."""
    goal = 0
    for i in range(len(begins)):
        if begins[i] <= t + 1e-9:
            goal = i
    return goal
