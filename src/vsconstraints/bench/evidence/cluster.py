"""Distribute runs over several machines by the workers of a Dask scheduler.

Each thread of a Dask worker executes its calls in a separate process. A call whose process dies, or
that exceeds its time limit, therefore fails as it does on one machine, and the Dask worker
continues.
"""

from __future__ import annotations

import logging
import math
import multiprocessing
import operator
import os
import pickle
import threading
import time
import uuid
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from multiprocessing.util import Finalize
from queue import Empty, SimpleQueue
from types import SimpleNamespace
from typing import Any, NamedTuple

from ...comparisons.runs.identity import differences, in_words
from ...comparisons.runs.pool import (
    DIED,
    THREAD_VARIABLES,
    Failure,
    Key,
    OpenWorkers,
    Pool,
    unpacked,
)
from ...errors import ConfigurationError, WorkersLost, described
from ...plugins.extras import demand

CONNECT = 5.0  # timeout of the connection to a scheduler [s]
# time limit for workers to start their processes and return their identity [s]
BEGIN = 120.0
PER_THREAD = 3  # calls sent in advance for each thread of the workers
# longest wait for an answer before workers are checked again [s]
CHECK = 1.0
SOON = 0.02  # polling interval for the identity checks at the start [s]
MAX_LOST = 3  # a call fails if more workers than this disappear while they have it
# longest time without any worker [s]: workers that died may be restarted
PATIENCE = 60.0
GOES_ON = "finished runs are stored, and the same command continues"


class Session(NamedTuple):
    """Unique name of a command, function that returns the identity, and its value on this machine.

    The identity is everything that results depend on. Workers call the same function and compare.
    """

    name: str
    identity: Callable[[], Any]
    expected: Any


class IncompatibleWorker(NamedTuple):
    """Worker whose results would differ, with its address and its identity.

    The identity is a :class:`.Failure` if the worker could not determine it.
    """

    address: str
    identity: Any


#: In a Dask worker: session name and single-process pool of each thread, by thread identifier.
_pools: dict[int, tuple[str, Pool[Any]]] = {}
_lock = threading.Lock()
_finalizers: list[Finalize] = []


def answered(packed: bytes) -> bytes:
    """Execute a pickled call of a session and return the pickled answer.

    The first call of a session in a thread compares the identity of this worker with the expected
    one. If they differ, the answer is an :class:`IncompatibleWorker`.
    """
    session, *call = pickle.loads(packed)
    thread = threading.get_ident()
    name, pool = _pools.get(thread, ("", None))
    if pool is None or name != session.name:
        if pool is not None:  # it belongs to an earlier session
            pool.__exit__(None, None, None)
        pool = Pool(operator.call, 1)
        with _lock:
            _may_have_children()
            _pools[thread] = session.name, pool
        identity = _answer(pool, session.identity)
        if identity != session.expected:
            end(session.name)
            from distributed import get_worker

            return pickle.dumps(IncompatibleWorker(get_worker().address, identity))
    return pickle.dumps(_answer(pool, *call))


def end(session: str) -> None:
    """Terminate the processes of a session at once, even during a call.

    An empty name terminates the processes of all sessions.
    """
    ended = []
    with _lock:
        for thread, (name, pool) in list(_pools.items()):
            if session in ("", name):
                del _pools[thread]
                ended.append(pool)
    for pool in ended:
        pool.__exit__(KeyboardInterrupt, None, None)


def _answer(
    pool: Pool[Any],
    function: Callable[..., Any],
    arguments: Any = (),
    limit: float = math.inf,
    again: bool = True,
) -> Any:
    calls = {0: (function, *arguments)}
    ((_, answer),) = pool.run(calls, {0: limit}, again=again)
    return answer


def _may_have_children() -> None:
    if multiprocessing.current_process().daemon:
        multiprocessing.current_process().daemon = False
    # pools set these variables temporarily; with one pool per thread they must stay set
    for variable in THREAD_VARIABLES:
        os.environ.setdefault(variable, "1")
    if not _finalizers:
        # end the child processes before the interpreter waits for them: they wait for this process
        _finalizers.append(Finalize(None, end, ("",), exitpriority=100))


@contextmanager
def cluster(address: str, identity: Callable[[], Any]) -> Iterator[OpenWorkers]:
    """Open the workers of a Dask scheduler for the duration of the ``with`` block.

    Workers store nothing: they send their answers back. If a worker dies, only its current call is
    lost, and another worker repeats it. A worker that joins later takes part if it would give the
    same results. Otherwise a warning is issued, and the worker receives no calls.

    ``identity`` must be picklable. It returns everything that results depend on where it is called,
    as nested tables. Raises ConfigurationError if no scheduler answers at the address, if it has no
    worker, or if one of its workers would give different results. Raises WorkersLost if the
    scheduler or all workers disappear.
    """
    demand("cluster")
    client = _connected(address)
    session = Session(f"vsconstraints-{uuid.uuid4().hex[:12]}", identity, identity())
    try:
        connected = _Cluster(client, address, session)
        connected.require_workers()
        yield lambda function: nullcontext(SimpleNamespace(run=partial(connected.run, function)))
    finally:
        # the cluster may be gone already
        with suppress(Exception), _quiet():
            if client.status == "running":
                client.run(end, session.name, on_error="ignore")
        with suppress(Exception), _quiet():
            client.close(timeout=CONNECT)


class _Cluster:
    """Connection to a scheduler that checks the identity of each worker before sending calls."""

    def __init__(self, client: Any, address: str, session: Session) -> None:
        self._client = client
        self._address = address
        self._session = session
        self._asked: dict[str, tuple[Any, float]] = {}
        self._usable: dict[str, bool] = {}
        self._started = False

    def require_workers(self) -> None:
        """Raise ConfigurationError unless there are workers and all are compatible.

        A worker is compatible if it would give the same results as this machine.
        """
        threads = self._threads()
        while self._asked:
            time.sleep(SOON)
            threads = self._threads()
        if not threads:
            start = f"start one or more on each machine with `dask worker {self._address}`"
            raise ConfigurationError(f"the scheduler at {self._address} has no worker; {start}")
        self._started = True

    def _threads(self) -> dict[str, int]:
        """Return the number of threads of each usable worker.

        Starts the identity check of new workers, and evaluates the checks that have finished.
        """
        connected: dict[str, int] = self._client.nthreads()
        # a new worker may take the address of one that disappeared
        for worker in self._usable.keys() - connected.keys():
            del self._usable[worker]
        known = self._usable.keys() | self._asked.keys()
        for worker in connected.keys() - known:
            future = self._submit(self._packed(str), [worker])
            self._asked[worker] = future, time.monotonic() + BEGIN
        for worker, (future, until) in list(self._asked.items()):
            is_waiting = not future.done() and time.monotonic() <= until
            if worker in connected and is_waiting:
                continue
            del self._asked[worker]
            if worker not in connected:
                asked = "what results depend on there: can vsconstraints be imported there?"
                self._refuse(worker, f"ended when it was asked {asked}")
            elif not future.done():
                self._refuse(worker, f"did not answer for {BEGIN:g} s")
            elif future.exception() is not None:
                # for example, vsconstraints is not installed on the worker
                self._refuse(worker, f"cannot make runs: {described(future.exception())}")
            elif not self._refused_by(unpacked(future.result())):
                self._usable[worker] = True
        threads = {}
        for worker, count in connected.items():
            if self._usable.get(worker):
                threads[worker] = count
        return threads

    def _refused_by(self, answer: Any) -> bool:
        """True if an answer shows that its worker would give different results.

        Such a worker receives no more calls.
        """
        if not isinstance(answer, IncompatibleWorker):
            return False
        if isinstance(answer.identity, Failure):
            self._refuse(answer.address, f"cannot make runs: {answer.identity.reason}")
        else:
            different = differences(answer.identity, self._session.expected)
            what = in_words(list(different))
            why = f"would give other results: {what} (there: the worker). Install the same there"
            self._refuse(answer.address, why)
        return True

    def _refuse(self, worker: str, why: str) -> None:
        self._usable[worker] = False
        if not self._started:
            raise ConfigurationError(f"worker {worker} {why}")
        warnings.warn(f"worker {worker} {why}; it is not used", RuntimeWarning, stacklevel=2)

    def _packed(self, *call: Any) -> bytes:
        return pickle.dumps((self._session, *call))

    def _submit(self, packed: bytes, workers: list[str]) -> Any:
        key = f"{self._session.name}-{uuid.uuid4().hex}"
        return self._client.submit(answered, packed, key=key, pure=False, workers=workers)

    def run(
        self,
        function: Callable[..., Any],
        calls: Mapping[Key, tuple[Any, ...]],
        limits: Mapping[Key, float] | None = None,
        *,
        again: bool = True,
    ) -> Iterator[tuple[Key, Any]]:
        """Execute calls on the workers and yield each key with its answer, see :meth:`.Pool.run`.

        Raises WorkersLost if the scheduler disappears, or if no worker has been usable for
        ``PATIENCE`` seconds.
        """
        from distributed import CancelledError, KilledWorker

        waiting = deque(calls)
        limits = limits or {}
        under_way: dict[Any, tuple[Key, set[str]]] = {}
        lost: Counter[Key] = Counter()
        done: SimpleQueue[Any] = SimpleQueue()
        seen = time.monotonic()
        try:
            while waiting or under_way:
                threads = self._threads()
                if threads or self._asked:
                    seen = time.monotonic()
                elif time.monotonic() - seen > PATIENCE:
                    nobody = f"has had no worker that can be used for {PATIENCE:g} s"
                    raise WorkersLost(f"the scheduler at {self._address} {nobody}; {GOES_ON}")
                for future, (key, workers) in list(under_way.items()):
                    # all workers that could have the call disappeared: send it to the current ones
                    if workers.isdisjoint(threads):
                        del under_way[future]
                        self._cancel([future])
                        lost[key] += 1
                        if lost[key] > MAX_LOST:
                            yield key, Failure(DIED)
                        else:
                            waiting.append(key)
                most = PER_THREAD * sum(threads.values())
                while waiting and len(under_way) < most:
                    key = waiting.popleft()
                    limit = limits.get(key, math.inf)
                    try:
                        packed = self._packed(function, calls[key], limit, again)
                    except Exception as error:  # pickling custom parts can raise anything
                        yield key, Failure.of(error, "it cannot be sent to a worker: ")
                        continue
                    future = self._submit(packed, list(threads))
                    under_way[future] = key, set(threads)
                    future.add_done_callback(done.put)
                with suppress(Empty):
                    future = done.get(timeout=CHECK)
                    if future in under_way:
                        key, _ = under_way.pop(future)
                        raised = future.exception()
                        if raised is not None and not isinstance(raised, KilledWorker):
                            raise WorkersLost(f"a worker cannot make runs: {raised!r}; {GOES_ON}")
                        answer = unpacked(future.result()) if raised is None else Failure(DIED)
                        if self._refused_by(answer):
                            waiting.appendleft(key)
                        else:
                            yield key, answer
        # exceptions of a client whose scheduler disappeared
        except (CancelledError, OSError, RuntimeError) as error:
            gone = f"the scheduler at {self._address} is gone ({type(error).__name__}); {GOES_ON}"
            raise WorkersLost(gone) from error
        finally:
            self._cancel(list(under_way))

    def _cancel(self, futures: list[Any]) -> None:
        if futures:
            with suppress(Exception), _quiet():  # the cluster may be gone
                self._client.cancel(futures)


def _connected(address: str) -> Any:
    from distributed import Client
    from distributed.comm import resolve_address

    try:
        with _quiet():
            resolve_address(address)
            return Client(address, timeout=CONNECT, set_as_default=False, name="vsconstraints")
    # TypeError: TLS without keys
    except (OSError, ValueError, RuntimeError, ImportError, TypeError) as error:
        advice = "say in Dask's configuration where its keys are, see docs/suites.md"
        if not address.startswith("tls:"):
            advice = "start one with `dask scheduler`, and give the address that it prints"
        raise ConfigurationError(
            f"no Dask scheduler answers at {address}: {error}; {advice}"
        ) from error


@contextmanager
def _quiet() -> Iterator[None]:
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
