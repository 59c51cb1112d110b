"""How this process ends: with the one that started it, after a deadline, and on a signal.

SIGTERM and SIGHUP do what Ctrl-C does: what was finished is kept, and the exit code is 128 + the
signal.
"""

from __future__ import annotations

import ctypes
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

#: What asks a command to stop: Ctrl-C, the system, and a terminal that is closed.
SIGNALS = portable.signals("SIGINT", "SIGTERM", "SIGHUP")

PR_SET_PDEATHSIG = 1  #: of Linux' prctl: the signal that a process gets when its parent ends
# signals within this time of one that was obeyed [s] mean the same: closing terminals send several
SAME_REQUEST = 2.0
SLACK = 1.0  # a step may take so much longer than its limit [s]: its watcher looks rarely
TICK = 0.5  # how often the watcher of a process looks at its stopwatch [s]
LONGEST_TICK = 2.0  # a longer time between two looks [s] means that the watcher was stopped


class Stopped(BaseException):
    """A signal, with this number, asked this process to stop."""


#: What a signal is raised as: in programs of others it is theirs to say, and Ctrl-C is
#: KeyboardInterrupt.
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
    """From now on each of :data:`SIGNALS` raises :class:`Stopped` in the main thread; those ignored
    stay ignored.
    """
    terminals = [stream.fileno() for stream in (sys.stdout, sys.stderr) if stream.isatty()]
    obeyed = -SAME_REQUEST

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal obeyed
        if number == portable.HANGUP:
            # what is written to a terminal that was closed would raise in the middle of keeping
            # results
            nowhere = os.open(os.devnull, os.O_WRONLY)
            for terminal in terminals:
                os.dup2(nowhere, terminal)
            os.close(nowhere)
        if time.monotonic() - obeyed >= SAME_REQUEST:
            obeyed = time.monotonic()
            if not _Held.depth:
                raise Stopped(number)
            # the mask is that of one thread: another one, such as that of a progress bar, has let
            # it through
            _Held.waiting = number

    for number in SIGNALS:
        # `nohup`, and shells that start something in the background, ignore some on purpose
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)


@contextmanager
def signals_held() -> Iterator[None]:
    """What arrives meanwhile is delivered at the end; a process that is started inherits that it is
    held.
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
    """Time that a process had for something, without the time during which it or its watcher was
    stopped.

    A process is stopped by a signal, by a batch system, or with the whole machine. Who watches it
    counts in short ticks: of a tick that lasts longer than :data:`LONGEST_TICK`, the watcher itself
    was stopped for the rest.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Begin at zero."""
        self.seconds = 0.0
        self._counted = time.monotonic()

    def tick(self, process: int | None = None) -> None:
        """Count the time since the last tick, unless the process with this id, if it is another
        one, is stopped now.
        """
        now = time.monotonic()
        passed = min(now - self._counted, LONGEST_TICK)
        self._counted = now
        if process is None or not is_stopped(process):
            self.seconds += passed


def is_stopped(process: int) -> bool:
    """Return True if a process is stopped by a signal or a debugger; False also where the system
    does not say.
    """
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    # the state follows the name in parentheses, which may hold anything
    state = status.rpartition(")")[2].split()[0]
    return state in ("T", "t")


@contextmanager
def deadline(limit: float | None) -> Iterator[Callable[[], None]]:
    """End this process if a step takes longer than its limit [s], also in compiled code; None is no
    limit.

    The function that it yields is called where a step begins and the one before has ended. Time
    during which the process is stopped does not count. A thread ends steps that wait; the system
    ends those that compute, whether or not they let other threads run.
    """
    if limit is None:
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
    """Let the system end this process after so much processor time of its own [s]; 0 is no
    limit.
    """
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, limit)


def end_with(parent: int) -> None:
    """End this process when its parent, which has this id, ends, for whatever reason."""
    if sys.platform == "linux":
        with suppress(AttributeError, OSError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
    # on other systems, or where prctl is not allowed; this waits while compiled code keeps the
    # interpreter busy
    if (starter := multiprocessing.parent_process()) is not None:
        threading.Thread(target=_end_after, args=(starter,), daemon=True).start()


def _end_after(starter: multiprocessing.process.BaseProcess) -> None:
    starter.join()
    os._exit(1)
