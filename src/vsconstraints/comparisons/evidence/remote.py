"""The worker side of a cluster: processes that import what is on the disk when the session begins."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import threading
from collections.abc import Callable
from multiprocessing.util import Finalize
from typing import Any, NamedTuple

from ..runs.pool import THREAD_VARIABLES, Pool


class Session(NamedTuple):
    """A command's unique name, what returns what results depend on, and its answer where the command was given."""

    name: str
    identity: Callable[[], Any]
    expected: Any


class Call(NamedTuple):
    """A call, how long it may take [s], and whether it is made once more if its process dies."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    limit: float | None = None
    again: bool = True


class IncompatibleWorker(NamedTuple):
    """A worker whose results would differ, with what they depend on there, or a :class:`.Failure` if unknown."""

    address: str
    identity: Any


#: A pool of a single process, and its session, by the threads of this Dask worker.
_pools: dict[int, tuple[str, Pool[Any]]] = {}

_lock = threading.Lock()
_finalizers: list[Finalize] = []


def answered(packed: bytes) -> bytes:
    """Answer a call of a session, both packed; an :class:`IncompatibleWorker` where the answer would differ."""
    session, call = pickle.loads(packed)
    thread = threading.get_ident()
    name, pool = _pools.get(thread, ("", None))
    if pool is None or name != session.name:
        if pool is not None:  # of an earlier session
            pool.__exit__(None, None, None)
        pool = Pool(_call, 1)
        with _lock:
            _may_have_children()
            _pools[thread] = session.name, pool
        identity = _answer(pool, Call(session.identity, ()))
        if identity != session.expected:
            end(session.name)
            from distributed import get_worker

            return pickle.dumps(IncompatibleWorker(get_worker().address, identity))
    return pickle.dumps(_answer(pool, call))


def end(session: str) -> None:
    """End the processes of a session, or all if it is empty, whatever they are doing."""
    with _lock:
        pools = [_pools.pop(key) for key, (name, _) in list(_pools.items()) if session in ("", name)]
    for _, pool in pools:
        pool.__exit__(KeyboardInterrupt, None, None)


def _answer(pool: Pool[Any], call: Call) -> Any:
    limits = {} if call.limit is None else {0: call.limit}
    ((_, answer),) = pool.run({0: (call.function, call.arguments)}, limits, again=call.again)
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
