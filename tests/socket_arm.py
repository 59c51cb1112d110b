"""A fake arm behind a socket: ``socket://HOST:PORT``, to be stopped from other processes.

Messages are lines of JSON: ``[kind, q, qd]``, answered by ``[stopped, t, q, qd]``.
"""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable
from contextlib import closing, suppress
from functools import partial

import numpy as np

from vsconstraints.arms import Address, ArmError, Driver, Joints
from vsconstraints.arms.drivers.loopback import FakeArm
from vsconstraints.rows import Array
from vsconstraints.simulation import Setup

READ = "read"
MOVE = "move"
HALT = "halt"
MAX_LINE = 1 << 16
"""Longest message [bytes]."""


class Server:
    """Answers every connection in a thread of its own; one that ``stalls`` answers no more, once it
    moves.
    """

    def __init__(self, arm: FakeArm, stalls: bool = False) -> None:
        self.arm = arm
        self.stalls = stalls
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._moving = False
        self._last = time.perf_counter()
        self._closed = threading.Event()
        # a stop must get through while another connection is not answered
        self._lock = threading.Lock()

    def serve(self) -> None:
        with suppress(OSError):  # closed
            while not self._closed.is_set():
                connection, _ = self._listening.accept()
                threading.Thread(target=self._answer_all, args=(connection,), daemon=True).start()

    def close(self) -> None:
        self._closed.set()
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()

    def _answer_all(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with connection, connection.makefile("rb") as lines, suppress(OSError):
            while line := lines.readline(MAX_LINE):
                kind, *numbers = json.loads(line)
                connection.sendall(self._answer(kind, *map(np.array, numbers)))

    def _answer(self, kind: str, q: Array, qd: Array) -> bytes:
        arm = self.arm
        if self.stalls and self._moving and kind != HALT:
            self._closed.wait()
        with self._lock:
            now = time.perf_counter()
            arm.advance(now - self._last if self._moving else 0.0)
            self._last = now
            if kind == HALT:
                arm.stop("halted")
            if kind == MOVE:
                arm.t = arm.t if self._moving else 0.0
                self._moving = True
                arm.take(q, qd)
            q, qd = arm.state()
            return json.dumps([arm.stopped, arm.t, q.tolist(), qd.tolist()]).encode() + b"\n"


def in_thread(arm: FakeArm, stalls: bool = False) -> tuple[int, Callable[[], None]]:
    """Start a server; returns its port, and what ends it."""
    server = Server(arm, stalls)
    threading.Thread(target=server.serve, daemon=True).start()
    return server.port, server.close


class SocketArm(Driver):
    """The arm behind the server at HOST:PORT, whose answers may take ``patience`` [s]."""

    real = False
    known = ("patience",)

    def __init__(self, address: Address, setup: Setup) -> None:
        super().__init__(address, setup)
        self._where = (address.host, address.port or 0)
        self._patience = address.number("patience", 0.1)

    def connect(self) -> None:
        self._connection = Connected(self._where, self._patience, self.n)

    def read(self) -> Joints:
        return self._connection.ask(READ)

    def send(self, q: Array, qd: Array) -> None:
        self._connection.ask(MOVE, q, qd)

    def halt(self, deceleration: float) -> None:
        self.stopper()()

    def stopper(self) -> Callable[[], None]:
        return partial(halt, self._where, self._patience, self.n)

    def close(self) -> None:
        self._connection.close()


class Connected:
    """A connection to the server of an arm of n joints, whose answers may take ``patience`` [s];
    raises ArmError.
    """

    def __init__(self, where: tuple[str, int], patience: float, n: int) -> None:
        self.patience = patience
        self._still = (np.zeros(n), np.zeros(n))
        try:
            self._socket = socket.create_connection(where, max(patience, 1.0))
        except OSError as error:
            raise ArmError(f"no arm answers at {where[0]}, port {where[1]}: {error}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(patience)
        self._lines = self._socket.makefile("rb")

    def ask(self, kind: str, *state: Array) -> Joints:
        """Send a message, with q and q̇ (n,) if they matter, and return the state that is
        answered.
        """
        message = json.dumps([kind, *(part.tolist() for part in state or self._still)])
        try:
            self._socket.sendall(message.encode() + b"\n")
            line = self._lines.readline(MAX_LINE)
        except TimeoutError as error:
            raise ArmError(f"the arm has not answered within {1e3 * self.patience:g} ms") from error
        except OSError as error:
            raise ArmError(f"the connection to the arm broke: {error}") from error
        if not line.endswith(b"\n"):
            raise ArmError("the arm closed the connection")
        stopped, t, q_now, qd_now = json.loads(line)
        if stopped and kind != HALT:
            raise ArmError(f"the arm stopped by itself: {stopped}")
        return Joints(t, np.array(q_now), np.array(qd_now))

    def close(self) -> None:
        self._lines.close()
        self._socket.close()


def halt(where: tuple[str, int], patience: float, n: int) -> None:
    """Stop the arm of n joints there; raises ArmError."""
    with closing(Connected(where, patience, n)) as connection:
        connection.ask(HALT)
