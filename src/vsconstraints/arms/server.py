"""The server behind ``loopback://``: a stand-in for an arm, reached through a socket, that can be told to fail.

Every message is a letter and 2n + 1 numbers; every answer is a letter, 2n + 1 numbers, and a text.
"""

from __future__ import annotations

import multiprocessing
import socket
import struct
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Literal

import numpy as np

from ..plugins.processes import end_with
from ..rows import Array
from .stand_in import StandIn

Fault = Literal["none", "stall", "drop", "jump", "refuse"]
"""What goes wrong: it never answers again, closes the connection, says that it is elsewhere, or stops by itself."""

FAULTS: tuple[Fault, ...] = ("none", "stall", "drop", "jump", "refuse")
READ, MOVE, HALT, REACHED, STOPPED = b"rmhas"
JUMP = 0.5
"""By how much what it says jumps [rad or m]."""

TEXT = 200
"""Bytes of an answer's text."""


@dataclass(frozen=True)
class Behaviour:
    """How the server behaves.

    Attributes
    ----------
    fault, at
        What goes wrong, and when by the arm's clock [s], which begins with the first setpoint.
    simulated_time
        Whether a setpoint lets its period pass; otherwise time is the system's.
    """

    fault: Fault = "none"
    at: float = 0.0
    simulated_time: bool = False


def message(kind: int, t: float, q: Array, qd: Array, text: str | None = None) -> bytes:
    """As it is sent; answers have a text."""
    packed = struct.pack(f"<B{2 * len(q) + 1}d", kind, t, *q, *qd)
    return packed if text is None else packed + text.encode()[:TEXT].ljust(TEXT)


def length(n: int, answer: bool) -> int:
    """Bytes of a message, or an answer."""
    return struct.calcsize(f"<B{2 * n + 1}d") + (TEXT if answer else 0)


def read_message(data: bytes, n: int) -> tuple[int, float, Array, Array, str]:
    """What :func:`message` packed."""
    kind, t, *numbers = struct.unpack_from(f"<B{2 * n + 1}d", data)
    return kind, t, np.array(numbers[:n]), np.array(numbers[n:]), data[length(n, False) :].decode().strip()


def receive(connection: socket.socket, count: int) -> bytes:
    """So many bytes; fewer where the other end has closed. Raises TimeoutError or OSError."""
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            break
        data += part
    return data


class Server:
    """Answers one connection after the other, until it is closed.

    Parameters
    ----------
    arm
        What it moves.
    behaviour
        How it behaves.

    Attributes
    ----------
    port
        Where it listens, on this machine alone.
    """

    def __init__(self, arm: StandIn, behaviour: Behaviour) -> None:
        self.arm, self.behaviour = arm, behaviour
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._moving, self._last, self._closed = False, time.perf_counter(), threading.Event()
        # a stop must get through while another connection is not answered
        self._one_at_a_time = threading.Lock()

    def serve(self) -> None:
        """Answer, each connection in a thread of its own."""
        while not self._closed.is_set():
            try:
                connection, _ = self._listening.accept()
            except OSError:  # closed
                return
            threading.Thread(target=self._answer_all, args=(connection,), daemon=True).start()

    def close(self) -> None:
        """Listen no more."""
        self._closed.set()
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()

    def _answer_all(self, connection: socket.socket) -> None:
        n = len(self.arm.limits.q_max)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with connection, suppress(OSError):
            while len(data := receive(connection, length(n, False))) == length(n, False):
                answer = self._answer(*read_message(data, n)[:4])
                if answer is None:
                    return
                connection.sendall(answer)

    def _answer(self, kind: int, t: float, q: Array, qd: Array) -> bytes | None:
        """The answer to a message; None where the connection is to be closed."""
        with self._one_at_a_time:
            self._pass_time()
            fault = self.behaviour.fault if self._moving and self.arm.t >= self.behaviour.at else "none"
        if kind == HALT:
            self.arm.stop("halted")
        elif fault == "drop":
            return None
        elif fault == "stall":
            self._closed.wait()
            return None
        with self._one_at_a_time:
            if kind == MOVE:
                self._begin()
                self.arm.take(q, qd)
                if self.behaviour.simulated_time:
                    self.arm.advance(self.arm.period)
            if fault == "refuse":
                self.arm.stop("protective stop: told to")
            q, qd = self.arm.state()
            if fault == "jump":
                q = q + JUMP
            return message(STOPPED if self.arm.stopped else REACHED, self.arm.t, q, qd, self.arm.stopped)

    def _begin(self) -> None:
        if not self._moving:
            self._moving, self.arm.t = True, 0.0

    def _pass_time(self) -> None:
        now = time.perf_counter()
        if self._moving and not self.behaviour.simulated_time:
            self.arm.advance(now - self._last)
        self._last = now


def in_thread(arm: StandIn, behaviour: Behaviour) -> tuple[int, Callable[[], None]]:
    """Start a server in a thread: its port, and what ends it."""
    server = Server(arm, behaviour)
    threading.Thread(target=server.serve, daemon=True).start()
    return server.port, server.close


def in_process(arm: StandIn, behaviour: Behaviour) -> tuple[int, Callable[[], None]]:
    """Start a server in a process of its own, so that it takes no time of the loop's: its port, and what ends it."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, arm, behaviour, multiprocessing.current_process().pid))
    process.start()
    theirs.close()

    def end() -> None:
        process.kill()
        process.join()

    try:
        port: int = ours.recv()
    except EOFError:
        end()
        raise
    return port, end


def _serve(connection: Connection, arm: StandIn, behaviour: Behaviour, parent: int) -> None:
    import signal

    end_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes of a terminal: the arm goes on
    server = Server(arm, behaviour)
    connection.send(server.port)
    server.serve()
