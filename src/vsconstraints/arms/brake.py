"""A stop within the limits of acceleration and jerk, along the direction of the motion."""

from __future__ import annotations

import numpy as np

from ..rows import Array
from .envelope import Envelope

AT_REST = 1e-9
"""Speed that is rest [rad/s or m/s]."""


def deceleration(speed: Array, jerk: Array, period: float) -> Array:
    """(n,) greatest deceleration now from which a joint comes to rest while it falls by j T in each period.

    Decelerations x, x − jT, x − 2jT, … as long as they are positive take T Σ (x − i jT) off the speed. With n of them
    behind x that is v = T ((n + 1) x − jT n (n + 1)/2), where n is the greatest with n (n + 1)/2 ≤ v/(jT²). Without a
    limit of jerk x = v/T.

    Parameters
    ----------
    speed, jerk
        (n,) v and j, zero or more.
    period
        T [s].
    """
    step = np.where(np.isfinite(jerk), jerk * period, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        n = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * speed / (step * period)) - 1.0))
    n = np.where(np.isfinite(n), n, 0.0)
    x: Array = (speed / period + 0.5 * step * n * (n + 1.0)) / (n + 1.0)
    return x


class Brake:
    """Brings an arm to rest, period after period.

    First each joint takes its present acceleration back as fast as its jerk allows, at once where that is not limited.
    Then all joints slow down alike, so that the arm goes on in a straight line of joint space: the joint that has least
    for its speed says how fast. Where that line would leave a range, each joint stops for itself as fast as it can.

    Parameters
    ----------
    qdd
        (n,) acceleration that was commanded last.
    envelope
        What must be kept.

    Attributes
    ----------
    straight
        Whether all joints slow down alike; None before that is decided.
    """

    def __init__(self, qdd: Array, envelope: Envelope) -> None:
        self.envelope, self.straight = envelope, None
        self._last = np.where(np.isfinite(envelope.jerk), qdd, 0.0)
        self._limits: tuple[Array, Array] | None = None

    straight: bool | None

    def step(self, q: Array, qd: Array) -> Array:
        """(n,) acceleration of the period that begins at ``q`` and ``qd`` (n,)."""
        change = self.envelope.jerk * self.envelope.period
        if self._limits is None and self._last.any():
            self._last = self._last - np.clip(self._last, -change, change)
            return self._last
        if self._limits is None:
            self._limits = self._decide(q, qd)
        (a, jerk), T, speed = self._limits, self.envelope.period, np.abs(qd)
        slower = np.minimum(deceleration(speed, jerk, T), a)
        slower = np.minimum(slower, np.abs(self._last) + jerk * T)
        self._last = -np.sign(qd) * slower
        return self._last

    def at_rest(self, qd: Array) -> bool:
        """Whether nothing is left to do."""
        change = self.envelope.jerk * self.envelope.period * (1.0 + 1e-9)
        still = np.abs(qd) <= AT_REST
        return bool(still.all() and (self._limits is not None or not self._last.any()) and self._small(change))

    def _small(self, change: Array) -> bool:
        return bool((np.abs(self._last) <= change).all())

    def _decide(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """(n,) deceleration and jerk of each joint."""
        limits, speed = self.envelope, np.abs(qd)
        own = limits.acceleration, limits.jerk
        moving = speed > AT_REST
        if not moving.any():
            self.straight = True
            return own
        share = float((limits.acceleration[moving] / speed[moving]).min())
        jerk = float((limits.jerk[moving] / speed[moving]).min())
        # on the way of unit speed: the deceleration grows, holds and falls
        length = 0.5 / share + 1.5 * share / jerk + limits.period
        end = q + length * qd
        self.straight = bool(((end >= limits.q_min) & (end <= limits.q_max) | ~moving).all())
        still = np.maximum(speed, 1e-3 * AT_REST)
        return (share * still, jerk * still) if self.straight else own
