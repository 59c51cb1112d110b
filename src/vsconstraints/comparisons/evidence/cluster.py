"""Runs on more machines than this one, by the workers of a Dask scheduler.

A Dask worker answers each call by a process of its own, one for each of its threads: a call that
ends its process, or takes too long, fails as it does on one machine, and the Dask worker goes on.
"""

from __future__ import annotations

import logging
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

from ...errors import ConfigurationError, WorkersLost, described
from ...plugins.extras import demand
from ..runs.pool import DIED, THREAD_VARIABLES, Failure, Key, OpenWorkers, Pool, unpacked
from .campaign import differences, in_words

CONNECT = 5.0  # how long a scheduler may take to answer [s]
# how long workers may take to start their processes and answer what results depend on there [s]
BEGIN = 120.0
PER_THREAD = 3  # calls that are sent ahead for each thread of the workers
# how often silent workers are counted, and answers of new ones polled [s]
CHECK = 1.0
SOON = 0.02
MAX_LOST = 3  # a call that loses more workers than this is taken to be the reason
# how long a cluster may be without any worker [s]: those that died may be started again
PATIENCE = 60.0
GOES_ON = "what was finished is stored, and the same command goes on"


class Session(NamedTuple):
    """A command's unique name, what returns what results depend on, and its answer where the
    command was given.
    """

    name: str
    identity: Callable[[], Any]
    expected: Any


class IncompatibleWorker(NamedTuple):
    """A worker whose results would differ, with what they depend on there, or a :class:`.Failure`
    if unknown.
    """

    address: str
    identity: Any


#: In a Dask worker: a pool of a single process, and its session, by its threads.
_pools: dict[int, tuple[str, Pool[Any]]] = {}
_lock = threading.Lock()
_finalizers: list[Finalize] = []


def answered(packed: bytes) -> bytes:
    """Answer a call of a session, both packed; an :class:`IncompatibleWorker` where the answer
    would differ.
    """
    session, *call = pickle.loads(packed)
    thread = threading.get_ident()
    name, pool = _pools.get(thread, ("", None))
    if pool is None or name != session.name:
        if pool is not None:  # of an earlier session
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
    """End the processes of a session, or all if it is empty, whatever they are doing."""
    with _lock:
        pools = [
            _pools.pop(key) for key, (name, _) in list(_pools.items()) if session in ("", name)
        ]
    for _, pool in pools:
        pool.__exit__(KeyboardInterrupt, None, None)


def _answer(
    pool: Pool[Any],
    function: Callable[..., Any],
    arguments: Any = (),
    limit: float | None = None,
    again: bool = True,
) -> Any:
    limits = {} if limit is None else {0: limit}
    ((_, answer),) = pool.run({0: (function, *arguments)}, limits, again=again)
    return answer


def _may_have_children() -> None:
    if multiprocessing.current_process().daemon:
        multiprocessing.current_process().daemon = False
    for variable in THREAD_VARIABLES:  # pools set them for a moment, and here each thread has one
        os.environ.setdefault(variable, "1")
    if not _finalizers:
        # before the interpreter waits for the children of this process, which wait for it
        _finalizers.append(Finalize(None, end, ("",), exitpriority=100))


@contextmanager
def cluster(address: str, identity: Callable[[], Any]) -> Iterator[OpenWorkers]:
    """The workers of a Dask scheduler, for as long as the ``with`` block lasts; they store nothing,
    but send answers.

    A worker that dies loses only its current call, which another one gets. One that comes later
    takes part if it would give the same results; otherwise it gets nothing, with a warning.
    ``identity``, picklable, returns what results depend on where it is called, as nested tables.
    Raises ConfigurationError if no scheduler answers at the address, it has no worker, or one that
    is there would give other results, and WorkersLost if the scheduler or all workers go away.
    """
    demand("cluster")
    client = _connected(address)
    session = Session(f"vsconstraints-{uuid.uuid4().hex[:12]}", identity, identity())
    try:
        connected = _Cluster(client, address, session)
        connected.demand_workers()
        yield lambda function: nullcontext(SimpleNamespace(run=partial(connected.run, function)))
    finally:
        # whatever has become of the cluster, this command is done with it
        with suppress(Exception), _quiet():
            if client.status == "running":
                client.run(end, session.name, on_error="ignore")
        with suppress(Exception), _quiet():
            client.close(timeout=CONNECT)


class _Cluster:
    """Each worker is asked what results depend on there before it is given anything."""

    def __init__(self, client: Any, address: str, session: Session) -> None:
        self._client = client
        self._address = address
        self._session = session
        self._asked: dict[str, tuple[Any, float]] = {}
        self._usable: dict[str, bool] = {}
        self._started = False

    def demand_workers(self) -> None:
        """Raise ConfigurationError unless there are workers, and all would give the same results as
        this machine.
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
        """How many calls each usable worker can answer at once; new workers are asked."""
        there: dict[str, int] = self._client.nthreads()
        # another one may come to the address of one that is gone
        self._usable = {
            worker: usable for worker, usable in self._usable.items() if worker in there
        }
        for worker in there.keys() - self._usable.keys() - self._asked.keys():
            self._asked[worker] = (
                self._submit(self._packed(str), [worker]),
                time.monotonic() + BEGIN,
            )
        for worker, (future, until) in list(self._asked.items()):
            if worker in there and not future.done() and time.monotonic() <= until:
                continue
            del self._asked[worker]
            if worker not in there:
                asked = "what results depend on there: can vsconstraints be imported there?"
                self._refuse(worker, f"ended when it was asked {asked}")
            elif not future.done():
                self._refuse(worker, f"said nothing for {BEGIN:g} s")
            # for example, this package is not installed there
            elif (error := future.exception()) is not None:
                self._refuse(worker, f"cannot make runs: {described(error)}")
            elif not self._refused_by(unpacked(future.result())):
                self._usable[worker] = True
        return {worker: count for worker, count in there.items() if self._usable.get(worker)}

    def _refused_by(self, answer: Any) -> bool:
        """Whether an answer says that a worker would give other results; it gets nothing more
        then.
        """
        if not isinstance(answer, IncompatibleWorker):
            return False
        if isinstance(answer.identity, Failure):
            self._refuse(answer.address, f"cannot make runs: {answer.identity.reason}")
        else:
            what = in_words(list(differences(answer.identity, self._session.expected)))
            why = f"would give other results: {what} (there: the worker). Install the same there"
            self._refuse(answer.address, why)
        return True

    def _refuse(self, worker: str, why: str) -> None:
        self._usable[worker] = False
        if not self._started:
            raise ConfigurationError(f"worker {worker} {why}")
        warnings.warn(f"worker {worker} {why}; it is given nothing", RuntimeWarning, stacklevel=2)

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
        """See :meth:`.Pool.run`; raises WorkersLost when the scheduler is gone, or there has been
        nobody for long.
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
                    # all that may have the call are gone: others may have come
                    if workers.isdisjoint(threads):
                        del under_way[future]
                        self._cancel([future])
                        lost[key] += 1
                        if lost[key] > MAX_LOST:
                            yield key, Failure(DIED)
                        else:
                            waiting.append(key)
                room = PER_THREAD * sum(threads.values()) - len(under_way)
                for key in [waiting.popleft() for _ in range(min(room, len(waiting)))]:
                    try:
                        packed = self._packed(function, calls[key], limits.get(key), again)
                    except Exception as error:  # own parts can raise anything when they are packed
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
        # what a client raises whose scheduler is gone
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
    # of TLS without keys: the last
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
