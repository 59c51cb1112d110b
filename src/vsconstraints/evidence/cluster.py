"""Runs made on more machines than this one: by the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import pickle
import time
import uuid
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from ..errors import ConfigurationError, WorkersLost, described
from ..extras import demand
from ..runs.pool import DIED, Failure, unpacked
from .identity import differences, in_words
from .remote import Call, Session, Stranger, answered, end
from .workers import OpenWorkers, Workers

Key = TypeVar("Key", bound=Hashable)

CONNECT = 5.0
"""How long a scheduler may take to answer [s]."""

BEGIN = 120.0
"""How long workers may take to start their processes and say what results depend on there [s]."""

PER_THREAD = 3
"""Calls that are sent ahead for each thread of the workers: there is always a next one, and never all of them."""

CHECK = 1.0
"""How often workers are counted that say nothing [s]."""

PATIENCE = 60.0
"""How long a cluster may be without any worker [s]: those that died may be started again."""

GOES_ON = "what was finished is stored, and the same command goes on"


@contextmanager
def cluster(address: str, identity: Callable[[], Any]) -> Iterator[OpenWorkers]:
    """The workers of a Dask scheduler, for as long as the ``with`` block lasts.

    Nothing is stored by workers: what calls come to is sent back. A worker that dies loses only what it was at, which
    another one is given; one that comes later takes part.

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
        if no scheduler answers there, it has no worker, or one of its workers would give other results.
    WorkersLost
        if the scheduler or all workers go away.
    """
    demand("cluster")
    client = _connected(address)
    session = Session(f"vsconstraints-{uuid.uuid4().hex[:12]}", identity, identity())
    try:
        _demand_alike(client, address, session)

        def opened(function: Callable[..., Any]) -> AbstractContextManager[Workers]:
            return nullcontext(_Cluster(client, address, session, function))

        yield opened
    finally:
        with suppress(Exception), _quiet():  # whatever has become of the cluster, this command is done with it
            if client.status == "running":
                client.run(end, session.name, on_error="ignore")
        with suppress(Exception), _quiet():
            client.close(timeout=CONNECT)


class _Cluster:
    """Workers that are there."""

    def __init__(self, client: Any, address: str, session: Session, function: Callable[..., Any]) -> None:
        self._client, self._address, self._session, self._function = client, address, session, function
        self._seen = 0.0

    def run(
        self, calls: Mapping[Key, tuple[Any, ...]], limits: Mapping[Key, float] | None = None, *, again: bool = True
    ) -> Iterator[tuple[Key, Any]]:
        waiting, limits = deque(calls), limits or {}
        under_way: dict[Any, Key] = {}
        done: SimpleQueue[Any] = SimpleQueue()
        self._seen = time.monotonic()
        try:
            while waiting or under_way:
                room = PER_THREAD * self._threads() - len(under_way)
                for key in [waiting.popleft() for _ in range(min(room, len(waiting)))]:
                    call = Call(self._function, calls[key], limits.get(key), again)
                    try:
                        packed = pickle.dumps((self._session, call))
                    except Exception as error:  # own parts can raise anything when they are packed
                        yield key, Failure(f"it cannot be sent to a worker: {type(error).__name__}: {error}")
                        continue
                    future = self._submit(packed)
                    under_way[future] = key
                    future.add_done_callback(done.put)
                with suppress(Empty):
                    future = done.get(timeout=CHECK)
                    yield under_way.pop(future), self._answer(future)
        finally:
            if under_way:
                with suppress(Exception), _quiet():  # the cluster may be gone
                    self._client.cancel(list(under_way))

    def _submit(self, packed: bytes) -> Any:
        key = f"{self._session.name}-{uuid.uuid4().hex}"
        with self._cluster_may_go():
            return self._client.submit(answered, packed, key=key, pure=False)

    def _threads(self) -> int:
        """How many calls can be answered at once; raises WorkersLost when there has been nobody for long."""
        with self._cluster_may_go():
            threads = sum(map(int, self._client.nthreads().values()))
        if threads:
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > PATIENCE:
            raise WorkersLost(f"the scheduler at {self._address} has had no worker for {PATIENCE:g} s; {GOES_ON}")
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
        answer = unpacked(packed)
        if isinstance(answer, Stranger):
            raise _stranger(answer, self._session)
        return answer

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
    except (OSError, ValueError, ImportError) as error:  # ImportError: of the packages of a protocol
        raise ConfigurationError(
            f"no Dask scheduler answers at {address}: {error}; start one with `dask scheduler`, and give the address "
            "that it prints"
        ) from error


def _demand_alike(client: Any, address: str, session: Session) -> None:
    """Raise ConfigurationError unless there are workers, and all would give the same results as this machine."""
    workers = list(client.nthreads())
    if not workers:
        raise ConfigurationError(
            f"the scheduler at {address} has no worker; start one or more on each machine with `dask worker {address}`"
        )
    packed = pickle.dumps((session, Call(str, ())))
    checks = {
        worker: client.submit(answered, packed, key=f"{session.name}-{i}", pure=False, workers=[worker])
        for i, worker in enumerate(workers)
    }
    deadline = time.monotonic() + BEGIN
    for worker, future in checks.items():
        try:
            answer = unpacked(future.result(timeout=max(0.0, deadline - time.monotonic())))
        except TimeoutError:
            raise ConfigurationError(f"worker {worker} said nothing for {BEGIN:g} s") from None
        except Exception as error:  # whatever went wrong there
            raise ConfigurationError(f"worker {worker} cannot make runs: {described(error)}") from error
        if isinstance(answer, Stranger):
            raise _stranger(answer, session)


def _stranger(found: Stranger, session: Session) -> ConfigurationError:
    if isinstance(found.identity, Failure):
        return ConfigurationError(f"worker {found.address} cannot make runs: {found.identity.reason}")
    what = in_words(list(differences(found.identity, session.expected)))
    return ConfigurationError(
        f"worker {found.address} would give other results: {what} (there: the worker). Install the same there"
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
