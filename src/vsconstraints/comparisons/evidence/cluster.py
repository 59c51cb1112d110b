"""Runs made on more machines than this one: by the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import multiprocessing
import os
import pickle
import threading
import time
import uuid
import warnings
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from multiprocessing.util import Finalize
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from ...errors import ConfigurationError, WorkersLost, described
from ...plugins.extras import demand
from ..runs.pool import DIED, THREAD_VARIABLES, Failure, OpenWorkers, Pool, Workers, unpacked
from .campaign import differences, in_words


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


Key = TypeVar("Key", bound=Hashable)

CONNECT = 5.0
"""How long a scheduler may take to answer [s]."""

BEGIN = 120.0
"""How long workers may take to start their processes and say what results depend on there [s]."""

PER_THREAD = 3
"""Calls that are sent ahead for each thread of the workers: there is always a next one, and never all of them."""

CHECK = 1.0
"""How often workers are counted that say nothing [s]."""

SOON = 0.02
"""How often it is looked whether workers have said that they give the same results, when nothing else goes on [s]."""

MOST_LOST = 3
"""So often a call may lose all workers that it was sent to, before it is taken to be the reason."""

PATIENCE = 60.0
"""How long a cluster may be without any worker [s]: those that died may be started again."""

GOES_ON = "what was finished is stored, and the same command goes on"


@contextmanager
def cluster(address: str, identity: Callable[[], Any]) -> Iterator[OpenWorkers]:
    """The workers of a Dask scheduler, for as long as the ``with`` block lasts.

    Nothing is stored by workers: what calls come to is sent back. A worker that dies loses only what it was at, which
    another one is given. One that comes later takes part if it would give the same results; else it is given nothing,
    and a warning says so.

    Parameters
    ----------
    address
        Of the scheduler, for example ``tcp://10.0.0.1:8786``.
    identity
        Says what results depend on, on whichever machine it is called: it is picklable, and its answers are nested
        tables.

    Raises
    ------
    ConfigurationError
        if no scheduler answers there, it has no worker, or one of those that are there would give other results.
    WorkersLost
        if the scheduler or all workers go away.
    """
    demand("cluster")
    client = _connected(address)
    session = Session(f"vsconstraints-{uuid.uuid4().hex[:12]}", identity, identity())
    try:
        known = _Known(client, session)
        _demand_alike(known, address)

        def opened(function: Callable[..., Any]) -> AbstractContextManager[Workers]:
            return nullcontext(_Cluster(client, address, known, function))

        yield opened
    finally:
        with suppress(Exception), _quiet():  # whatever has become of the cluster, this command is done with it
            if client.status == "running":
                client.run(end, session.name, on_error="ignore")
        with suppress(Exception), _quiet():
            client.close(timeout=CONNECT)


class _Known:
    """Which workers of a scheduler may be given calls: those that have said that they give the same results.

    Attributes
    ----------
    alike
        Addresses of those that may.
    refused
        Addresses of the others, and why.
    session
        Of this command.
    """

    def __init__(self, client: Any, session: Session) -> None:
        self._client, self.session = client, session
        self._asked: dict[str, tuple[Any, float]] = {}
        self._there: set[str] = set()
        self.alike: set[str] = set()
        self.refused: dict[str, str] = {}

    def threads(self) -> dict[str, int]:
        """Threads of the workers that are there and may be given calls; others are asked, and their answers heard."""
        there: dict[str, int] = self._client.nthreads()
        for worker in there.keys() - self._there:  # another one may come to the address of one that is gone
            self.alike.discard(worker)
            self.refused.pop(worker, None)
        self._there = set(there)
        for worker in there.keys() - self.alike - self.refused.keys() - self._asked.keys():
            packed, key = pickle.dumps((self.session, Call(str, ()))), f"{self.session.name}-{uuid.uuid4().hex}"
            future = self._client.submit(answered, packed, key=key, pure=False, workers=[worker])
            self._asked[worker] = future, time.monotonic() + BEGIN
        for worker, (future, until) in list(self._asked.items()):
            if worker not in there:
                del self._asked[worker]
                self.refused[worker] = (
                    f"worker {worker} ended when it was asked what results depend on there: can vsconstraints be "
                    "imported there?"
                )
            elif future.done() or time.monotonic() > until:
                del self._asked[worker]
                why = self._why_not(worker, future)
                if why:
                    self.refused[worker] = why
                else:
                    self.alike.add(worker)
        return {worker: count for worker, count in there.items() if worker in self.alike}

    @property
    def waiting(self) -> bool:
        """Whether workers have not yet answered."""
        return bool(self._asked)

    def refuse(self, found: Stranger) -> None:
        """Give a worker nothing more, which has answered otherwise meanwhile."""
        self.alike.discard(found.address)
        self.refused[found.address] = self._described(found)

    def _why_not(self, worker: str, future: Any) -> str:
        if not future.done():
            return f"worker {worker} said nothing for {BEGIN:g} s"
        error = future.exception()
        if error is not None:  # whatever went wrong there: for example, nothing of this package is installed
            return f"worker {worker} cannot make runs: {described(error)}"
        answer = unpacked(future.result())
        return self._described(answer) if isinstance(answer, Stranger) else ""

    def _described(self, found: Stranger) -> str:
        if isinstance(found.identity, Failure):
            return f"worker {found.address} cannot make runs: {found.identity.reason}"
        what = in_words(list(differences(found.identity, self.session.expected)))
        return f"worker {found.address} would give other results: {what} (there: the worker). Install the same there"


class _Cluster:
    """Workers that are there."""

    def __init__(self, client: Any, address: str, known: _Known, function: Callable[..., Any]) -> None:
        self._client, self._address, self._known, self._function = client, address, known, function
        self._seen = 0.0
        self._told = set(known.refused.values())

    def run(
        self, calls: Mapping[Key, tuple[Any, ...]], limits: Mapping[Key, float] | None = None, *, again: bool = True
    ) -> Iterator[tuple[Key, Any]]:
        waiting, limits = deque(calls), limits or {}
        under_way: dict[Any, tuple[Key, set[str]]] = {}
        lost: Counter[Key] = Counter()
        done: SimpleQueue[Any] = SimpleQueue()
        self._seen = time.monotonic()
        try:
            while waiting or under_way:
                threads = self._threads()
                for future, (key, workers) in list(under_way.items()):
                    if workers.isdisjoint(threads):  # those that may have the call are all gone: others may have come
                        del under_way[future]
                        self._cancel([future])
                        lost[key] += 1
                        if lost[key] > MOST_LOST:
                            yield key, Failure(DIED)
                        else:
                            waiting.append(key)
                room = PER_THREAD * sum(threads.values()) - len(under_way)
                for key in [waiting.popleft() for _ in range(min(room, len(waiting)))]:
                    call = Call(self._function, calls[key], limits.get(key), again)
                    try:
                        packed = pickle.dumps((self._known.session, call))
                    except Exception as error:  # own parts can raise anything when they are packed
                        yield key, Failure(f"it cannot be sent to a worker: {type(error).__name__}: {error}")
                        continue
                    future = self._submit(packed, list(threads))
                    under_way[future] = key, set(threads)
                    future.add_done_callback(done.put)
                with suppress(Empty):
                    future = done.get(timeout=CHECK)
                    if future in under_way:
                        key, _ = under_way.pop(future)
                        answer = self._answer(future)
                        if isinstance(answer, Stranger):
                            self._known.refuse(answer)
                            waiting.appendleft(key)
                        else:
                            yield key, answer
        finally:
            self._cancel(list(under_way))

    def _cancel(self, futures: list[Any]) -> None:
        if futures:
            with suppress(Exception), _quiet():  # the cluster may be gone
                self._client.cancel(futures)

    def _submit(self, packed: bytes, workers: list[str]) -> Any:
        key = f"{self._known.session.name}-{uuid.uuid4().hex}"
        with self._cluster_may_go():
            return self._client.submit(answered, packed, key=key, pure=False, workers=workers)

    def _threads(self) -> dict[str, int]:
        """How many calls each worker can answer at once; raises WorkersLost when there has been nobody for long."""
        with self._cluster_may_go():
            threads = self._known.threads()
        for why in set(self._known.refused.values()) - self._told:
            self._told.add(why)
            warnings.warn(f"{why}; it is given nothing", RuntimeWarning, stacklevel=3)
        if threads or self._known.waiting:
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > PATIENCE:
            raise WorkersLost(
                f"the scheduler at {self._address} has had no worker that can be used for {PATIENCE:g} s; {GOES_ON}"
            )
        return threads

    def _answer(self, future: Any) -> Any:
        from distributed import KilledWorker

        with self._cluster_may_go():
            error = future.exception()
            packed = b"" if error is not None else future.result()
        if isinstance(error, KilledWorker):
            return Failure(DIED)
        if error is not None:
            raise WorkersLost(f"a worker cannot make runs: {error!r}; {GOES_ON}")
        return unpacked(packed)

    @contextmanager
    def _cluster_may_go(self) -> Iterator[None]:
        from distributed import CancelledError

        try:
            yield
        except (CancelledError, OSError, RuntimeError) as error:  # what a client says whose scheduler is gone
            raise WorkersLost(
                f"the scheduler at {self._address} is gone ({type(error).__name__}); {GOES_ON}"
            ) from error


def _connected(address: str) -> Any:
    from distributed import Client
    from distributed.comm import resolve_address

    try:
        with _quiet():
            resolve_address(address)
            return Client(address, timeout=CONNECT, set_as_default=False, name="vsconstraints")
    except (OSError, ValueError, RuntimeError, ImportError, TypeError) as error:  # of TLS without keys: the last
        advice = "say in Dask's configuration where its keys are, see docs/clusters.md"
        if not address.startswith("tls:"):
            advice = "start one with `dask scheduler`, and give the address that it prints"
        raise ConfigurationError(f"no Dask scheduler answers at {address}: {error}; {advice}") from error


def _demand_alike(known: _Known, address: str) -> None:
    """Raise ConfigurationError unless there are workers, and all would give the same results as this machine."""
    found = known.threads()
    while known.waiting:
        time.sleep(SOON)
        found = known.threads()
    for why in known.refused.values():
        raise ConfigurationError(why)
    if not found:
        raise ConfigurationError(
            f"the scheduler at {address} has no worker; start one or more on each machine with `dask worker {address}`"
        )


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what distributed logs of a scheduler that is not there: the error says it."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
