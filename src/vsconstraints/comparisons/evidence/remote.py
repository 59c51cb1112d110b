"""The worker side of a cluster: a Dask worker answers each call by a process of its own, one for each of its threads.

A call that ends its process, or takes too long, fails as it does on one machine, and the Dask worker goes on. These
processes import what is on the disk when the session begins, however old the worker is.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.util import Finalize
from typing import Any, NamedTuple

from ..runs.pool import THREAD_VARIABLES, Pool


@dataclass(frozen=True)
class Session:
    """A command that has its runs made on a cluster.

    Attributes
    ----------
    name
        Unique to this command.
    identity
        Picklable; returns what results depend on where it is called.
    expected
        Its answer where the command was given.
    """

    name: str
    identity: Callable[[], Any]
    expected: Any


class Call(NamedTuple):
    """A call, how long it may take [s], and whether it is made once more if its process dies."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    limit: float | None = None
    again: bool = True


@dataclass(frozen=True)
class IncompatibleWorker:
    """A worker whose results would differ, with what they depend on there, or a :class:`.Failure` if unknown."""

    address: str
    identity: Any


@dataclass
class _Process:
    """The process of a thread, for one session, in a pool of its own."""

    session: str
    pool: Pool[Any]

    def end(self, error: type[BaseException] | None = None) -> None:
        self.pool.__exit__(error, None, None)


_processes: dict[int, _Process] = {}
"""By the threads of this Dask worker."""

_lock = threading.Lock()
_finalizers: list[Finalize] = []


def answered(packed: bytes) -> bytes:
    """Answer a call of a session, both packed; an :class:`IncompatibleWorker` where the answer would differ."""
    session, call = pickle.loads(packed)
    process = _process(session)
    return pickle.dumps(process if isinstance(process, IncompatibleWorker) else _answer(process, call))


def end(session: str) -> None:
    """End the processes of a session, whatever they are doing."""
    for process in _take(session):
        process.end(KeyboardInterrupt)


def _take(session: str = "") -> list[_Process]:
    """Forget the processes of a session, or all, to end them."""
    with _lock:
        return [_processes.pop(key) for key, each in list(_processes.items()) if session in ("", each.session)]


def _process(session: Session) -> _Process | IncompatibleWorker:
    """The process of this thread; a new one where there is none, or one of an earlier session."""
    thread = threading.get_ident()
    process = _processes.get(thread)
    if process is not None and process.session == session.name:
        return process
    if process is not None:
        process.end()
    process = _Process(session.name, Pool(_call, 1))
    with _lock:
        _may_have_children()
        _processes[thread] = process
    identity = _answer(process, Call(session.identity, ()))
    if identity == session.expected:
        return process
    for each in _take(session.name):
        each.end()
    from distributed import get_worker

    return IncompatibleWorker(get_worker().address, identity)


def _answer(process: _Process, call: Call) -> Any:
    limits = {} if call.limit is None else {0: call.limit}
    ((_, answer),) = process.pool.run({0: (call.function, call.arguments)}, limits, again=call.again)
    return answer


def _call(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    return function(*arguments)


def _may_have_children() -> None:
    """Make this Dask worker a process that may have children: it is started as one that may not."""
    current = multiprocessing.current_process()
    if current.daemon:
        current.daemon = False
    for variable in THREAD_VARIABLES:  # pools set them for a moment, and here each thread has one
        os.environ.setdefault(variable, "1")
    if not _finalizers:
        # before the interpreter waits for the children of this process, which wait for it
        _finalizers.append(Finalize(None, end, ("",), exitpriority=100))
