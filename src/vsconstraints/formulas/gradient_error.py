"""Gradients that are off: eq. (49)."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula


@formula
def gradient_error(gradient: Any, share: Any) -> Any:
    """∇σ_e − ∇σ = c_e s ∘ |∇σ|, with ``share`` = c_e s; of L_gφ = K ∇σ likewise."""
    return share * np.abs(gradient)
