"""Control barrier functions that decay otherwise than exponentially."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .barrier import Barrier


@formula
def reciprocal_barrier(row: Row, alpha: float) -> Any:
    """−α φ³/s² − L_fφ, and −αφ − L_fφ where φ > 0."""
    depth = row.phi / row.scale
    return -alpha * row.phi * np.where(depth < 0.0, depth * depth, 1.0) - row.Lf


@formula
def finite_time_barrier(row: Row, alpha: float) -> Any:
    """−α sign(φ) √(s |φ|) − L_fφ."""
    return -alpha * np.sign(row.phi) * np.sqrt(row.scale) * np.sqrt(np.abs(row.phi)) - row.Lf


@dataclass(frozen=True)
class ReciprocalBarrier(Barrier):
    """Every row demands −α φ³/s² − L_fφ where φ < 0, with s its scale: the reciprocal barrier function −1/φ.

    d/dt(−1/φ) ≤ −α φ/s² (Ames, Xu, Grizzle and Tabuada 2017) is this bound. The function ends at the boundary; beyond,
    rows restart with the linear −αφ − L_fφ. Good at: rows far inside, which it leaves alone. Bad at: using the space,
    since φ approaches its bound like 1/√t only.

    Parameters
    ----------
    alpha
        Rate α [1/s].
    """

    name = "reciprocal-barrier"
    formula = staticmethod(reciprocal_barrier)


@dataclass(frozen=True)
class FiniteTimeBarrier(Barrier):
    """Every row demands −α sign(φ) √(s |φ|) − L_fφ, with s its scale, which takes φ to its bound in finite time.

    The class K function of Li, Wang, Pierpaoli and Egerstedt (2018) with the exponent ½. Good at: a fast return from
    outside. Bad at: sampling, since its slope is infinite at the boundary: within |φ| < (α T_s)² s it overshoots in
    every period, and chatters.

    Parameters
    ----------
    alpha
        Rate α [1/s].
    """

    alpha: float = 2.0

    name = "finite-time-barrier"
    formula = staticmethod(finite_time_barrier)
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (0.1, 20.0)}
