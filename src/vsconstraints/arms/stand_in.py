"""An arm that stands in for a real one: it follows setpoints in time, has limits, and stops by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rows import Array

PATIENCE = 0.1
"""How long after the end of a period an arm goes on as it was sent; then its watchdog brakes it [s].

Ten periods if that is longer.
"""

LATE = 0.01
"""By how much a setpoint may be late before it is held against where the arm is, and not where it was sent [s]."""

SLACK = 1.05
"""What is refused is beyond its limits by this factor: setpoints come through a network."""


@dataclass(frozen=True)
class StandInLimits:
    """(n,) what the arm takes, and how hard it brakes by itself."""

    q_min: Array
    q_max: Array
    qd_max: Array
    acceleration: Array


class StandIn:
    """Position is a cubic from one setpoint to the next, then goes on straight for a while, then the arm brakes.

    That is its watchdog: an arm that it has braked takes nothing more.

    Parameters
    ----------
    q
        (n,) where it stands.
    limits
        What it takes.
    period
        In which a setpoint is reached [s].
    patience
        Of its watchdog: see :data:`PATIENCE`.

    Attributes
    ----------
    t
        Its clock [s]; :meth:`advance` moves it.
    stopped
        Why it stopped by itself and takes nothing more; empty if it has not.
    """

    def __init__(self, q: Array, limits: StandInLimits, period: float, patience: float = PATIENCE) -> None:
        n = len(q)
        self.limits, self.period, self.t, self.stopped = limits, period, 0.0, ""
        self._begun, self._most = -np.inf, max(patience, 10.0 * period)
        self._patience = self._most
        here: tuple[Array, Array] = np.array(q), np.zeros(n)
        self._from, self._to = here, here

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        self.t += max(seconds, 0.0)
        silent = self.t - self._begun - self.period
        if np.isfinite(self._begun) and silent > self._most and not self.stopped:
            self.stopped = f"its watchdog was told nothing for {1e3 * self._most:g} ms"

    def state(self) -> tuple[Array, Array]:
        """(n,) q and q̇ now."""
        T, (q0, v0), (q1, v1) = self.period, self._from, self._to
        after = self.t - self._begun
        if after < T:
            s = after / T
            q = q0 + s * s * (3.0 - 2.0 * s) * (q1 - q0) + T * s * (1.0 - s) * ((1.0 - s) * v0 - s * v1)
            qd = 6.0 * s * (1.0 - s) * (q1 - q0) / T + (1.0 - s) * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1
            return q, qd
        straight = min(after - T, self._patience)
        # (n,) for how long each joint brakes
        braking = np.minimum(after - T - straight, np.abs(v1) / self.limits.acceleration)
        slower = np.sign(v1) * self.limits.acceleration * braking
        return q1 + straight * v1 + braking * (v1 - 0.5 * slower), v1 - slower

    def take(self, q: Array, qd: Array) -> None:
        """A setpoint for the end of the period that begins; one beyond the limits makes the arm stop by itself."""
        if self.stopped:
            return
        before = self._to if self.t - self._begun < self.period + LATE else self.state()
        limits, T = self.limits, self.period
        wrong = (
            ("is not finite", ~(np.isfinite(q) & np.isfinite(qd))),
            ("leaves its range", (q < limits.q_min - 1e-6) | (q > limits.q_max + 1e-6)),
            ("is too fast", np.maximum(np.abs(qd), np.abs(q - before[0]) / T) > SLACK * limits.qd_max + 1e-3),
            ("accelerates too much", np.abs(qd - before[1]) / T > SLACK * limits.acceleration + 1e-3),
        )
        for what, joints in wrong:
            if joints.any():
                self.stop(f"protective stop: joint {int(np.argmax(joints)) + 1} {what}")
                return
        self._from, self._to, self._begun, self._patience = (
            self.state(),
            (np.array(q), np.array(qd)),
            self.t,
            self._most,
        )

    def stop(self, why: str) -> None:
        """Brake now, and take nothing more."""
        here = self.state()
        self._from, self._to = here, here
        self._begun, self._patience, self.stopped = self.t - self.period, 0.0, why
