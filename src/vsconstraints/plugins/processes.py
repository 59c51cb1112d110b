"""How this process ends: with the one that started it, after a deadline, and on a signal.

SIGTERM and SIGHUP do what Ctrl-C does: what was finished is kept, and the exit code is 128 + the signal.
"""

from __future__ import annotations

import ctypes
import faulthandler
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from . import portable

#: What asks a command to stop: Ctrl-C, the system, and a terminal that is closed.
SIGNALS = portable.signals("SIGINT", "SIGTERM", "SIGHUP")

PR_SET_PDEATHSIG = 1  #: of Linux' prctl: the signal that a process gets when its parent ends
SAME_REQUEST = 2.0  # signals within this time of one that was obeyed [s] mean the same: closing terminals send several
SLACK = 1.0  # a step may take so much longer than its limit [s]: setting the clock takes a share of a short one


class Stopped(BaseException):
    """A signal, with this number, asked this process to stop."""


#: What a signal is raised as: in programs of others it is theirs to say, and Ctrl-C is KeyboardInterrupt.
INTERRUPTS = (KeyboardInterrupt, Stopped)


def signal_of(interrupt: BaseException) -> int:
    """Number of the signal that raised one of :data:`INTERRUPTS`."""
    return int(interrupt.args[0]) if isinstance(interrupt, Stopped) else int(signal.SIGINT)


def exit_code(number: int) -> int:
    """That of a process that was ended by this signal."""
    return 128 + number


class _Held:  # signals of this process: how often they are held, and which one waits
    depth = waiting = 0


def obey_signals() -> None:
    """From now on each of :data:`SIGNALS` raises :class:`Stopped` in the main thread; those ignored stay ignored."""
    terminals = [stream.fileno() for stream in (sys.stdout, sys.stderr) if stream.isatty()]
    obeyed = -SAME_REQUEST

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal obeyed
        if number == portable.HANGUP:
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
    try:
        with portable.blocked(SIGNALS):
            _Held.depth += 1
            try:
                yield
            finally:
                _Held.depth -= 1
    finally:
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


def end_with(parent: int) -> None:
    """End this process when its parent, which has this id, ends, for whatever reason."""
    if sys.platform == "linux":
        with suppress(AttributeError, OSError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
    # on other systems, or where prctl is not allowed; this waits while compiled code keeps the interpreter busy
    if (starter := multiprocessing.parent_process()) is not None:
        threading.Thread(target=_end_after, args=(starter,), daemon=True).start()


def _end_after(starter: multiprocessing.process.BaseProcess) -> None:
    starter.join()
    os._exit(1)
