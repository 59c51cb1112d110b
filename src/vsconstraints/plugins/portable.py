"""Features that not every operating system has: file locks, sizes of pipes, signals and masks.

The rest of the package uses them through this module, so that it can be imported on any system.
"""

from __future__ import annotations

import errno
import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import IO, Any


def _module(name: str) -> Any:
    """Return a module of the standard library; None if the platform lacks it."""
    try:
        return import_module(name)
    except ImportError:
        return None


fcntl = _module("fcntl")  #: Locks of files; None where there are none.
termios = _module("termios")  #: Requests to devices and pipes; None where there are none.


def signals(*names: str) -> tuple[signal.Signals, ...]:
    """Return the named signals that this platform has."""
    return tuple(signal.Signals[name] for name in names if hasattr(signal, name))


#: Signal to a process whose terminal is closed; None if the platform has no such signal.
HANGUP: int | None = getattr(signal, "SIGHUP", None)

#: True if this platform can stop an arm from another thread or process.
STOPS_ARMS = hasattr(signal, "SIGUSR1") and hasattr(signal, "pthread_kill")

#: Signal that interrupts a blocked call in the main thread. No shell ignores it, in contrast to
#: the signal of Ctrl-C.
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


def unread(pipe: int) -> int:
    """Return the number of bytes in a pipe, given by its descriptor; 0 if the system cannot say."""
    size = bytearray(4)
    if fcntl is not None and termios is not None:
        with suppress(OSError):
            fcntl.ioctl(pipe, termios.FIONREAD, size)
    return int.from_bytes(size, sys.byteorder)


@contextmanager
def blocked(numbers: Iterable[int]) -> Iterator[None]:
    """Block signals in this thread; do nothing if the platform cannot block signals."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def unblock(numbers: Iterable[int]) -> None:
    """Unblock signals in this thread; do nothing if the platform cannot block signals."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)
