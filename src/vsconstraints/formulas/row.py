"""What a demand is a formula of: the numbers of one row, or the arrays of all rows; and gradients with an error."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from . import formula


class Row(NamedTuple):
    """A row's numbers (compiled), or arrays (m,) of all rows (NumPy); see :class:`vsconstraints.rows.Rows`.

    Attributes
    ----------
    phi, Lf, sigma, sigma_dot, K, switching_gain, scale
        As in :class:`vsconstraints.rows.Rows`; NaN where it is not known.
    tracked
        L_gφ q̈ of the command that tracks and heeds no row; NaN if the demand does not use it.
    norm, norm_1
        ‖L_gφ‖, and the sum ‖L_gφ‖₁ of the magnitudes of its entries.
    effort
        ‖q̈‖ of the command that tracks and heeds no row, the same for all rows; NaN if the demand does not use it.
    last_rate
        L_gφ q̈ as this law commanded it at the last sample; NaN at the first one.
    period
        The sampling period T_s [s]; NaN if it is not known.
    memory
        Floats that the demand has given back at the last sample: ``memory[0]``, ``memory[1]`` and so on.
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


BOUND, EQUAL, PUSH = range(3)
"""What of a demand is asked for: the bounds c of L_gφ q̈; those of the rows that act on it, if all that act meet it with
equality; or by how much c is below L_gφ q̈ of tracking, where it is."""


@formula
def asked_for(value: Any, tracked: Any, purpose: int, relative: int, everywhere: int) -> Any:
    """One of the three, ∞ where nothing is asked for, from the value of a demand's formula.

    Parameters
    ----------
    value, tracked
        What the formula gave, and L_gφ q̈ of tracking.
    purpose
        ``BOUND``, ``EQUAL`` or ``PUSH``.
    relative, everywhere
        Of the :class:`vsconstraints.controllers.demands.Demand`, as 0 or 1.
    """
    if purpose == PUSH:
        below = value if relative == 1 else value - tracked
        return np.where(below > 0.0, np.inf, below)
    bound = value + tracked if relative == 1 else value
    return np.where(bound > tracked, np.inf, bound) if purpose == EQUAL and everywhere == 0 else bound


@formula
def share(c: Any, tracked: Any) -> Any:
    """The largest κ in [0, 1] at which κ L_gφ q̈ of tracking exceeds c as little as possible: 0 where c < 0 forbids all.

    A row that tracking moves inwards has nothing to gain from a smaller κ: 1.
    """
    room = np.maximum(c, 0.0)
    return np.where(tracked > room, room / tracked, 1.0)


@formula
def gradient_error(gradient: Any, share: Any) -> Any:
    """∇σ_e − ∇σ = c_e s ∘ |∇σ|, with ``share`` = c_e s; of L_gφ = K ∇σ likewise."""
    return share * np.abs(gradient)
