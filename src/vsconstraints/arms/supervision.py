"""What ends a run on an arm, as numbers; and the thread that stops the arm where the loop itself hangs."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from types import FrameType

import numpy as np

from ..comparisons.runs.signals import SIGNALS
from ..errors import ConfigurationError
from ..vision.measurement import Plausible


@dataclass(frozen=True)
class Supervision(Plausible):
    """Bounds beyond which the arm is braked; those of :class:`.Plausible` are of what is measured.

    Attributes
    ----------
    start_rad
        How far a joint may be from the scenario's start [rad or m].
    rest_rad_s
        How fast a joint may move before the start [rad/s or m/s].
    following_rad
        How far a joint may be from where it was sent [rad or m].
    late_s
        How late a period may begin [s]; what is later than a whole period counts as missed.
    begin_s
        How long the arm may take to be ready for setpoints, while it stands [s].
    hang_s
        How long the loop may say nothing before another thread brakes the arm [s]; five periods if that is longer. An
        arm's own watchdog should wait longer, or it comes first.
    image_s
        How old an image may be, and the newest one with a marker [s].
    """

    start_rad: float = 0.02
    rest_rad_s: float = 0.01
    following_rad: float = 0.1
    late_s: float = 0.02
    begin_s: float = 2.0
    hang_s: float = 0.05

    def __post_init__(self) -> None:
        for field in fields(self):
            if not 0.0 < getattr(self, field.name) < np.inf:
                raise ConfigurationError(f"{field.name} must be positive, not {getattr(self, field.name)}")


TAKE_OVER = signal.SIGUSR1
"""With which the watchdog ends a hanging call in the main thread: no shell ignores it, as some do Ctrl-C's."""


class Requests:
    """Signals that asked for a stop.

    Attributes
    ----------
    signal
        Number of the first one; 0 while there is none.
    raising
        What a signal raises from now on, where it finds the main thread inside a period; until then it is noted.
    inside
        Whether it is there.
    """

    def __init__(self) -> None:
        self.signal = 0
        self.raising: Callable[[], BaseException] | None = None
        self.inside = False

    def note(self, number: int, frame: FrameType | None) -> None:
        """A signal has come."""
        if self.raising is None:
            # a watchdog's may come when its run is over
            self.signal = self.signal or number * (number != TAKE_OVER)
        elif self.inside:
            self.inside = False
            raise self.raising()

    @contextmanager
    def period(self) -> Iterator[None]:
        """A period begins and ends."""
        self.inside = True
        try:
            yield
        finally:
            self.inside = False


@contextmanager
def requests_noted() -> Iterator[Requests]:
    """Signals are noted meanwhile, and interrupt nothing: the loop looks at them between two periods."""
    noted = Requests()
    if threading.current_thread() is not threading.main_thread():
        yield noted  # signals are the main thread's
        return
    handlers = {number: signal.getsignal(number) for number in (*SIGNALS, TAKE_OVER)}
    # those that are ignored stay so; those that were not set by Python could not be set again
    before = {number: own for number, own in handlers.items() if own not in (signal.SIG_IGN, None)}
    for number in before:
        signal.signal(number, noted.note)
    try:
        yield noted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Watchdog(threading.Thread):
    """Acts once if it is not told for too long that all is well.

    Parameters
    ----------
    patience
        How long [s].
    act
        What it does, in its own thread.
    """

    def __init__(self, patience: float, act: Callable[[], None]) -> None:
        super().__init__(daemon=True, name="watchdog")
        self._patience, self._act, self._over = patience, act, threading.Event()
        self._heard = time.monotonic()

    def heard(self, more: float = 0.0) -> None:
        """All is well, and it may take so much more time than usual [s] until this is said again."""
        self._heard = time.monotonic() + more

    def run(self) -> None:
        """Look four times in the time that it has patience."""
        while not self._over.wait(0.25 * self._patience):
            if time.monotonic() - self._heard > self._patience:
                self._act()
                return

    def end(self) -> None:
        """Look no more; returns when it has done what it was doing."""
        self._over.set()
        if self.is_alive():
            self.join()
