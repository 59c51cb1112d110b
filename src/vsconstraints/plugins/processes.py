"""Termination of this process: with its parent, after a deadline, and on a signal.

SIGTERM and SIGHUP act as Ctrl-C: finished results are kept, and the exit code is 128 + the signal.
"""

from __future__ import annotations

import ctypes
import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from . import portable

#: Signals that stop a command: from Ctrl-C, from the system, and from a closed terminal.
SIGNALS = portable.signals("SIGINT", "SIGTERM", "SIGHUP")

PR_SET_PDEATHSIG = 1  #: Option of Linux' prctl: the signal sent to a process when its parent ends.
# a signal within this time after an obeyed one [s] is ignored: closing terminals send several
SAME_REQUEST = 2.0
SLACK = 1.0  # tolerance of a step's time limit [s], since its watcher checks rarely
TICK = 0.5  # period at which the watcher of a process checks its stopwatch [s]
LONGEST_TICK = 2.0  # a longer time between two checks [s] means that the watcher was stopped


class Stopped(BaseException):
    """A signal requested this process to stop; the argument is its number."""


#: Exceptions that signals raise. Programs that use this package handle signals themselves; there
#: Ctrl-C raises KeyboardInterrupt.
INTERRUPTS = (KeyboardInterrupt, Stopped)


def signal_of(interrupt: BaseException) -> int:
    """Return the number of the signal that raised one of :data:`INTERRUPTS`."""
    return int(interrupt.args[0]) if isinstance(interrupt, Stopped) else int(signal.SIGINT)


def exit_code(number: int) -> int:
    """Return the exit code of a process that this signal ended."""
    return 128 + number


class _Held:
    """State of :func:`signals_held` in this process."""

    depth = 0  #: Number of nested blocks that hold signals.
    waiting = 0  #: Signal to deliver at the end of the block; 0 if there is none.


def obey_signals() -> None:
    """Let each of :data:`SIGNALS` raise :class:`Stopped` in the main thread from now on.

    Ignored signals stay ignored.
    """
    terminals = [stream.fileno() for stream in (sys.stdout, sys.stderr) if stream.isatty()]
    obeyed = -SAME_REQUEST

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal obeyed
        if number == portable.HANGUP:
            # writing to a closed terminal would raise while results are being stored
            nowhere = os.open(os.devnull, os.O_WRONLY)
            for terminal in terminals:
                os.dup2(nowhere, terminal)
            os.close(nowhere)
        if time.monotonic() - obeyed >= SAME_REQUEST:
            obeyed = time.monotonic()
            if not _Held.depth:
                raise Stopped(number)
            # a signal mask applies to one thread: another thread, such as that of a progress bar,
            # has let the signal through
            _Held.waiting = number

    for number in SIGNALS:
        # `nohup`, and shells that start a background process, ignore some signals on purpose
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)


@contextmanager
def signals_held() -> Iterator[None]:
    """Hold signals in the block and deliver them at its end.

    A process that is started in the block inherits the signal mask.
    """
    try:
        with portable.blocked(SIGNALS):
            _Held.depth += 1
            try:
                yield
            finally:
                _Held.depth -= 1
    finally:
        waiting = _Held.waiting
        _Held.waiting = 0
        if waiting:
            raise Stopped(waiting)


class Stopwatch:
    """Running time of a process, without the time during which it or its watcher was stopped.

    A process is stopped by a signal, by a batch system, or with the whole machine. The watcher
    counts in short ticks. If a tick lasts longer than ``LONGEST_TICK``, the watcher itself was
    stopped, and the excess does not count.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Restart at zero."""
        self.seconds = 0.0
        self._counted = time.monotonic()

    def tick(self, process: int | None = None) -> None:
        """Add the time since the last tick, unless the process with this id is stopped now.

        Without an id, the stopwatch measures this process.
        """
        now = time.monotonic()
        passed = min(now - self._counted, LONGEST_TICK)
        self._counted = now
        if process is None or not is_stopped(process):
            self.seconds += passed


def is_stopped(process: int) -> bool:
    """Return True if a process is stopped by a signal or a debugger; False if unknown."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    # the state follows the name in parentheses, which may contain any character
    state = status.rpartition(")")[2].split()[0]
    return state in ("T", "t")


@contextmanager
def deadline(limit: float) -> Iterator[Callable[[], None]]:
    """End this process if a step exceeds its limit [s], also in compiled code; inf means no limit.

    Call the yielded function at the start of each step, which ends the previous one. Time during
    which the process is stopped does not count. A thread ends steps that wait; the system ends
    steps that compute, even if they block other threads.
    """
    if limit == math.inf:
        yield lambda: None
        return
    allowed = limit + SLACK
    stopwatch = Stopwatch()
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(TICK):
            stopwatch.tick()
            if stopwatch.seconds > allowed:
                os._exit(1)

    def step() -> None:
        stopwatch.restart()
        _limit_processor_time(allowed)

    step()
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield step
    finally:
        ended.set()
        _limit_processor_time(0.0)
        watcher.join()


def _limit_processor_time(limit: float) -> None:
    """Let the system end this process after this much processor time [s]; 0 means no limit."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, limit)


def end_with(parent: int) -> None:
    """End this process when its parent, which has this id, ends for any reason."""
    if sys.platform == "linux":
        with suppress(AttributeError, OSError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
    # for other systems, and if prctl is not permitted; the thread cannot run while compiled code
    # blocks the interpreter
    if (starter := multiprocessing.parent_process()) is not None:
        threading.Thread(target=_end_after, args=(starter,), daemon=True).start()


def _end_after(starter: multiprocessing.process.BaseProcess) -> None:
    starter.join()
    os._exit(1)
