"""Calls in processes of their own: what happens to one of them costs only its own call."""

from __future__ import annotations

import gc
import io
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

from ...compiled import COMPLAINT
from ...errors import VsconstraintsError
from ...plugins import portable
from ...plugins.processes import SIGNALS, Stopwatch, end_with, signals_held
from .machine import process_count

Key = TypeVar("Key", bound=Hashable)
Answer = TypeVar("Answer")

#: Set to 1 in workers: matrices are small, threads would only make times noisy and sums
#: order-dependent.
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)

DIED = "the process that ran it died"
CHECK = 1.0  # how often silent processes are checked [s]
PATIENCE = 5.0  # how long processes may take to end by themselves when nothing is left to do [s]
# what is sent to a process before another function than it has called until then
NEXT_FUNCTION = b"function"
MAX_FAILED_STARTS = 5  # processes in a row that may die before they are ready


@dataclass(frozen=True)
class Failure:
    """Why a call has no answer: what it raised, that its process died, or that it took too long."""

    reason: str

    @classmethod
    def of(cls, error: BaseException, what: str = "") -> Failure:
        """From what was raised."""
        return cls(f"{what}{type(error).__name__}: {error}")


class Workers(Protocol):
    """What calls one function elsewhere: a :class:`Pool`, or a cluster."""

    def run(
        self,
        calls: Mapping[Key, tuple[Any, ...]],
        limits: Mapping[Key, float] | None = None,
        *,
        again: bool = True,
    ) -> Iterator[tuple[Key, Any]]:
        """Answers as they come, with their keys, a :class:`Failure` where there is none: see
        :meth:`Pool.run`.
        """


#: From a function of a module to the workers that call it, for as long as the ``with`` block lasts.
OpenWorkers = Callable[[Callable[..., Any]], AbstractContextManager[Workers]]


class Pool(Generic[Answer]):
    """Calls one function of a module in several processes, which are started when they are needed.

    A call that raises, or whose answer cannot be sent, is answered by a :class:`Failure`. If a
    process dies, its call is made once more when all others are done. A call that takes longer than
    its limit is ended with its process; time during which the process or this one is stopped does
    not count. Processes end with the pool, at once if its block is left by an exception, and with
    the process that started them.

    With ``plain``, the function runs code that is not trusted: its answers may hold plain data
    alone, such as texts, numbers and bytes, since anything else could run code where it is read,
    and its processes serve no other pool.
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
        idle = [
            worker
            for worker in self._workers
            if worker.ready and worker.key is None and kind is None
        ]
        if _handed_on is not None and not self._plain:
            _handed_on.extend(idle)
            self._workers = [worker for worker in self._workers if worker not in idle]
        _end_all(self._workers, PATIENCE if kind is None else 0.0)

    def run(
        self,
        calls: Mapping[Key, tuple[Any, ...]],
        limits: Mapping[Key, float] | None = None,
        *,
        again: bool = True,
    ) -> Iterator[tuple[Key, Answer | Failure]]:
        """Answers as they come, with their keys; raises VsconstraintsError if processes cannot be
        started.

        ``limits`` say how long calls may take [s]; ``again`` whether a call whose process died is
        made once more.
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
                # listed before it starts: it ends with the pool even if its start is interrupted
                self._workers.append(
                    worker := _handed_on.pop() if _handed_on and not self._plain else _Worker()
                )
                worker.serve(self._function)
            for worker in self._workers:
                if waiting and worker.ready and worker.key is None:
                    key = waiting.popleft()
                    try:
                        worker.begin(key, pickle.dumps(calls[key]), limits.get(key, math.inf))
                    except Exception as error:  # user code can raise anything when it is pickled
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
                    worker.key = None
                    if was_ready:
                        yield key, unpacked_plain(message) if self._plain else unpacked(message)
                    else:  # the first message says that it is ready
                        self._failed_starts = 0
                elif worker.dead:
                    self._dismiss(worker)
                    if key in repeated:
                        yield key, Failure(DIED)
                    elif key is not None:
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
        return sum(worker.key is not None for worker in self._workers)

    def _dismiss(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.connection.close()
        worker.end(0.0)
        self._failed_starts += not worker.ready
        if self._failed_starts >= MAX_FAILED_STARTS:
            ended = (
                f"{self._failed_starts} processes in a row ended before they were ready, the "
                f"last one with"
            )
            needs = (
                "a script that uses several needs `if __name__ == '__main__':` around what it does"
            )
            raise VsconstraintsError(f"{ended} exit code {worker.process.exitcode}; {needs}")


#: Idle processes of pools before; None where each has its own.
_handed_on: list[_Worker] | None = None


@contextmanager
def processes_kept() -> Iterator[None]:
    """Let each pool in the block take over the idle processes of the one before: starting one takes
    over a second.
    """
    global _handed_on
    before = _handed_on
    _handed_on = []
    try:
        yield
    finally:
        _end_all(_handed_on, PATIENCE)
        _handed_on = before


def _end_all(workers: list[_Worker], patience: float) -> None:
    """End these processes, at the latest after so long [s]."""
    for worker in workers:
        worker.connection.close()
    deadline = time.monotonic() + patience
    for worker in workers:
        worker.end(max(0.0, deadline - time.monotonic()))
    workers.clear()


def processes(count: int | None = None) -> OpenWorkers:
    """Processes of this machine, as many as requested, or as there are cores and memory for."""
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
    """Make calls in a :class:`Pool` of at most so many ``workers``, and return all answers by their
    keys.

    Calls of a batch are started when all of the one before are answered; those ``here`` are made by
    this process. ``on_progress`` is called with the numbers of calls that are answered and that
    there are.
    """
    answers: dict[Key, Answer | Failure] = {}
    total = sum(map(len, batches))
    on_progress(0, total)
    with Pool(function, min(process_count(workers), max(map(len, batches), default=1))) as pool:
        for batch in batches:
            own = ((key, function(*call)) for key, call in batch.items() if key in here)
            others = {key: call for key, call in batch.items() if key not in here}
            for key, answer in chain(own, pool.run(others, limits)):
                answers[key] = answer
                on_answer(key, answer)
                on_progress(len(answers), total)
    return answers


def unpacked(packed: bytes) -> Any:
    """The answer of another process; a :class:`Failure` if it cannot be read."""
    try:
        return pickle.loads(packed)
    except Exception as error:  # user code can raise anything when it is unpickled
        return Failure.of(error, "the answer cannot be read: ")


class _PlainUnpickler(pickle.Unpickler):
    """Reads data that holds nothing but texts, numbers, bytes, and lists and tables of these, or a
    Failure.

    Pickled data names classes and functions, which ``find_class`` looks up: here it finds no other.
    """

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == (Failure.__module__, Failure.__name__):
            return Failure
        raise pickle.UnpicklingError(f"{module}.{name} is no plain data")


def unpacked_plain(packed: bytes) -> Any:
    """As :func:`unpacked`, but only of plain data: no code is run to read it."""
    try:
        return _PlainUnpickler(io.BytesIO(packed)).load()
    except Exception as error:  # damaged data can raise anything
        return Failure.of(error, "the answer cannot be read: ")


class _Worker:
    def __init__(self) -> None:
        # they start alike on every system and inherit no threads
        context = multiprocessing.get_context("spawn")
        self.connection, self._theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(self._theirs, os.getpid()))
        self.key: Any = None
        self.limit = math.inf
        self._stopwatch = Stopwatch()
        self.ready = self.dead = False

    def serve(self, function: Callable[..., object]) -> None:
        """Let it answer calls of this function; where it has not started yet, start it."""
        if self.process.pid is None:
            # else the first process starts it, and it lets signals through again
            resource_tracker.ensure_running()
            with signals_held(), _single_threaded():
                self.process.start()
            self._theirs.close()
        self.ready = False
        self._send(NEXT_FUNCTION)
        self._send(pickle.dumps(function))

    def begin(self, key: Hashable, packed: bytes, limit: float) -> None:
        self.key = key
        self.limit = limit
        self._stopwatch.restart()
        self._send(packed)

    def _send(self, packed: bytes) -> None:
        with suppress(OSError):  # it died: receive() notices
            self.connection.send_bytes(packed)

    def receive(self) -> bytes | None:
        alive = self.process.is_alive()  # first: what it sent before it died is still there
        try:
            if self.connection.poll():
                return self.connection.recv_bytes()
        except (EOFError, OSError):
            alive = False
        self.dead = not alive
        return None

    def tick(self) -> None:
        """Count the time of the call that it is at."""
        if self.key is not None:
            self._stopwatch.tick(self.process.pid)

    def remaining(self) -> float:
        return math.inf if self.key is None else self.limit - self._stopwatch.seconds

    def end(self, patience: float) -> None:
        if self.process.pid is not None:
            self.process.join(patience)
            self.process.kill()
            self.process.join()


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Set :data:`THREAD_VARIABLES` for processes that start meanwhile."""
    missing = [variable for variable in THREAD_VARIABLES if variable not in os.environ]
    os.environ.update(dict.fromkeys(missing, "1"))
    try:
        yield
    finally:
        for variable in missing:
            del os.environ[variable]


def _serve(connection: Connection, parent: int) -> None:
    """In a worker: receive functions, which it confirms, and answer tuples of arguments until the
    connection closes.
    """
    end_with(parent)
    warnings.filterwarnings("ignore", COMPLAINT, RuntimeWarning)  # the pool's process says it
    # the pool handles it: Ctrl-C reaches all processes of a terminal
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    portable.unblock(SIGNALS)
    with suppress(EOFError, OSError):  # the pool is gone
        while True:
            message = connection.recv_bytes()
            if message == NEXT_FUNCTION:
                function = connection.recv()
                # what is loaded by now is no garbage: looking for it takes a twentieth of a call
                gc.freeze()
                connection.send(None)
            else:
                connection.send_bytes(_answer(function, message))
    gc.freeze()  # nor at the end, which looks for it several times


def _answer(function: Callable[..., object], packed: bytes) -> bytes:
    try:
        answer = function(*pickle.loads(packed))
    # even SystemExit: this is where one call ends and the others begin
    except BaseException as error:
        answer = Failure.of(error)
    try:
        return pickle.dumps(answer)
    except Exception as error:  # user code can raise anything when it is pickled
        return pickle.dumps(Failure.of(error, "the answer cannot be sent: "))
