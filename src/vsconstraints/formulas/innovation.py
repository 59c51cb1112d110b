"""How far a measurement is from what the model predicts: the innovation, in the words of
estimation.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import formula

#: Time constant of the comparison of speeds with positions [s]: late samples and filtered speeds
#: leave little.
MEMORY = 0.2


@formula
def image_innovation(pixels: Any, correction: Any, Fu: float, Fv: float) -> tuple[float, float]:
    """Greatest distance of a marker from where the model has it [px], and by how much the pattern's
    shape differs.

    The latter is ‖(s − s̄) − (p − p̄)‖ / ‖p − p̄‖ for markers seen at s (``pixels``) and predicted
    at p, with ``correction`` (s − p) / F, each (M, 2). A target or camera that is a little
    elsewhere hardly bends the pattern; a mirrored image, or another order of markers, bends it by 1
    and more. 0 where all are predicted at one point.
    """
    M = len(pixels)
    greatest = off = size = off_u = off_v = size_u = size_v = 0.0
    for i in range(M):
        du = Fu * correction[i, 0]
        dv = Fv * correction[i, 1]
        u = pixels[i, 0] - du
        v = pixels[i, 1] - dv
        greatest = max(greatest, du * du + dv * dv)
        off_u = off_u + du / M
        off_v = off_v + dv / M
        off = off + du * du + dv * dv
        size_u = size_u + u / M
        size_v = size_v + v / M
        size = size + u * u + v * v
    off = off - M * (off_u * off_u + off_v * off_v)
    size = size - M * (size_u * size_u + size_v * size_v)
    return math.sqrt(greatest), math.sqrt(max(off, 0.0) / size) if size > 1.0 else 0.0


@formula
def depth_innovation(ratio: Any) -> float:
    """Greatest difference of a marker's depth from the model's, by the smaller of both: max(r, 1/r)
    − 1.

    ``ratio`` (M,) is r = Z / Z_model, NaN of markers whose depth is not measured. Twice and half of
    the model's depth are both 1; millimetres in place of metres are 999.
    """
    greatest = 0.0
    for i in range(len(ratio)):
        if ratio[i] > 0.0:
            greatest = max(greatest, ratio[i] - 1.0, 1.0 / ratio[i] - 1.0)
    return greatest


@formula
def slip(before: Any, moved: Any, mean_speed: Any, dt: Any) -> Any:
    """By how much positions have changed otherwise than speeds say [rad or m], forgotten within
    :data:`MEMORY`.

    Divided by :data:`MEMORY` it is the error of a speed. ``before`` is the same a sample ago, NaN
    if there was none; ``moved`` q − q_last. 0 at the first sample, and where time does not go on.
    """
    fresh = np.isnan(before) | (dt <= 0.0)
    return np.where(fresh, 0.0, (before + moved - dt * mean_speed) / (1.0 + np.abs(dt) / MEMORY))


@formula
def observed_drift(
    drift: Any, change: Any, rate: Any, most: Any, period: Any, time_constant: Any
) -> Any:
    """d̂ ← d̂ + T_s/(T_s + τ) (d − d̂), d = Δσ/T_s − σ̇ within ±``most``: what moves σ beside what
    the model knows [1/s].

    ``change`` Δσ since the sample before, NaN if there was none, and ``rate`` the mean σ̇ of both.
    The drift is filtered by a lag of the first order with the ``time_constant`` τ [s], so that a
    constant one is found without an offset.
    """
    seen = np.minimum(np.maximum(change / period - rate, -most), most)
    return np.where(
        np.isnan(change), drift, drift + period / (period + time_constant) * (seen - drift)
    )
