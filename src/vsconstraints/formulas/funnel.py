"""Prescribed performance: a funnel that an error stays in, narrowing with time."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula


@formula
def funnel(elapsed: Any, final: float, decay: float) -> tuple[Any, Any, Any]:
    """ρ/ρ₀ = (1 − f) exp(−l t) + f and its first two derivatives, of ``final`` f = ρ∞/ρ₀ and ``decay`` l [1/s].

    Before it begins, up to the rounding of :func:`vsconstraints.formulas.tracking.goal_at`, it stands open.
    """
    narrowing = (1.0 - final) * np.exp(-decay * np.maximum(elapsed, 0.0))
    rate = decay * (elapsed >= -1e-9)
    return narrowing + final, -rate * narrowing, rate * rate * narrowing
