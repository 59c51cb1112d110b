"""The process that answers the calls of a pool, and ends with the process that started it."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection

from ...compiled import COMPLAINT
from .signals import SIGNALS

PR_SET_PDEATHSIG = 1
"""Of Linux' prctl: the signal that a process gets when its parent ends."""


@dataclass(frozen=True)
class Failure:
    """Why a call has no answer: what it raised, that its process died, or that it took too long."""

    reason: str


def serve(connection: Connection, parent: int) -> None:
    """Receive a function, say that it is there, then answer each tuple of arguments, until the connection closes.

    Parameters
    ----------
    connection
        To the pool.
    parent
        Identifies the process of the pool.
    """
    end_with(parent)
    warnings.filterwarnings("ignore", COMPLAINT, RuntimeWarning)  # the pool's process says it
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the pool's to handle: Ctrl-C reaches all processes of a terminal
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    with suppress(EOFError, OSError):  # the pool is gone
        function = connection.recv()
        connection.send(None)
        while True:
            _send(connection, _answer(function, connection.recv_bytes()))


def _answer(function: Callable[..., object], packed: bytes) -> object:
    try:
        return function(*pickle.loads(packed))
    except BaseException as error:  # even SystemExit: this is where one call ends and the others begin
        return Failure(f"{type(error).__name__}: {error}")


def _send(connection: Connection, answer: object) -> None:
    try:
        packed = pickle.dumps(answer)
    except Exception as error:  # own parts can raise anything when they are packed
        packed = pickle.dumps(Failure(f"the answer cannot be sent: {type(error).__name__}: {error}"))
    connection.send_bytes(packed)


def end_with(parent: int) -> None:
    """End this process when its parent ends, whatever ends that.

    Parameters
    ----------
    parent
        Identifies the process that started this one.
    """
    if sys.platform == "linux":
        with suppress(AttributeError, OSError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
    # elsewhere, and where the system call is not allowed; waits as long as compiled code keeps the interpreter busy
    starter = multiprocessing.parent_process()
    if starter is not None:
        threading.Thread(target=_end_after, args=(starter,), daemon=True).start()


def _end_after(starter: multiprocessing.process.BaseProcess) -> None:
    starter.join()
    os._exit(1)
