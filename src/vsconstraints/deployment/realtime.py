"""A process that is not kept waiting: scheduling before all others, memory that stays, no collection of garbage."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

PRIORITY = 80
"""Of SCHED_FIFO, from 1 to 99: above what else runs so, below the system's own threads that watch."""

CURRENT_AND_FUTURE = 1 | 2
"""MCL_CURRENT and MCL_FUTURE of Linux' mlockall."""


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
    before = _schedule() if wanted else "not asked for"
    locked = _lock() if wanted else "not asked for"
    try:
        yield Permitted(before if isinstance(before, str) else "", locked)
    finally:
        if not isinstance(before, str):
            os.sched_setscheduler(0, before[0], os.sched_param(before[1]))
        if not locked:
            ctypes.CDLL(None).munlockall()
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


def _lock() -> str:
    """Why memory is not locked; empty if it is."""
    if sys.platform != "linux":
        return f"{sys.platform}: not tried"
    library = ctypes.CDLL(None, use_errno=True)
    return "" if library.mlockall(CURRENT_AND_FUTURE) == 0 else os.strerror(ctypes.get_errno())
