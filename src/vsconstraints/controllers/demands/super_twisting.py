"""The super-twisting algorithm, by the explicit and by the implicit Euler method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .base import Demand


@formula
def gains(row: Row, rate: float) -> Any:
    """k₁ = 1.5 √L and k₂ = 1.1 L with L = rate × u⁺ (Levant 1998)."""
    L = rate * row.switching_gain
    return 1.5 * np.sqrt(L), 1.1 * L


@formula
def held(row: Row, c: Any, integral: Any) -> Any:
    """The bound c, at least −u⁺, and the integral within ±u⁺ where tracking exceeds c, else 0."""
    bound = np.maximum(-row.switching_gain, c)
    kept = np.minimum(np.maximum(integral, -row.switching_gain), row.switching_gain)
    return bound, np.where(row.tracked > bound, kept, 0.0)


@formula
def super_twisting(row: Row, rate: float) -> Any:
    """max(−u⁺, w − k₁ √|φ| sign φ); w − T_s k₂ sign φ."""
    k1, k2 = gains(row, rate)
    w = row.memory[0]
    side = np.sign(row.phi)
    return held(row, w - k1 * np.sqrt(np.abs(row.phi)) * side, w - row.period * k2 * side)


@formula
def implicit_super_twisting(row: Row, rate: float) -> Any:
    """max(−u⁺, (x − φ)/T_s), x + T_s k₁ √|x| sign x + T_s² k₂ sign x ∋ φ + T_s w; w less T_s k₂ sign x.

    Of the inclusion x is 0 where |φ + T_s w| ≤ T_s² k₂, and sign x then the number in between that solves it; else the
    square of y = √|x|, which solves y² + T_s k₁ y = |φ + T_s w| − T_s² k₂.
    """
    k1, k2 = gains(row, rate)
    w = row.memory[0]
    z, step, half = row.phi + row.period * w, row.period * row.period * k2, 0.5 * row.period * k1
    over = np.maximum(np.abs(z) - step, 0.0)
    # y without the difference of two numbers that are nearly equal
    y = over / (half + np.sqrt(half * half + over))
    c = (np.sign(z) * y * y - row.phi) / row.period
    return held(row, c, w - np.minimum(np.maximum(z, -step), step) / row.period)


@dataclass(frozen=True)
class SuperTwisting(Demand):
    """Rows demand φ̇ = −k₁ √|φ| sign φ + w with ẇ = −k₂ sign φ, and never more than −u⁺.

    The super-twisting algorithm (Levant 1993), a sliding mode of second order: w, which is integrated where tracking
    would exceed c and else 0, learns the drift. Good at: drifts that change by less than L a second, which it holds in
    a band of O(T_s²) without L_fφ. Bad at: large L, which chatter in this explicit form, small ones, which overshoot,
    and contacts, at which w has to be learnt anew.

    Parameters
    ----------
    rate
        L as a multiple of u⁺ [1/s]; k₁ = 1.5 √L, k₂ = 1.1 L.
    """

    rate: float = 20.0

    name = "super-twisting"
    formula = staticmethod(super_twisting)
    uses: ClassVar[tuple[str, ...]] = ("tracked", "period")
    remembers: ClassVar[tuple[float, ...]] = (0.0,)
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"rate": (1.0, 100.0)}


@dataclass(frozen=True)
class ImplicitSuperTwisting(SuperTwisting):
    """Rows demand what :class:`SuperTwisting` does, solved for the end of the period.

    The implicit Euler method (Brogliato, Polyakov and Efimov 2020). Good at: far less switching, and a rate that is too
    large costs nothing. Bad at: contacts, as the explicit one; accuracy, since what it takes to zero is φ + T_s v, in
    which the drift of the period is not: at rest it is :class:`ImplicitSwitch`, and φ is T_s L_fφ; and rows far inside,
    which resolvers with inequalities keep to v ≤ k₁ √|φ| as well, though a steep φ could come faster.

    Parameters
    ----------
    rate
        L as a multiple of u⁺ [1/s]; k₁ = 1.5 √L, k₂ = 1.1 L.
    """

    name = "implicit-super-twisting"
    formula = staticmethod(implicit_super_twisting)
