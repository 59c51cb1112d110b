"""Processes that end with the one that started them."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from contextlib import suppress

PR_SET_PDEATHSIG = 1  #: of Linux' prctl: the signal that a process gets when its parent ends


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
