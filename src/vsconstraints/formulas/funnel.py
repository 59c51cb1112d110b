"""Prescribed performance: a funnel that an error stays in, narrowing with time."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula


@formula
def funnel(elapsed: Any, final: float, decay: float) -> tuple[Any, Any, Any]:
    """ρ/ρ₀ = (1 − f) exp(−l t) + f and its first two derivatives, of ``final`` f = ρ∞/ρ₀ and ``decay`` l [1/s]."""
    narrowing = (1.0 - final) * np.exp(-decay * np.maximum(elapsed, 0.0))
    return narrowing + final, -decay * narrowing, decay * decay * narrowing
