"""Clocks of a control loop, and settings of a real-time process.

The settings are SCHED_FIFO, locked memory, and no garbage collection.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

#: Priority of SCHED_FIFO, from 1 to 99: above other real-time programs, below the system's own
#: watchdog threads.
PRIORITY = 80
CURRENT_AND_FUTURE = 1 | 2  #: MCL_CURRENT and MCL_FUTURE of Linux' mlockall.
IPC_LOCK = 14  #: Number of the capability to lock memory without limit.
#: Time before an instant at which sleeping ends and polling begins [s], because a system's sleep
#: overshoots.
SPIN = 150e-6


class RealClock:
    """The system's monotonic clock."""

    simulated = False

    def now(self) -> float:
        """Return the time [s]."""
        return time.perf_counter()

    def wait(self, until: float) -> None:
        """Return at that instant, or at once if it has passed."""
        left = until - time.perf_counter() - SPIN
        if left > 0.0:
            time.sleep(left)
        while time.perf_counter() < until:
            pass


class SimulatedClock:
    """Clock that advances only when it is waited for."""

    simulated = True
    t = 0.0

    def now(self) -> float:
        """Return the time [s]."""
        return self.t

    def wait(self, until: float) -> None:
        """Advance to that instant."""
        self.t = max(self.t, until)


Clock = RealClock | SimulatedClock


#: Consequence of each refusal, and the setting that would permit the request.
REFUSED = (
    "no real-time scheduling ({}): other programs can delay the loop by tens of milliseconds. "
    f"`ulimit -r {PRIORITY}` permits it (/etc/security/limits.conf: rtprio)",
    "memory is not locked ({}): the loop can wait for a disk. `ulimit -l unlimited` permits it "
    "(/etc/security/limits.conf: memlock)",
)


class Permitted(NamedTuple):
    """Reasons why SCHED_FIFO and mlockall were refused.

    Empty if granted, None if not requested.
    """

    fifo: str | None
    locked: str | None

    def sentences(self) -> list[str]:
        """One sentence on each setting."""
        fifo, locked = ("not requested" if why is None else why for why in self)
        loop = f"no real-time scheduling ({fifo}): other programs can delay the loop"
        return [
            loop if fifo else f"SCHED_FIFO with priority {PRIORITY}",
            f"memory is not locked ({locked})" if locked else "memory is locked",
            "garbage collection is off during the run",
        ]

    def warnings(self) -> list[str]:
        """Refused settings, and how to permit them."""
        return [text.format(why) for text, why in zip(REFUSED, self, strict=True) if why]


@contextmanager
def real_time(wanted: bool = True) -> Iterator[Permitted]:
    """Run this thread, and threads that it starts, in real time as far as permitted.

    Garbage collection is off in any case.
    """
    collected = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    before = _schedule() if wanted else None
    locked = lock_memory() if wanted else None
    try:
        yield Permitted("" if isinstance(before, tuple) else before, locked)
    finally:
        if isinstance(before, tuple):
            os.sched_setscheduler(0, before[0], os.sched_param(before[1]))
        if locked == "":
            ctypes.CDLL(None).munlockall()
        gc.unfreeze()
        if collected:
            gc.enable()


def _schedule() -> tuple[int, int] | str:
    """Set the real-time schedule; return the former policy and priority, or why it failed."""
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except AttributeError:
        return f"{sys.platform} has none"
    except OSError as error:
        return str(error.strerror)
    return before


def lock_memory() -> str:
    """Lock memory; return the reason of a refusal, empty if it is locked."""
    if sys.platform != "linux":
        return f"{sys.platform}: not tried"
    import resource

    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if limit != resource.RLIM_INFINITY and not may_lock():
        # with a limit, later allocations of the program would fail
        return f"a limit of {limit / 2**20:g} MB"
    library = ctypes.CDLL(None, use_errno=True)
    return "" if library.mlockall(CURRENT_AND_FUTURE) == 0 else os.strerror(ctypes.get_errno())


def may_lock() -> bool:
    """True if this process has the capability to lock memory without limit."""
    with suppress(OSError, ValueError, IndexError):
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        return bool(int(status.split("CapEff:")[1].split()[0], 16) >> IPC_LOCK & 1)
    return False
