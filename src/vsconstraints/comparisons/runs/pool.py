"""Calls in worker processes: a failure in one of them affects only its own call."""

from __future__ import annotations

import gc
import math
import multiprocessing
import os
import pickle
import signal
import time
import warnings
from collections import deque
from collections.abc import Callable, Container, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from itertools import chain
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, Protocol, TypeVar

import msgspec

from ...compiled import COMPLAINT
from ...errors import MAX_REASON_LENGTH, VsconstraintsError
from ...plugins import portable
from ...plugins.processes import SIGNALS, Stopwatch, end_with, signals_held
from .machine import process_count

Key = TypeVar("Key", bound=Hashable)
Answer = TypeVar("Answer")

#: Set to 1 in workers: for small matrices, threads only make times noisy and sums dependent on
#: order.
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)

DIED = "the process that ran it died"
CHECK = 1.0  # period at which silent processes are checked [s]
TIME_TO_END = 5.0  # time that idle processes have to end without being killed [s]
# announces to a process that the next message is another function to call
NEXT_FUNCTION = b"function"
MAX_PLAIN_LENGTH = 2**28  # length of a message of code that is not trusted [bytes]
MAX_FAILED_STARTS = 5  # successive processes that may die before they are ready


@dataclass(frozen=True)
class Failure:
    """Reason of a call without answer: an error, the death of its process, or its time limit."""

    reason: str

    @classmethod
    def of(cls, error: BaseException, what: str = "") -> Failure:
        """Build the reason from an exception."""
        return cls(f"{what}{type(error).__name__}: {error}")


class Workers(Protocol):
    """Interface for calling one function elsewhere: a :class:`Pool`, or a cluster."""

    def run(
        self,
        calls: Mapping[Key, tuple[Any, ...]],
        limits: Mapping[Key, float] | None = None,
        *,
        again: bool = True,
    ) -> Iterator[tuple[Key, Any]]:
        """Yield answers with their keys as they arrive.

        A call without answer yields a :class:`Failure`, see :meth:`Pool.run`.
        """


#: Opens workers that call a function of a module while the ``with`` block lasts.
OpenWorkers = Callable[[Callable[..., Any]], AbstractContextManager[Workers]]


class Pool(Generic[Answer]):
    """Worker processes that call one function of a module; they are started when needed.

    A call that raises, or whose answer cannot be sent, is answered by a :class:`Failure`. If a
    process dies, its call is repeated once after all others. A call that takes longer than its
    limit is ended with its process; time during which the process or this one is stopped does not
    count. Processes end with the pool, at once if its block is left by an exception, and with the
    process that started them.

    With ``plain``, the function runs code that is not trusted. Its answers may then contain only
    plain data, such as texts, numbers and bytes, because reading any other data could run code. Its
    processes serve no other pool.
    """

    def __init__(
        self, function: Callable[..., Answer], processes: int, *, plain: bool = False
    ) -> None:
        self._function = function
        self._max_processes = max(1, processes)
        self._plain = plain
        self._workers: list[_Worker] = []
        self._failed_starts = 0

    def __enter__(self) -> Pool[Answer]:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        self.end(at_once=kind is not None)

    def end(self, at_once: bool = False) -> None:
        """End the processes, with ``at_once`` even in the middle of a call."""
        idle = [
            worker for worker in self._workers if worker.ready and not worker.busy and not at_once
        ]
        if _handed_on is not None and not self._plain:
            _handed_on.extend(idle)
            self._workers = [worker for worker in self._workers if worker not in idle]
        _end_all(self._workers, 0.0 if at_once else TIME_TO_END)

    def run(
        self,
        calls: Mapping[Key, tuple[Any, ...]],
        limits: Mapping[Key, float] | None = None,
        *,
        again: bool = True,
    ) -> Iterator[tuple[Key, Answer | Failure]]:
        """Yield answers with their keys as they arrive.

        ``limits`` are the time limits of calls [s]. With ``again``, a call whose process died is
        repeated once. Raises VsconstraintsError if processes cannot be started.
        """
        limits = limits or {}
        waiting = deque(calls)
        suspects = deque[Key]()
        repeated: set[Key] = set() if again else set(calls)
        while waiting or suspects or self._busy():
            if not waiting and not self._busy():
                waiting.append(suspects.popleft())
                repeated.add(waiting[0])
            while len(self._workers) < min(self._max_processes, self._busy() + len(waiting)):
                # listed before its start, so that it ends with the pool even if interrupted
                kept = None if self._plain else _handed_on
                worker = kept.pop() if kept else _Worker(self._plain)
                self._workers.append(worker)
                worker.serve(self._function)
            for worker in self._workers:
                if waiting and worker.ready and not worker.busy:
                    key = waiting.popleft()
                    try:
                        worker.begin(key, pickle.dumps(calls[key]), limits.get(key, math.inf))
                    except Exception as error:  # user code can raise any error in pickling
                        yield key, Failure.of(error, "it cannot be sent to a process: ")
            nearest = min((worker.remaining() for worker in self._workers), default=CHECK)
            wait([worker.connection for worker in self._workers], max(0.0, min(CHECK, nearest)))
            for worker in list(self._workers):
                worker.tick()
                message = worker.receive()
                key = worker.key
                if message is not None:
                    was_ready = worker.ready
                    worker.ready = True
                    worker.busy = False
                    if was_ready:
                        yield key, unpacked_plain(message) if self._plain else unpacked(message)
                    else:  # the first message reports that it is ready
                        self._failed_starts = 0
                elif worker.dead:
                    self._dismiss(worker)
                    if worker.busy and key in repeated:
                        yield key, Failure(DIED)
                    elif worker.busy:
                        suspects.append(key)
                elif worker.remaining() <= 0.0:
                    self._dismiss(worker)
                    yield (
                        key,
                        Failure(
                            f"it took longer than its limit of {worker.limit:g} s and was ended"
                        ),
                    )

    def _busy(self) -> int:
        return sum(worker.busy for worker in self._workers)

    def _dismiss(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.connection.close()
        worker.end(0.0)
        self._failed_starts += not worker.ready
        if self._failed_starts >= MAX_FAILED_STARTS:
            ended = (
                f"{self._failed_starts} processes in a row ended before they were ready, the "
                "last one with"
            )
            needs = (
                "a script that uses several processes needs `if __name__ == '__main__':` around "
                "its statements"
            )
            raise VsconstraintsError(f"{ended} exit code {worker.process.exitcode}; {needs}")


#: Idle processes of earlier pools; None if pools do not share processes.
_handed_on: list[_Worker] | None = None


@contextmanager
def processes_kept() -> Iterator[None]:
    """Let each pool in the block reuse the idle processes of earlier ones.

    Starting a process takes more than a second.
    """
    global _handed_on
    before = _handed_on
    _handed_on = []
    try:
        yield
    finally:
        _end_all(_handed_on, TIME_TO_END)
        _handed_on = before


def _end_all(workers: list[_Worker], patience: float) -> None:
    """End these processes, at the latest after ``patience`` [s]."""
    for worker in workers:
        worker.connection.close()
    deadline = time.monotonic() + patience
    for worker in workers:
        worker.end(max(0.0, deadline - time.monotonic()))
    workers.clear()


def processes(count: int | None = None) -> OpenWorkers:
    """Return an opener for worker processes on this machine.

    Their number is ``count``, or as many as cores and memory allow if None.
    """
    return lambda function: Pool(function, process_count(count))


def run_all(
    function: Callable[..., Answer],
    *batches: Mapping[Key, tuple[Any, ...]],
    workers: int | None = None,
    limits: Mapping[Key, float] | None = None,
    here: Container[Key] = (),
    on_answer: Callable[[Key, Answer | Failure], None] = lambda key, answer: None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[Key, Answer | Failure]:
    """Make calls in a :class:`Pool` of at most ``workers`` processes; return all answers by key.

    Calls of a batch start when all calls of the previous batch are answered. Calls with keys in
    ``here`` are made by this process. ``on_progress`` is called with the number of answered calls
    and the number of all calls.
    """
    answers: dict[Key, Answer | Failure] = {}
    sizes = [len(batch) for batch in batches]
    total = sum(sizes)
    on_progress(0, total)
    most = min(process_count(workers), max(sizes, default=1))
    with Pool(function, most) as pool:
        for batch in batches:
            own = ((key, function(*call)) for key, call in batch.items() if key in here)
            others = {key: call for key, call in batch.items() if key not in here}
            for key, answer in chain(own, pool.run(others, limits)):
                answers[key] = answer
                on_answer(key, answer)
                on_progress(len(answers), total)
    return answers


def unpacked(packed: bytes) -> Any:
    """Return the answer of another process; a :class:`Failure` if it cannot be read."""
    try:
        return pickle.loads(packed)
    except Exception as error:  # user code can raise any error in unpickling
        return Failure.of(error, "the answer cannot be read: ")


def unpacked_plain(packed: bytes) -> Any:
    """Return the answer of ``_packed_plain``: reading it runs no code and makes no objects."""
    try:
        is_answer, content = msgspec.msgpack.decode(packed, type=tuple[bool, Any])
    except Exception as error:  # damaged data can raise any error
        return Failure.of(error, "the answer cannot be read: ")
    return content if is_answer else Failure(str(content)[:MAX_REASON_LENGTH])


def _packed(answer: object) -> bytes:
    return pickle.dumps(answer)


def _packed_plain(answer: object) -> bytes:
    """Encode plain data or a Failure for :func:`unpacked_plain`."""
    if isinstance(answer, Failure):
        reason = answer.reason[:MAX_REASON_LENGTH].encode("utf-8", "replace").decode()
        return msgspec.msgpack.encode((False, reason))
    packed = msgspec.msgpack.encode((True, answer))
    if len(packed) > MAX_PLAIN_LENGTH:
        raise ValueError(f"it is longer than {MAX_PLAIN_LENGTH} bytes")
    return packed


class _Worker:
    def __init__(self, plain: bool = False) -> None:
        # with spawn they start the same way on every system and inherit no threads
        context = multiprocessing.get_context("spawn")
        self.connection, self._theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(self._theirs, os.getpid(), plain))
        self._max_length = MAX_PLAIN_LENGTH if plain else None
        self.key: Any = None
        self.limit = math.inf
        self._stopwatch = Stopwatch()
        self.ready = self.busy = self.dead = False

    def serve(self, function: Callable[..., object]) -> None:
        """Let the worker answer calls of this function; start its process if necessary."""
        if self.process.pid is None:
            # otherwise the first process would start the tracker, which unblocks signals
            resource_tracker.ensure_running()
            with signals_held(), _single_threaded():
                self.process.start()
            self._theirs.close()
        self.ready = False
        self._send(NEXT_FUNCTION)
        self._send(pickle.dumps(function))

    def begin(self, key: Hashable, packed: bytes, limit: float) -> None:
        self.key = key
        self.busy = True
        self.limit = limit
        self._stopwatch.restart()
        self._send(packed)

    def _send(self, packed: bytes) -> None:
        with suppress(OSError):  # if it died, receive() notices
            self.connection.send_bytes(packed)

    def receive(self) -> bytes | None:
        alive = self.process.is_alive()  # first, since messages sent before its death remain
        try:
            if self.connection.poll():
                return self.connection.recv_bytes(self._max_length)
        except (EOFError, OSError):
            alive = False
        self.dead = not alive
        return None

    def tick(self) -> None:
        """Update the elapsed time of the current call."""
        if self.busy:
            self._stopwatch.tick(self.process.pid)

    def remaining(self) -> float:
        return self.limit - self._stopwatch.seconds if self.busy else math.inf

    def end(self, patience: float) -> None:
        if self.process.pid is not None:
            self.process.join(patience)
            self.process.kill()
            self.process.join()


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Set :data:`THREAD_VARIABLES` for processes that start in the block."""
    missing = [variable for variable in THREAD_VARIABLES if variable not in os.environ]
    os.environ.update(dict.fromkeys(missing, "1"))
    try:
        yield
    finally:
        for variable in missing:
            del os.environ[variable]


def _serve(connection: Connection, parent: int, plain: bool) -> None:
    """Serve calls in a worker until the connection closes.

    The worker receives functions, which it confirms, and tuples of arguments, which it answers.
    With ``plain``, answers are plain data only.
    """
    end_with(parent)
    warnings.filterwarnings("ignore", COMPLAINT, RuntimeWarning)  # the pool's process warns
    # Ctrl-C reaches all processes of a terminal; the pool's process handles it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    portable.unblock(SIGNALS)
    with suppress(EOFError, OSError):  # the pool is gone
        while True:
            message = connection.recv_bytes()
            if message == NEXT_FUNCTION:
                function = connection.recv()
                # objects loaded so far are permanent: checking them takes a twentieth of a call
                gc.freeze()
                connection.send(None)
            else:
                connection.send_bytes(
                    _answer(function, message, _packed_plain if plain else _packed)
                )
    gc.freeze()  # the exit of the interpreter would check all objects several times


def _answer(
    function: Callable[..., object], packed: bytes, pack: Callable[[object], bytes]
) -> bytes:
    try:
        answer = function(*pickle.loads(packed))
    # even SystemExit: a failure of one call must not end the others
    except BaseException as error:
        answer = Failure.of(error)
    try:
        return pack(answer)
    except Exception as error:  # user code can raise any error in pickling
        return pack(Failure.of(error, "the answer cannot be sent: "))
