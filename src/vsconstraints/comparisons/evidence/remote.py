"""The far side of a cluster: calls that came to a Dask worker, each answered by a process of the worker's own.

Such a process is one of a :class:`.Pool` of one: a call that ends its process, or takes too
long, fails as it does on one machine, and the Dask worker goes on. A worker with several threads has a process for
each. What is imported in them is what lies on the disk when the session begins, however old the worker is.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.util import Finalize
from typing import Any

from ..runs.pool import THREAD_VARIABLES, Pool


@dataclass(frozen=True)
class Session:
    """A command that has its runs made on a cluster.

    Attributes
    ----------
    name
        Of this command alone.
    identity
        Says what results depend on, where it is called: picklable, with an answer that can be compared.
    expected
        What it says where the command was given.
    """

    name: str
    identity: Callable[[], Any]
    expected: Any


@dataclass(frozen=True)
class Call:
    """A call of one function.

    Attributes
    ----------
    function, arguments
        What is called.
    limit
        How long it may take [s]; as long as it likes if None.
    again
        Whether it is made once more if its process dies.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    limit: float | None = None
    again: bool = True


@dataclass(frozen=True)
class Stranger:
    """A worker whose results would be others.

    Attributes
    ----------
    address
        Which one.
    identity
        What results depend on there; why that cannot be said, as a :class:`.Failure`.
    """

    address: str
    identity: Any


@dataclass
class _Process:
    """The process of a thread: whose it is, and the pool that it is alone in."""

    session: str
    pool: Pool[Any]

    def end(self, error: type[BaseException] | None = None) -> None:
        self.pool.__exit__(error, None, None)


@dataclass
class _Processes:
    """The processes of this Dask worker by its threads."""

    by_thread: dict[int, _Process] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def take(self, session: str = "") -> list[_Process]:
        """Forget those of a session, or all, to end them."""
        with self.lock:
            taken = {key: one for key, one in self.by_thread.items() if session in ("", one.session)}
            for key in taken:
                del self.by_thread[key]
        return list(taken.values())


_processes = _Processes()
"""Of this Dask worker, which calls functions and gives them no place to keep anything."""


def answered(packed: bytes) -> bytes:
    """Answer a call of a session, both packed; a :class:`Stranger` where it would be answered otherwise."""
    session, call = pickle.loads(packed)
    found = _process(session)
    return pickle.dumps(found if isinstance(found, Stranger) else _answer(found, call))


def end(session: str) -> None:
    """End the processes of a session, whatever they are at."""
    for process in _processes.take(session):
        process.end(KeyboardInterrupt)


def _process(session: Session) -> _Process | Stranger:
    """The process of this thread; a new one where there is none, or one of an earlier session."""
    thread = threading.get_ident()
    process = _processes.by_thread.get(thread)
    if process is not None and process.session == session.name:
        return process
    if process is not None:
        process.end()
    process = _Process(session.name, Pool(_made, 1))
    with _processes.lock:
        _may_have_children()
        _processes.by_thread[thread] = process
    identity = _answer(process, Call(session.identity, ()))
    if identity == session.expected:
        return process
    for one in _processes.take(session.name):
        one.end()
    from distributed import get_worker

    return Stranger(get_worker().address, identity)


def _answer(process: _Process, call: Call) -> Any:
    limits = {} if call.limit is None else {0: call.limit}
    ((_, answer),) = process.pool.run({0: (call.function, call.arguments)}, limits, again=call.again)
    return answer


def _made(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    return function(*arguments)


def _may_have_children() -> None:
    """Make this Dask worker one that has processes: it is started as one that may have none."""
    current = multiprocessing.current_process()
    if current.daemon:
        current.daemon = False
    for variable in THREAD_VARIABLES:  # pools set them for a moment, and here each thread has one
        os.environ.setdefault(variable, "1")
    if not _finalizers:
        # before the interpreter waits for the children of this process, which wait for it
        _finalizers.append(Finalize(None, _end_all, exitpriority=100))


_finalizers: list[Finalize] = []


def _end_all() -> None:
    for process in _processes.take():
        process.end(KeyboardInterrupt)
