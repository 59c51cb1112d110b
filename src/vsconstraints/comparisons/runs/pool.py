"""Calls in processes of their own: what happens to one of them costs only its own call."""

from __future__ import annotations

import ctypes
import math
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Any, Generic, Protocol, TypeVar

from ...compiled import COMPLAINT
from ...errors import VsconstraintsError
from .machine import process_count
from .signals import SIGNALS, signals_held

PR_SET_PDEATHSIG = 1
"""Of Linux' prctl: the signal that a process gets when its parent ends."""


@dataclass(frozen=True)
class Failure:
    """Why a call has no answer: what it raised, that its process died, or that it took too long."""

    reason: str


def serve(connection: Connection, parent: int) -> None:
    """Receive a function, say that it is there, then answer each tuple of arguments, until the connection closes.

    Parameters
    ----------
    connection
        To the pool.
    parent
        Identifies the process of the pool.
    """
    end_with(parent)
    warnings.filterwarnings("ignore", COMPLAINT, RuntimeWarning)  # the pool's process says it
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the pool's to handle: Ctrl-C reaches all processes of a terminal
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    with suppress(EOFError, OSError):  # the pool is gone
        function = connection.recv()
        connection.send(None)
        while True:
            _send(connection, _answer(function, connection.recv_bytes()))


def _answer(function: Callable[..., object], packed: bytes) -> object:
    try:
        return function(*pickle.loads(packed))
    except BaseException as error:  # even SystemExit: this is where one call ends and the others begin
        return Failure(f"{type(error).__name__}: {error}")


def _send(connection: Connection, answer: object) -> None:
    try:
        packed = pickle.dumps(answer)
    except Exception as error:  # own parts can raise anything when they are packed
        packed = pickle.dumps(Failure(f"the answer cannot be sent: {type(error).__name__}: {error}"))
    connection.send_bytes(packed)


def end_with(parent: int) -> None:
    """End this process when its parent ends, whatever ends that.

    Parameters
    ----------
    parent
        Identifies the process that started this one.
    """
    if sys.platform == "linux":
        with suppress(AttributeError, OSError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
    # elsewhere, and where the system call is not allowed; waits as long as compiled code keeps the interpreter busy
    starter = multiprocessing.parent_process()
    if starter is not None:
        threading.Thread(target=_end_after, args=(starter,), daemon=True).start()


def _end_after(starter: multiprocessing.process.BaseProcess) -> None:
    starter.join()
    os._exit(1)


__all__ = ["Failure", "Pool", "carry_out"]

Key = TypeVar("Key", bound=Hashable)
Answer = TypeVar("Answer")

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Set to 1 in workers: matrices are small, threads would only make times noisy and sums order-dependent."""

DIED = "the process that ran it died"

CHECK = 1.0
"""How often processes that say nothing are checked [s]."""

PATIENCE = 5.0
"""How long processes may take to end by themselves when there is nothing left to do [s]."""

MOST_STARTS = 5
"""So many processes in a row may die before they are ready."""


class Pool(Generic[Answer]):
    """Answers calls of one function in several processes.

    A call that raises, or whose answer cannot be sent, is answered by a :class:`Failure` with the reason. If a process
    dies, the call it was answering is made once more when all others are done and with nothing beside it; another
    process takes over the others. A call that takes longer than its limit is ended with its process.

    Processes end with the pool, at once if the ``with`` block is left by an exception, and with the process that
    made them, whatever ends that one.

    Parameters
    ----------
    function
        What is called; a function of a module, so that other processes can import it.
    processes
        How many there are at most; they are started as they are needed.
    """

    def __init__(self, function: Callable[..., Answer], processes: int) -> None:
        self._function = function
        self._most = max(1, processes)
        self._workers: list[_Worker] = []
        self._failed_starts = 0

    def __enter__(self) -> Pool[Answer]:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for worker in self._workers:
            worker.connection.close()
        patience = time.monotonic() + (PATIENCE if kind is None else 0.0)
        for worker in self._workers:
            worker.end(max(0.0, patience - time.monotonic()))
        self._workers.clear()

    def run(
        self, calls: Mapping[Key, tuple[Any, ...]], limits: Mapping[Key, float] | None = None, *, again: bool = True
    ) -> Iterator[tuple[Key, Answer | Failure]]:
        """Answers as they come, with their keys.

        Parameters
        ----------
        calls
            The function's arguments; the first are begun first.
        limits
            How long a call may take [s]; as long as it likes if it is not there.
        again
            Whether a call whose process died is made once more.

        Raises
        ------
        VsconstraintsError
            if processes cannot be started.
        """
        limits = limits or {}
        waiting, suspects = deque(calls), deque[Key]()
        repeated: set[Key] = set() if again else set(calls)
        while waiting or suspects or self._busy():
            if not waiting and not self._busy():
                waiting.append(suspects.popleft())
                repeated.add(waiting[0])
            self._employ(len(waiting))
            for worker in self._workers:
                if waiting and worker.ready and worker.key is None:
                    key = waiting.popleft()
                    try:
                        worker.begin(key, pickle.dumps(calls[key]), limits.get(key, math.inf))
                    except Exception as error:  # own parts can raise anything when they are packed
                        yield key, Failure(f"it cannot be sent to a process: {type(error).__name__}: {error}")
            self._wait()
            for worker in list(self._workers):
                said = worker.news()
                key = worker.key
                if said is not None:
                    if worker.heard():
                        yield key, unpacked(said)
                    else:
                        self._failed_starts = 0
                elif worker.dead:
                    self._dismiss(worker)
                    if key in repeated:
                        yield key, Failure(DIED)
                    elif key is not None:
                        suspects.append(key)
                elif worker.overdue_in() <= 0.0:
                    self._dismiss(worker)
                    yield key, Failure(f"it took longer than its limit of {worker.limit:g} s and was ended")

    def _busy(self) -> int:
        return sum(worker.key is not None for worker in self._workers)

    def _employ(self, waiting: int) -> None:
        """Start as many processes as are missing for this many calls beside those under way."""
        while len(self._workers) < min(self._most, self._busy() + waiting):
            worker = _Worker()
            # listed first: it ends with the pool, whatever interrupts its start
            self._workers.append(worker)
            worker.start(self._function)

    def _dismiss(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.connection.close()
        worker.end(0.0)
        self._failed_starts += not worker.ready
        if self._failed_starts >= MOST_STARTS:
            raise VsconstraintsError(
                f"{self._failed_starts} processes in a row ended before they were ready, the last one with exit code "
                f"{worker.process.exitcode}; a script that uses several needs `if __name__ == '__main__':` around "
                "what it does"
            )

    def _wait(self) -> None:
        """Until a process says something, a call is overdue, or it is time to check whether one has died."""
        nearest = min((worker.overdue_in() for worker in self._workers), default=CHECK)
        wait([worker.connection for worker in self._workers], max(0.0, min(CHECK, nearest)))


def carry_out(
    function: Callable[..., Answer],
    *batches: Mapping[Key, tuple[Any, ...]],
    workers: int | None = None,
    limits: Mapping[Key, float] | None = None,
    on_answer: Callable[[Key, Answer | Failure], None] = lambda key, answer: None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[Key, Answer | Failure]:
    """Make calls in processes of their own: see :class:`Pool`.

    Parameters
    ----------
    function
        What is called; a function of a module, so that other processes can import it.
    batches
        Its arguments by keys; calls of a batch are begun when all of the one before are answered.
    workers
        Number of processes at most; see :func:`vsconstraints.comparisons.runs.machine.process_count`.
    limits
        How long a call may take [s]; as long as it likes if it is not there.
    on_answer
        Told of every answer as it comes.
    on_progress
        Told how many calls are answered, and how many there are.
    """
    answers: dict[Key, Answer | Failure] = {}
    done, total = 0, sum(map(len, batches))
    on_progress(done, total)
    with Pool(function, min(process_count(workers), max(map(len, batches), default=1))) as pool:
        for batch in batches:
            for key, answer in pool.run(batch, limits):
                answers[key] = answer
                on_answer(key, answer)
                done += 1
                on_progress(done, total)
    return answers


class _Worker:
    """A process as its pool sees it.

    Attributes
    ----------
    key, limit
        Of the call it is answering, None if it is none, and how long that may take [s].
    ready, dead
        Whether it has come up, and whether it has gone down.
    """

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")  # they start alike on every system and inherit no threads
        self.connection, self._theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(self._theirs, os.getpid()))
        self.key: Any = None
        self.limit = math.inf
        self.ready = self.dead = False

    def start(self, function: Callable[..., object]) -> None:
        # else the first process starts it, and it lets signals through again
        resource_tracker.ensure_running()
        with signals_held(), _single_threaded():
            self.process.start()
        self._theirs.close()
        self._send(pickle.dumps(function))

    def begin(self, key: Hashable, packed: bytes, limit: float) -> None:
        self.key, self.limit, self._begun = key, limit, time.monotonic()
        self._send(packed)

    def _send(self, packed: bytes) -> None:
        with suppress(OSError):  # it died: that is seen when it is looked at
            self.connection.send_bytes(packed)

    def news(self) -> bytes | None:
        """What it has said, if anything."""
        alive = self.process.is_alive()  # asked first: what it said before it died is still there
        try:
            if self.connection.poll():
                return self.connection.recv_bytes()
        except (EOFError, OSError):
            alive = False
        self.dead = not alive
        return None

    def heard(self) -> bool:
        """Note that it has said something: an answer, or, as False, that it is ready."""
        answered, self.ready, self.key = self.ready, True, None
        return answered

    def overdue_in(self) -> float:
        """How long until its call is overdue [s]."""
        return math.inf if self.key is None else self._begun + self.limit - time.monotonic()

    def end(self, patience: float) -> None:
        """See it end within this time [s], or end it."""
        if self.process.pid is None:
            return
        self.process.join(patience)
        self.process.kill()
        self.process.join()


@contextmanager
def _single_threaded() -> Iterator[None]:
    """A process that is started meanwhile finds :data:`THREAD_VARIABLES` set; for this one nothing is changed.

    Libraries read them when they are loaded, and a process that is spawned gets no other environment than this one's.
    """
    missing = [variable for variable in THREAD_VARIABLES if variable not in os.environ]
    os.environ.update(dict.fromkeys(missing, "1"))
    try:
        yield
    finally:
        for variable in missing:
            del os.environ[variable]


def unpacked(packed: bytes) -> Any:
    """What another process answered; a :class:`Failure` if that cannot be read."""
    try:
        return pickle.loads(packed)
    except Exception as error:  # own parts can raise anything when they are unpacked
        return Failure(f"the answer cannot be read: {type(error).__name__}: {error}")


class Workers(Protocol):
    """What makes calls of one function elsewhere: a :class:`vsconstraints.comparisons.runs.pool.Pool`, or a cluster."""

    def run(
        self, calls: Mapping[Key, tuple[Any, ...]], limits: Mapping[Key, float] | None = None, *, again: bool = True
    ) -> Iterator[tuple[Key, Any]]:
        """Answers as they come, each with the key of its call.

        A :class:`.Failure` with its reason is the answer of a call that has no other.

        Parameters
        ----------
        calls
            The function's arguments.
        limits
            How long a call may take [s]; as long as it likes if it is not there.
        again
            Whether a call whose process died is made once more.
        """


OpenWorkers = Callable[[Callable[..., Any]], AbstractContextManager[Workers]]
"""Given a function of a module, the workers that make calls of it, for as long as the ``with`` block lasts."""


def processes(asked: int | None = None) -> OpenWorkers:
    """Processes of this machine, as many as asked for, or as there are cores and memory for."""
    return lambda function: Pool(function, process_count(asked))
