"""SIGTERM and SIGHUP do what Ctrl-C does: what was finished is kept, and the exit code is 128 + the signal."""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

#: What asks a command to stop: Ctrl-C, the system, and a terminal that is closed.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

# Signals within this time of one that was obeyed mean the same and are ignored [s]: a terminal that closes, and what
# ends services, send several; while the first one is obeyed tables are written.
SAME_REQUEST = 2.0

# A step may take so much longer than its limit [s]: setting the clock for every short one would take a share of it.
SLACK = 1.0


class Stopped(BaseException):
    """A signal, with this number, asked this process to stop."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.signal = number


#: What a signal is raised as: in programs of others it is theirs to say, and Ctrl-C is KeyboardInterrupt.
INTERRUPTS = (KeyboardInterrupt, Stopped)


def signal_of(interrupt: BaseException) -> int:
    """Number of the signal that raised one of :data:`INTERRUPTS`."""
    return interrupt.signal if isinstance(interrupt, Stopped) else int(signal.SIGINT)


def exit_code(number: int) -> int:
    """What a process that was ended by this signal answers."""
    return 128 + number


class _Held:
    """Signals of this process that are held: how often, and which one waits (0 if none)."""

    depth = 0
    waiting = 0


def obey_signals() -> None:
    """From now on each of :data:`SIGNALS` raises :class:`Stopped` in the main thread; those ignored stay ignored."""
    terminals = [stream.fileno() for stream in (sys.stdout, sys.stderr) if stream.isatty()]
    obeyed = -SAME_REQUEST

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal obeyed
        if number == signal.SIGHUP:
            # what is written to a terminal that was closed would raise in the middle of keeping results
            nowhere = os.open(os.devnull, os.O_WRONLY)
            for terminal in terminals:
                os.dup2(nowhere, terminal)
            os.close(nowhere)
        if time.monotonic() - obeyed >= SAME_REQUEST:
            obeyed = time.monotonic()
            if not _Held.depth:
                raise Stopped(number)
            # the mask is that of one thread: another one, such as that of a progress bar, has let it through
            _Held.waiting = number

    for number in SIGNALS:
        # `nohup`, and shells that start something in the background, ignore some on purpose
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)


@contextmanager
def signals_held() -> Iterator[None]:
    """What arrives meanwhile is delivered at the end; a process that is started inherits that it is held."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    _Held.depth += 1
    try:
        yield
    finally:
        _Held.depth -= 1
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        waiting, _Held.waiting = _Held.waiting, 0
        if waiting:
            raise Stopped(waiting)


@contextmanager
def deadline(limit: float | None) -> Iterator[Callable[[], None]]:
    """End this process if a step takes longer than its limit [s], also in compiled code; None is no limit.

    The function that it yields is called where a step begins and the one before has ended.
    """
    if limit is None:
        yield lambda: None
        return
    last = -float("inf")
    with open(os.devnull, "w") as nowhere:

        def step() -> None:
            nonlocal last
            now = time.monotonic()
            if now - last > SLACK:
                last = now
                faulthandler.dump_traceback_later(limit + SLACK, exit=True, file=nowhere)

        try:
            yield step
        finally:
            faulthandler.cancel_dump_traceback_later()
