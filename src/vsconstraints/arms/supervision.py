"""Bounds beyond which a run on an arm ends, checks before its start, and a watchdog."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import FrameType
from typing import Literal

import numpy as np

from ..errors import ConfigurationError
from ..plugins.portable import TAKE_OVER
from ..plugins.processes import SIGNALS
from ..simulation import Setup
from ..vision.measurement import Plausible
from .driver import Joints


@dataclass(frozen=True)
class Supervision(Plausible):
    """Bounds beyond which the arm is braked; :class:`.Plausible` has those on measurements."""

    start_rad: float = 0.02  #: Greatest distance of a joint from the scenario's start [rad or m].
    rest_rad_s: float = 0.01  #: Greatest speed of a joint before the start [rad/s or m/s].
    following_rad: float = 0.1  #: Greatest distance of a joint from its setpoint [rad or m].
    #: Time for which the arm's clock may stand still in the states that are read [s]; five periods
    #: if that is longer.
    stalled_s: float = 0.02
    #: Greatest delay of a period [s]; beyond a whole period it counts as missed.
    late_s: float = 0.02
    #: Time for the arm to become ready for setpoints, while it stands [s].
    begin_s: float = 2.0
    #: Time without a heartbeat of the loop after which another thread brakes the arm [s]; five
    #: periods if that is longer. An arm's own watchdog should wait longer, or it acts first.
    hang_s: float = 0.05

    def __post_init__(self) -> None:
        for name, bound in vars(self).items():
            if not 0.0 < bound < np.inf:
                raise ConfigurationError(f"{name} must be positive, not {bound}")


def require_start(setup: Setup, state: Joints, supervision: Supervision, from_arm: bool) -> Setup:
    """Return the setup with the start of the arm, which may be elsewhere if ``from_arm``.

    Raises ConfigurationError if the arm is elsewhere, moves, or cannot start there
    (:meth:`Setup.check_start`), or if gradients have errors.
    """
    n = setup.scene.robot.n
    if state.q.shape != (n,) or state.qd.shape != (n,):
        raise ConfigurationError(f"the arm has {len(state.q)} joints, the scenario's robot {n}")
    if not (np.isfinite(state.q).all() and np.isfinite(state.qd).all()):
        raise ConfigurationError("the arm's state is not finite")
    if setup.gradient_error().any:
        raise ConfigurationError(
            "disturbances.gradient_error applies to simulations only: leave it out to run an arm"
        )
    if setup.qd0.any():
        raise ConfigurationError("the scenario starts with joint speeds; an arm starts at rest")
    fast = np.abs(state.qd)
    off = np.abs(setup.scene.robot.difference(state.q, setup.q0))
    i = int(np.argmax(fast))
    j = int(np.argmax(off))
    if fast[i] > supervision.rest_rad_s:
        raise ConfigurationError(
            f"the arm moves: joint {i + 1} at {state.qd[i]:.3g} rad/s; it must stand still"
        )
    if not from_arm and off[j] > supervision.start_rad:
        raise ConfigurationError(
            f"the arm does not stand at the scenario's start: joint {j + 1} is at "
            f"{state.q[j]:.4g}, not at "
            f"{setup.q0[j]:.4g}, {off[j]:.3g} away. Move it there, or let the run start where it "
            f"stands (--from-arm)"
        )
    here = replace(setup, q0=state.q.copy(), qd0=np.zeros(n))
    here.check_start()
    return here


#: ``done``: the whole duration. ``aborted``: the law lost rank, and the scenario stops there.
#: ``failed``: any other cause. ``stopped``: a signal requested it.
ArmEnd = Literal["done", "aborted", "failed", "stopped"]


class RunEnded(Exception):
    """End of the run, with its cause: the arm is to be brought to rest."""

    def __init__(self, ended: ArmEnd, cause: str) -> None:
        super().__init__(cause)
        self.ended: ArmEnd = ended


class Requests:
    """Signals that request the end of the run."""

    def __init__(self) -> None:
        self.signal = 0  #: Number of the first signal; 0 if there is none.
        #: Creates the exception that a signal raises from now on, if the main thread is inside a
        #: period; until it is set, signals are noted.
        self.raising: Callable[[], BaseException] | None = None
        self.inside = False

    def note(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        if self.raising is None:
            # a watchdog's signal may arrive when its run is over
            self.signal = self.signal or number * (number != TAKE_OVER)
        elif self.inside:
            self.inside = False
            raise self.raising()

    @contextmanager
    def period(self) -> Iterator[None]:
        """Mark the block as a period."""
        self.inside = True
        try:
            yield
        finally:
            self.inside = False


@contextmanager
def requests_noted() -> Iterator[Requests]:
    """Note signals without interruption; the loop checks them between two periods."""
    requests = Requests()
    if threading.current_thread() is not threading.main_thread():
        yield requests  # only the main thread receives signals
        return
    handlers = {number: signal.getsignal(number) for number in (*SIGNALS, TAKE_OVER)}
    # ignored signals stay ignored; handlers that were not set by Python could not be restored
    before = {
        number: handler
        for number, handler in handlers.items()
        if handler not in (signal.SIG_IGN, None)
    }
    for number in before:
        signal.signal(number, requests.note)
    try:
        yield requests
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Watchdog(threading.Thread):
    """Thread that acts once if no heartbeat arrives for longer than its patience [s]."""

    def __init__(self, patience: float, act: Callable[[], None]) -> None:
        super().__init__(daemon=True, name="watchdog")
        self._patience = patience
        self._act = act
        self._over = threading.Event()
        self._last = time.monotonic()

    def alive(self, more: float = 0.0) -> None:
        """Note a heartbeat; the next one may take ``more`` seconds longer than usual."""
        self._last = time.monotonic() + more

    def run(self) -> None:
        """Check four times within the patience."""
        while not self._over.wait(0.25 * self._patience):
            if time.monotonic() - self._last > self._patience:
                self._act()
                return

    def end(self) -> None:
        """Stop checking; return when a running action has finished."""
        self._over.set()
        if self.is_alive():
            self.join()
