"""Innovation: difference between a measurement and the prediction of the model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import formula, where

#: Time constant with which speeds are compared with positions [s]. It is short, so that late
#: samples and filtered speeds leave only a small difference.
MEMORY = 0.2


@formula
def image_innovation(pixels, correction, Fu: float, Fv: float) -> tuple[float, float]:
    """Greatest distance of a marker from its predicted pixel [px], and relative change of shape.

    The latter is ‖(s − s̄) − (p − p̄)‖ / ‖p − p̄‖ for markers seen at s (``pixels``) and predicted
    at p, with ``correction`` (s − p) / F, each (M, 2). A small pose error of the target or camera
    hardly changes the shape of the pattern. A mirrored image or a wrong order of markers changes it
    by 1 or more. 0 if all markers are predicted at one point.
    """
    M = len(pixels)
    greatest = 0.0
    # means, and sums of squares, of the errors (du, dv) and of the predicted pixels (u, v)
    mean_du = mean_dv = mean_u = mean_v = 0.0
    error = size = 0.0
    for i in range(M):
        du = Fu * correction[i, 0]
        dv = Fv * correction[i, 1]
        u = pixels[i, 0] - du
        v = pixels[i, 1] - dv
        squared_distance = du * du + dv * dv
        greatest = max(greatest, squared_distance)
        mean_du += du / M
        mean_dv += dv / M
        mean_u += u / M
        mean_v += v / M
        error = error + du * du + dv * dv
        size = size + u * u + v * v
    # Σ ‖x − x̄‖² = Σ ‖x‖² − M ‖x̄‖²
    error = error - M * (mean_du * mean_du + mean_dv * mean_dv)
    size = size - M * (mean_u * mean_u + mean_v * mean_v)
    relative_error = 0.0
    if size > 1.0:
        relative_error = math.sqrt(max(error, 0.0) / size)
    return math.sqrt(greatest), relative_error


@formula
def depth_innovation(ratio) -> float:
    """Greatest relative difference of a marker's depth from the model's: max(r, 1/r) − 1.

    ``ratio`` (M,) is r = Z / Z_model, NaN for markers without a measured depth. Twice and half of
    the model's depth both give 1; millimetres in place of metres give 999.
    """
    greatest = 0.0
    for i in range(len(ratio)):
        if ratio[i] > 0.0:
            farther = ratio[i] - 1.0
            nearer = 1.0 / ratio[i] - 1.0
            greatest = max(greatest, farther, nearer)
    return greatest


@formula
def slip(before, moved, mean_speed, dt) -> Any:
    """Difference between measured motion and integrated speeds [rad or m].

    The difference decays with the time constant :data:`MEMORY`; divided by it, it is the error of a
    speed. ``before`` is the difference one sample ago, NaN if there was none. ``moved`` is q −
    q_last. 0 at the first sample, and where time does not advance.
    """
    fresh = np.isnan(before) | (dt <= 0.0)
    difference = before + moved - dt * mean_speed
    divisor = 1.0 + np.abs(dt) / MEMORY
    return where(fresh, 0.0, difference / divisor)


@formula
def observed_drift(drift, change, rate, most, period, time_constant) -> Any:
    """d̂ ← d̂ + T_s/(T_s + τ) (d − d̂) [1/s], with d = Δσ/T_s − σ̇ clipped to ±``most``.

    The drift d is the rate of σ that the model does not predict. ``change`` is Δσ since the
    previous sample, NaN if there was none. ``rate`` is the mean σ̇ of both samples. The first-order
    low-pass filter with the ``time_constant`` τ [s] finds a constant drift without an offset.
    """
    seen = np.minimum(np.maximum(change / period - rate, -most), most)
    gain = period / (period + time_constant)
    filtered = drift + gain * (seen - drift)
    return where(np.isnan(change), drift, filtered)
