"""A process that is not kept waiting: scheduling before all others, memory that stays, no collection of garbage."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

PRIORITY = 80
"""Of SCHED_FIFO, from 1 to 99: above what else runs so, below the system's own threads that watch."""

CURRENT_AND_FUTURE = 1 | 2
"""MCL_CURRENT and MCL_FUTURE of Linux' mlockall."""

IPC_LOCK = 14
"""Number of the capability to lock memory without limit."""

RESERVED = 1 << 26
"""Memory that is made ready beforehand, so that the loop waits for none [bytes]."""

TRIM_THRESHOLD, MMAP_MAX = -1, -4
"""M_TRIM_THRESHOLD and M_MMAP_MAX of glibc's mallopt: memory that is freed is kept, and none is mapped by itself."""

NEVER, AS_BEFORE = (2**31 - 1, 0), (128 * 1024, 65536)
"""What they are set to meanwhile, and what they are otherwise."""


@dataclass(frozen=True)
class Permitted:
    """What the system has permitted.

    Attributes
    ----------
    fifo, locked
        Empty if SCHED_FIFO and mlockall were granted; else why not.
    """

    fifo: str
    locked: str

    def said(self) -> list[str]:
        """One sentence each."""
        return [
            f"SCHED_FIFO with priority {PRIORITY}"
            if not self.fifo
            else f"no real-time scheduling ({self.fifo}): other programs can delay the loop",
            "memory is locked" if not self.locked else f"memory is not locked ({self.locked})",
            "no garbage is collected meanwhile",
        ]

    def warnings(self) -> list[str]:
        """What was asked for and not permitted, and what would permit it."""
        found = []
        if self.fifo and self.fifo != NOT_ASKED:
            found.append(
                f"no real-time scheduling ({self.fifo}): other programs can delay the loop by tens of milliseconds. "
                f"`ulimit -r {PRIORITY}` permits it (/etc/security/limits.conf: rtprio)"
            )
        if self.locked and self.locked != NOT_ASKED:
            found.append(
                f"memory is not locked ({self.locked}): the loop can wait for a disk. `ulimit -l unlimited` permits it "
                "(/etc/security/limits.conf: memlock)"
            )
        return found


class Usage(NamedTuple):
    """What a thread has met so far.

    Pages that were not there, those of them that were read from a disk, and how often another thread was let before it.
    """

    faults: int
    from_disk: int
    preempted: int


def usage() -> Usage:
    """Of this thread; zeros where the system does not tell."""
    try:
        import resource

        now = resource.getrusage(resource.RUSAGE_THREAD)
    except (ImportError, AttributeError):
        return Usage(0, 0, 0)
    return Usage(now.ru_minflt + now.ru_majflt, now.ru_majflt, now.ru_nivcsw)


def used(before: Usage, after: Usage) -> str:
    """What was met between the two, in words."""
    faults, from_disk, preempted = (b - a for a, b in zip(before, after, strict=True))
    return f"meanwhile {faults} page faults, {from_disk} of them from disk, and preempted {preempted} times"


NOT_ASKED = "not asked for"


@contextmanager
def real_time(wanted: bool = True) -> Iterator[Permitted]:
    """Meanwhile this thread, and threads that it starts, run as real time permits; then as before.

    Parameters
    ----------
    wanted
        If not, only garbage is left alone.
    """
    collected = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    before = _schedule() if wanted else NOT_ASKED
    reserved = wanted and reserve_memory()
    locked = lock_memory() if wanted else NOT_ASKED
    try:
        yield Permitted(before if isinstance(before, str) else "", locked)
    finally:
        if not isinstance(before, str):
            os.sched_setscheduler(0, before[0], os.sched_param(before[1]))
        if not locked:
            ctypes.CDLL(None).munlockall()
        if reserved:
            set_malloc(*AS_BEFORE)
        gc.unfreeze()
        if collected:
            gc.enable()


def _schedule() -> tuple[int, int] | str:
    """Policy and priority until now; or why nothing was changed."""
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except AttributeError:
        return f"{sys.platform} has none"
    except OSError as error:
        return str(error.strerror)
    return before


def lock_memory() -> str:
    """Why memory is not locked; empty if it is."""
    if sys.platform != "linux":
        return f"{sys.platform}: not tried"
    import resource

    most = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if most != resource.RLIM_INFINITY and not may_lock():
        # within a limit, what the program asks for later would be refused
        return f"a limit of {most / 2**20:g} MB"
    library = ctypes.CDLL(None, use_errno=True)
    return "" if library.mlockall(CURRENT_AND_FUTURE) == 0 else os.strerror(ctypes.get_errno())


def may_lock() -> bool:
    """Whether this process may lock memory without limit."""
    with suppress(OSError, ValueError, IndexError):
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        return bool(int(status.split("CapEff:")[1].split()[0], 16) >> IPC_LOCK & 1)
    return False


def reserve_memory() -> bool:
    """Have memory ready that the C library gives out without asking the system; False where it is another library."""
    try:
        library = ctypes.CDLL(None)
        set_malloc(*NEVER)
        library.malloc.restype = ctypes.c_void_p
        library.malloc.argtypes, library.free.argtypes = [ctypes.c_size_t], [ctypes.c_void_p]
        block = library.malloc(RESERVED)
    except (AttributeError, OSError, TypeError):
        return False
    if block:
        ctypes.memset(block, 0, RESERVED)
        library.free(block)
    return True


def set_malloc(trim: int, mapped: int) -> None:
    """Tell malloc from how many free bytes on it gives memory back, and how many arrays it may map by themselves."""
    library = ctypes.CDLL(None)
    library.mallopt(TRIM_THRESHOLD, trim)
    library.mallopt(MMAP_MAX, mapped)
