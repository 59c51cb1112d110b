"""Runs on more machines than this one, by the workers of a Dask scheduler.

A Dask worker answers each call by a process of its own, one for each of its threads (:mod:`.remote`): a call that ends
its process, or takes too long, fails as it does on one machine, and the Dask worker goes on.
"""

from __future__ import annotations

import logging
import pickle
import time
import uuid
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from queue import Empty, SimpleQueue
from typing import Any

from ...errors import ConfigurationError, WorkersLost, described
from ...plugins.extras import demand
from ..runs.pool import DIED, Failure, Key, OpenWorkers, unpacked
from .campaign import differences, in_words
from .remote import Call, IncompatibleWorker, Session, answered, end

CONNECT = 5.0
"""How long a scheduler may take to answer [s]."""

BEGIN = 120.0
"""How long workers may take to start their processes and answer what results depend on there [s]."""

PER_THREAD = 3
"""Calls that are sent ahead for each thread of the workers."""

CHECK = 1.0
"""How often silent workers are counted [s]."""

SOON = 0.02
"""How often new workers' answers are polled when nothing else goes on [s]."""

MAX_LOST = 3
"""A call that loses more workers than this is taken to be the reason."""

PATIENCE = 60.0
"""How long a cluster may be without any worker [s]: those that died may be started again."""

GOES_ON = "what was finished is stored, and the same command goes on"


@contextmanager
def cluster(address: str, identity: Callable[[], Any]) -> Iterator[OpenWorkers]:
    """The workers of a Dask scheduler, for as long as the ``with`` block lasts.

    Workers store nothing: answers are sent back. A worker that dies loses only its current call, which another one
    gets. One that comes later takes part if it would give the same results; otherwise it gets nothing, with a warning.

    Parameters
    ----------
    address
        Of the scheduler, for example ``tcp://10.0.0.1:8786``.
    identity
        Returns what results depend on where it is called: picklable, its answers are nested tables.

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
        members = _Members(client, session)
        members.demand_compatible(address)
        yield lambda function: nullcontext(_Cluster(client, address, members, function))
    finally:
        with suppress(Exception), _quiet():  # whatever has become of the cluster, this command is done with it
            if client.status == "running":
                client.run(end, session.name, on_error="ignore")
        with suppress(Exception), _quiet():
            client.close(timeout=CONNECT)


class _Members:
    """Workers of a scheduler: addresses of compatible ones, and those of refused ones with the reason."""

    def __init__(self, client: Any, session: Session) -> None:
        self._client, self.session = client, session
        self._there: set[str] = set()
        self.asked: dict[str, tuple[Any, float]] = {}
        self.compatible: set[str] = set()
        self.refused: dict[str, str] = {}

    def threads(self) -> dict[str, int]:
        """Threads of the compatible workers that are there; new workers are asked what results depend on there."""
        there: dict[str, int] = self._client.nthreads()
        for worker in there.keys() - self._there:  # another one may come to the address of one that is gone
            self.compatible.discard(worker)
            self.refused.pop(worker, None)
        self._there = set(there)
        for worker in there.keys() - self.compatible - self.refused.keys() - self.asked.keys():
            future = self.submit(self.packed(Call(str, ())), [worker])
            self.asked[worker] = future, time.monotonic() + BEGIN
        for worker, (future, until) in list(self.asked.items()):
            if worker in there and not future.done() and time.monotonic() <= until:
                continue
            del self.asked[worker]
            if why := self._why_not(worker, future, worker in there):
                self.refused[worker] = why
            else:
                self.compatible.add(worker)
        return {worker: count for worker, count in there.items() if worker in self.compatible}

    def demand_compatible(self, address: str) -> None:
        """Raise ConfigurationError unless there are workers, and all would give the same results as this machine."""
        threads = self.threads()
        while self.asked:
            time.sleep(SOON)
            threads = self.threads()
        for why in self.refused.values():
            raise ConfigurationError(why)
        if not threads:
            start = f"start one or more on each machine with `dask worker {address}`"
            raise ConfigurationError(f"the scheduler at {address} has no worker; {start}")

    def packed(self, call: Call) -> bytes:
        """A call of this session; raises whatever an own part raises when it is pickled."""
        return pickle.dumps((self.session, call))

    def submit(self, packed: bytes, workers: list[str]) -> Any:
        """The future of a call that one of these workers answers."""
        key = f"{self.session.name}-{uuid.uuid4().hex}"
        return self._client.submit(answered, packed, key=key, pure=False, workers=workers)

    def refuse(self, answer: IncompatibleWorker) -> str:
        """Send a worker nothing more, for this reason."""
        self.compatible.discard(answer.address)
        if isinstance(answer.identity, Failure):
            why = f"worker {answer.address} cannot make runs: {answer.identity.reason}"
        else:
            what = in_words(list(differences(answer.identity, self.session.expected)))
            why = (
                f"worker {answer.address} would give other results: {what} (there: the worker). Install the same there"
            )
        self.refused[answer.address] = why
        return why

    def _why_not(self, worker: str, future: Any, there: bool) -> str:
        if not there:
            asked = "what results depend on there: can vsconstraints be imported there?"
            return f"worker {worker} ended when it was asked {asked}"
        if not future.done():
            return f"worker {worker} said nothing for {BEGIN:g} s"
        if (error := future.exception()) is not None:  # for example, this package is not installed there
            return f"worker {worker} cannot make runs: {described(error)}"
        answer = unpacked(future.result())
        return self.refuse(answer) if isinstance(answer, IncompatibleWorker) else ""


class _Cluster:
    """The :class:`.Workers` that call one function on a cluster."""

    def __init__(self, client: Any, address: str, members: _Members, function: Callable[..., Any]) -> None:
        self._client, self._address, self._members, self._function = client, address, members, function
        self._seen = 0.0
        self._warned = set(members.refused.values())

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
                    if workers.isdisjoint(threads):  # all that may have the call are gone: others may have come
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
                        packed = self._members.packed(Call(self._function, calls[key], limits.get(key), again))
                    except Exception as error:  # own parts can raise anything when they are packed
                        yield key, Failure(f"it cannot be sent to a worker: {type(error).__name__}: {error}")
                        continue
                    with self._cluster_may_go():
                        future = self._members.submit(packed, list(threads))
                    under_way[future] = key, set(threads)
                    future.add_done_callback(done.put)
                with suppress(Empty):
                    future = done.get(timeout=CHECK)
                    if future in under_way:
                        key, _ = under_way.pop(future)
                        answer = self._answer(future)
                        if isinstance(answer, IncompatibleWorker):
                            self._members.refuse(answer)
                            waiting.appendleft(key)
                        else:
                            yield key, answer
        finally:
            self._cancel(list(under_way))

    def _cancel(self, futures: list[Any]) -> None:
        if futures:
            with suppress(Exception), _quiet():  # the cluster may be gone
                self._client.cancel(futures)

    def _threads(self) -> dict[str, int]:
        """How many calls each worker can answer at once; raises WorkersLost when there has been nobody for long."""
        with self._cluster_may_go():
            threads = self._members.threads()
        for why in set(self._members.refused.values()) - self._warned:
            self._warned.add(why)
            warnings.warn(f"{why}; it is given nothing", RuntimeWarning, stacklevel=3)
        if threads or self._members.asked:
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
        except (CancelledError, OSError, RuntimeError) as error:  # what a client raises whose scheduler is gone
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
        advice = "say in Dask's configuration where its keys are, see docs/suites.md"
        if not address.startswith("tls:"):
            advice = "start one with `dask scheduler`, and give the address that it prints"
        raise ConfigurationError(f"no Dask scheduler answers at {address}: {error}; {advice}") from error


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
