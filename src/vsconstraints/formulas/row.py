"""Inputs of the formula of a demand: numbers of one row, or arrays of all rows.

Also gradients with an error.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from . import formula, where


class Row(NamedTuple):
    """Numbers of one row (compiled), or arrays (m,) of all rows (NumPy).

    Entries that are unknown or unused are NaN.

    Attributes
    ----------
    phi, Lf, sigma, sigma_dot, K, switching_gain, scale
        As in :class:`vsconstraints.rows.Rows`.
    tracked, effort
        L_gφ q̈ and ‖q̈‖ of the command that tracks without rows.
    norm, norm_1
        ‖L_gφ‖, and the sum ‖L_gφ‖₁ of the magnitudes of its entries.
    last_rate
        L_gφ q̈ as this law commanded it at the last sample.
    period
        T_s [s].
    memory
        Floats that the demand returned at the last sample: ``memory[0]``, ``memory[1]`` and so on.
    """

    phi: Any
    Lf: Any
    sigma: Any
    sigma_dot: Any
    K: Any
    switching_gain: Any
    scale: Any
    tracked: Any
    norm: Any
    norm_1: Any
    effort: Any
    last_rate: Any
    period: float
    memory: Any


#: Purposes of a formula: bounds c of L_gφ q̈; bounds that all active rows meet with equality; c
#: less L_gφ q̈ of tracking.
BOUND, EQUAL, PUSH = range(3)


@formula
def one_period_ahead(phi, K, tracked, period: float) -> Any:
    """φ + T_s L_gφ q̈ of tracking where φ itself has relative degree one (K = 0); φ elsewhere.

    K = 0 holds for rows of speeds, for instance.
    """
    return where(K == 0.0, phi + period * tracked, phi)


@formula
def asked_for(value, tracked, purpose: int, relative: int, everywhere: int) -> Any:
    """Convert the value of a demand's formula to ``BOUND``, ``EQUAL`` or ``PUSH``.

    The result is inf where the demand is inactive: for ``PUSH``, and for ``EQUAL`` unless
    ``everywhere``. ``relative`` and ``everywhere`` are the demand's attributes, as 0 or 1.
    """
    if purpose == PUSH:
        below = value if relative == 1 else value - tracked
        return where(below > 0.0, np.inf, below)
    bound = value + tracked if relative == 1 else value
    if purpose == EQUAL and everywhere == 0:
        return where(bound > tracked, np.inf, bound)
    return bound


@formula
def share_within(c, tracked) -> Any:
    """Largest κ in [0, 1] for which κ L_gφ q̈ of tracking does not exceed max(c, 0).

    It is 1 where tracking moves a row inwards.
    """
    room = np.maximum(c, 0.0)
    return where(tracked > room, room / tracked, 1.0)


@formula
def gradient_error(gradient, error_share) -> Any:
    """∇σ_e − ∇σ = c_e s ∘ |∇σ|, with ``error_share`` = c_e s; the same for L_gφ = K ∇σ."""
    return error_share * np.abs(gradient)
