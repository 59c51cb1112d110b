"""A control barrier function of second order whose approach never has to brake harder than a bound."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .base import Demand


@formula
def high_order_barrier(row: Row, alpha: float, braking: float) -> Any:
    """σ̇ + K (−α₁'(−σ) σ̇ + α ψ₁) − L_fφ, ψ₁ = −σ̇ + α₁(−σ), and −αφ − L_fφ where K = 0.

    α₁(h) = sign(h) (√((aK)² + 2a|h|) − aK), a = braking × scale, written without a difference.
    """
    a = braking * row.scale
    corner = a * row.K
    root = np.sqrt(corner * corner + 2.0 * a * np.abs(row.sigma))
    # where K = 0 the terms with divisors count nothing
    direct = row.K == 0.0
    approach = -2.0 * a * row.sigma / (root + corner + direct)
    psi = approach - row.sigma_dot
    second = -a / (root + direct) * row.sigma_dot + alpha * psi
    return row.sigma_dot + row.K * second - alpha * row.phi * direct - row.Lf


@dataclass(frozen=True)
class HighOrderBarrier(Demand):
    """Rows demand σ̈ ≤ −α₁'(−σ) σ̇ + α ψ₁ with ψ₁ = −σ̇ + α₁(−σ): a high-order barrier function of h = −σ.

    Xiao and Belta (2019). :class:`Barrier` has α₁(h) = h/K. Here α₁(h) = √((aK)² + 2ah) − aK, odd in h, with the slope
    1/K on the boundary: far from it σ may come as fast as σ̈ = −a can still stop it, and α₁ α₁' ≤ a, so that no approach
    has to be braked harder. As a → ∞ it is :class:`Barrier`. As a bound on L_gφ q̈ it is
    σ̇ + K (−α₁'(−σ) σ̇ + α ψ₁) − L_fφ. Rows that are φ itself, such as speeds, have K = 0 and σ = φ: they need no second
    order, and demand −αφ − L_fφ. Good at: accelerations that are limited. Bad at: it needs L_fφ, σ and σ̇, and where
    other rows or tracking hold q̈ as well a is no promise.

    Parameters
    ----------
    alpha
        Rate α of ψ₁ [1/s].
    braking
        a as a multiple of each row's scale [1/s²].
    """

    alpha: float = 20.0
    braking: float = 5.0

    name = "high-order-barrier"
    formula = staticmethod(high_order_barrier)
    uses: ClassVar[tuple[str, ...]] = ("sigma", "sigma_dot", "K", "Lf")
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (1.0, 200.0), "braking": (0.1, 100.0)}
