"""Clocks of a control loop: one that goes by itself, and one that goes as fast as the loop does."""

from __future__ import annotations

import time

SPIN = 150e-6
"""How long before an instant sleeping ends and asking begins [s]: a sleep of the system's ends later than it says."""


class RealClock:
    """The system's, which only goes forward."""

    simulated = False

    def now(self) -> float:
        """[s]."""
        return time.perf_counter()

    def wait(self, until: float) -> None:
        """Return at that instant, or at once if it is over."""
        left = until - time.perf_counter() - SPIN
        if left > 0.0:
            time.sleep(left)
        while time.perf_counter() < until:
            pass


class SimulatedClock:
    """Goes on when it is waited for, and never otherwise."""

    simulated = True

    def __init__(self) -> None:
        self._now = 0.0

    def now(self) -> float:
        """[s]."""
        return self._now

    def wait(self, until: float) -> None:
        """Be there."""
        self._now = max(self._now, until)


Clock = RealClock | SimulatedClock
