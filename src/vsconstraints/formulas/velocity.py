"""Gain of laws that command joint speeds, and bounds of velocity dampers."""

from __future__ import annotations

import math
from typing import Any

from . import formula, where

UNBOUNDED = 1e200  #: Bound h of a row that demands nothing; rows of a program must be finite.


@formula
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


@formula
def rate_factor(K) -> Any:
    """Return the factor of σ̇ in φ = σ + K σ̇; 1 for a row on speeds, which has K = 0."""
    return where(K > 0.0, K, 1.0)


@formula
def damped_bound(h, sigma, K, scale, speed: float, influence: float, security: float) -> Any:
    """Return the bound of ∇σᵀ q̇ with which a row on σ is a velocity damper.

    ``h`` is −σ − K ∂σ/∂t, the bound of K ∇σᵀ q̇. With d = −σ in scales of the row, the damper
    demands ∇σᵀ q̇ + ∂σ/∂t ≤ ξ (d − d_s)/(d_i − d_s) scales per second, and nothing beyond d_i. It
    does not depend on K. Bounds of speeds, K = 0, stay as they are. Faverjon and Tournassoud, "A
    local based approach for path planning of manipulators with a high number of degrees of
    freedom", ICRA 1987.
    """
    distance = -sigma / scale
    share_left = (distance - security) / (influence - security)
    fastest_approach = speed * scale * share_left
    drift = -(h + sigma) / rate_factor(K)
    damped = fastest_approach - drift
    return where(K > 0.0, where(distance <= influence, damped, UNBOUNDED), h)
