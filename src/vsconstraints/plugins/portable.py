"""Parts that not every operating system has: locks of files, some signals, masks of signals.

The rest of the package takes them from here, so that it can be imported everywhere.
"""

from __future__ import annotations

import errno
import signal
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import IO, Any


def _module(name: str) -> Any:
    """Return a module of the standard library, or None where the platform lacks it."""
    try:
        return import_module(name)
    except ImportError:
        return None


fcntl = _module("fcntl")  #: Locks of files; None where there are none.


def signals(*names: str) -> tuple[signal.Signals, ...]:
    """Return those of the named signals that this platform has."""
    return tuple(signal.Signals[name] for name in names if hasattr(signal, name))


#: Sent to a process whose terminal is closed; None where there is no such signal.
HANGUP: int | None = getattr(signal, "SIGHUP", None)

#: Whether this platform has what stops an arm from another thread or process.
STOPS_ARMS = hasattr(signal, "SIGUSR1") and hasattr(signal, "pthread_kill")

#: Interrupts a call that hangs in the main thread: no shell ignores it, as some do with Ctrl-C's.
TAKE_OVER: signal.Signals = getattr(signal, "SIGUSR1", signal.SIGINT)


def lock(file: IO[Any], wait: bool) -> None:
    """Lock an open file until it is closed.

    Raises
    ------
    BlockingIOError
        if another process holds the lock and this one is not to wait.
    OSError
        if the file cannot be locked on this platform or file system.
    """
    if fcntl is None:
        raise OSError(errno.ENOTSUP, "this platform has no locks of files")
    fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def blocked(numbers: Iterable[int]) -> Iterator[None]:
    """Block signals in this thread; do nothing where signals cannot be blocked."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def unblock(numbers: Iterable[int]) -> None:
    """Let signals through to this thread again; do nothing where signals cannot be blocked."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)
