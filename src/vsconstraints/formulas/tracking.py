"""The tracking law, eq. (42), and the funnel in which prescribed performance keeps its error."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import formula


@formula
def gains(squared_error: float, Kp0: float, slope: float, damping: float) -> tuple[float, float]:
    """K_p(‖e‖) = K_p(0) exp(−slope/K_p(0) ‖e‖) and K_v = damping √K_p."""
    Kp = Kp0 * math.exp(-slope / Kp0 * math.sqrt(squared_error))
    return Kp, damping * math.sqrt(Kp)


@formula
def demanded(error: Any, rate: Any, drift: Any, Kp: float, Kv: float) -> Any:
    """B = −K_p e − K_v ė − J̇_s q̇ − ∂ṡ/∂t, of one feature."""
    return -Kp * error - Kv * rate - drift


@formula
def resting(q: Any, qd: Any, posture: Any, damping: float, stiffness: float) -> Any:
    """q̈₀ = −d q̇ + w (q_posture − q), of one joint: what it does where task and rows leave it
    free.
    """
    return stiffness * (posture - q) - damping * qd


@formula
def minimum_jerk(elapsed: float, duration: float) -> tuple[float, float, float]:
    """1 − 10τ³ + 15τ⁴ − 6τ⁵ and two derivatives, τ the share of the duration that has elapsed: at
    rest at both ends.
    """
    tau = min(max(elapsed / duration, 0.0), 1.0)
    left = 1.0 - tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
    rate = -30.0 * tau**2 * (1.0 - tau) ** 2 / duration
    return left, rate, -60.0 * tau * (1.0 - tau) * (1.0 - 2.0 * tau) / duration**2


@formula
def retargeted(b: Any, error: Any, rate: Any, reference: Any, now: Any, then: Any) -> Any:
    """B of one feature as it is if s_ref stands still at ``reference``, from what the task makes of
    the goal itself.

    Error and reference are less the feature's value at the goal; ``now`` and ``then`` are K_p and
    K_v of both errors.
    """
    return b + now[0] * error + now[1] * rate - then[0] * (error - reference) - then[1] * rate


@formula
def held_gains(Kp: float, Kv: float, h: float) -> tuple[float, float]:
    """K_p and K_v of q̈ held for h [s] by the implicit midpoint rule: the error does not grow,
    however long h is.
    """
    lag = 1.0 + 0.5 * h * (Kv + 0.5 * h * Kp)
    return Kp / lag, (Kv + 0.5 * h * Kp) / lag


ROUNDING = 1e-9  #: By which the time of a goal may be missed [s].
#: How long before the next goal [s] the current goal ends, for what is predicted.
JUST_BEFORE = 1e-6


@formula
def held_rest(rest: Any, qd: Any, damping: float, stiffness: float, h: float) -> Any:
    """Q̈₀ of :func:`resting`, held for h [s], by the implicit midpoint rule likewise."""
    return (rest - 0.5 * h * stiffness * qd) / (1.0 + 0.5 * h * (damping + 0.5 * h * stiffness))


@formula
def goal_at(begins: Any, t: float) -> int:
    """Index of the goal that holds at time t [s], of goals that begin at these times (g,), met up
    to rounding.
    """
    goal = 0
    for i in range(len(begins)):
        if begins[i] <= t + ROUNDING:
            goal = i
    return goal


def goals_at(begins: Any, t: Any) -> Any:
    """(N,) the same at many times (N,)."""
    return np.maximum(np.searchsorted(begins, np.asarray(t) + ROUNDING, side="right") - 1, 0)


@formula
def funnel(elapsed: Any, final: float, decay: float) -> tuple[Any, Any, Any]:
    """ρ/ρ₀ = (1 − f) exp(−l t) + f and two derivatives, of f = ρ∞/ρ₀ and l [1/s]; open before it
    begins.
    """
    narrowing = (1.0 - final) * np.exp(-decay * np.maximum(elapsed, 0.0))
    rate = decay * (elapsed >= -1e-9)
    return narrowing + final, -rate * narrowing, rate * rate * narrowing
