"""Tracking law, eq. (42), and funnel in which prescribed performance keeps its error."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import formula


@formula
def gains(squared_error: float, Kp0: float, slope: float, damping: float) -> tuple[float, float]:
    """K_p(‖e‖) = K_p(0) exp(−slope/K_p(0) ‖e‖) and K_v = damping √K_p."""
    error = math.sqrt(squared_error)
    exponent = -slope / Kp0 * error
    Kp = Kp0 * math.exp(exponent)
    Kv = damping * math.sqrt(Kp)
    return Kp, Kv


@formula
def demanded(error, rate, drift, Kp: float, Kv: float) -> Any:
    """B = −K_p e − K_v ė − J̇_s q̇ − ∂ṡ/∂t, of one feature."""
    return -Kp * error - Kv * rate - drift


@formula
def resting(q, qd, posture, damping: float, stiffness: float) -> Any:
    """q̈₀ = −d q̇ + w (q_posture − q) of one joint: rest acceleration.

    It applies where task and rows leave the joint free.
    """
    to_posture = posture - q
    return stiffness * to_posture - damping * qd


@formula
def minimum_jerk(elapsed: float, duration: float) -> tuple[float, float, float]:
    """1 − 10τ³ + 15τ⁴ − 6τ⁵ and two derivatives, at rest at both ends.

    τ is the elapsed share of the duration.
    """
    share = elapsed / duration
    tau = min(max(share, 0.0), 1.0)
    remaining = 1.0 - tau
    factor = 10.0 - 15.0 * tau + 6.0 * tau**2
    left = 1.0 - tau**3 * factor
    slope = -30.0 * tau**2 * remaining**2
    to_middle = 1.0 - 2.0 * tau
    bend = -60.0 * tau * remaining * to_middle
    rate = slope / duration
    acceleration = bend / duration**2
    return left, rate, acceleration


ROUNDING = 1e-9  #: Tolerance on the time of a goal [s].
#: In predictions, the current goal ends this long before the next one [s].
JUST_BEFORE = 1e-6


@formula
def goal_at(begins, t: float) -> int:
    """Index of the goal that holds at time t [s], for goals that begin at these times (g,).

    Times are compared with the tolerance ``ROUNDING``.
    """
    goal = 0
    for i in range(len(begins)):
        if begins[i] <= t + ROUNDING:
            goal = i
    return goal


def goals_at(begins, t) -> Any:
    """Indices (N,) of the goals that hold at many times (N,); see :func:`goal_at`."""
    tolerant = np.asarray(t) + ROUNDING
    begun = np.searchsorted(begins, tolerant, side="right")
    return np.maximum(begun - 1, 0)


@formula
def funnel(elapsed, final: float, decay: float) -> tuple[Any, Any, Any]:
    """ρ/ρ₀ = (1 − f) exp(−l t) + f and two derivatives, with f = ρ∞/ρ₀ and l [1/s].

    Before t = 0 the funnel is open and constant.
    """
    narrowing = (1.0 - final) * np.exp(-decay * np.maximum(elapsed, 0.0))
    rate = decay * (elapsed >= -1e-9)
    rho = narrowing + final
    rho_dot = -rate * narrowing
    rho_ddot = rate * rate * narrowing
    return rho, rho_dot, rho_ddot
