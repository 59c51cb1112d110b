"""``loopback://``: a fake arm behind a socket of this machine, to try streaming, stopping and timeouts.

Messages are lines of JSON: ``[kind, q, qd]``, answered by ``[stopped, t, q, qd]``.
"""

from __future__ import annotations

import json
import multiprocessing
import signal
import socket
import threading
import time
from collections.abc import Callable
from contextlib import closing, suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Literal, NamedTuple, cast, get_args

import numpy as np

from ...errors import ConfigurationError
from ...plugins.processes import end_with
from ...rows import Array
from ...simulation import Setup
from ...simulation.plant import cubic
from ..driver import Address, ArmError, Driver, Joints
from ..envelope import Envelope

#: What goes wrong: it never answers again, closes the connection, reports a wrong position, or stops by itself.
Fault = Literal["none", "stall", "drop", "jump", "refuse"]

READ, MOVE, HALT = "read", "move", "halt"

JUMP = 0.5  #: Error of the position that the fault ``jump`` reports [rad or m].
#: How long the arm coasts after a period before its watchdog brakes it [s]; ten periods if that is longer.
PATIENCE = 0.1
#: Delay of a setpoint up to which it is compared with the setpoint before, and not with the arm's position [s].
LATE = 0.01
SLACK = 1.05  #: Factor on limits beyond which a setpoint is refused: setpoints come through a network.
MAX_LINE = 1 << 16  #: Longest message [bytes].


class Behaviour(NamedTuple):
    """How the server behaves."""

    fault: Fault = "none"
    at: float = 0.0  #: When that goes wrong by the arm's clock [s], which starts with the first setpoint.
    simulated_time: bool = False  #: Whether a setpoint lets its period pass; otherwise time is the system's.


class FakeArm:
    """Position is a cubic from one setpoint to the next, then coasts for a while, then the arm brakes.

    That is its watchdog: an arm that it has braked accepts no more setpoints. It stands at ``q`` (n,); the envelope has
    the limits of the setpoints that it accepts, its own deceleration, and the period in which a setpoint is reached.
    """

    def __init__(self, q: Array, envelope: Envelope, patience: float = PATIENCE) -> None:
        self.limits, self.period = envelope, envelope.period
        self.t = 0.0  #: Its clock [s]; :meth:`advance` moves it.
        self.stopped = ""  #: Why it stopped by itself; empty if it has not.
        self._begun, self._patience = -np.inf, max(patience, 10.0 * envelope.period)
        self._coasting = self._patience
        here: tuple[Array, Array] = np.array(q), np.zeros(len(q))
        self._from = self._to = here

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        self.t += max(seconds, 0.0)
        silent = self.t - self._begun - self.period
        if np.isfinite(self._begun) and silent > self._patience and not self.stopped:
            self.stopped = f"its watchdog received nothing for {1e3 * self._patience:g} ms"

    def state(self) -> tuple[Array, Array]:
        """(n,) q and q̇ now."""
        T, (q, qd), after = self.period, self._to, self.t - self._begun
        if after < T:
            return cubic(self._from, self._to, T, after / T)
        coasting = min(after - T, self._coasting)
        # (n,) for how long each joint brakes
        braking = np.minimum(after - T - coasting, np.abs(qd) / self.limits.acceleration)
        slower = np.sign(qd) * self.limits.acceleration * braking
        return q + coasting * qd + braking * (qd - 0.5 * slower), qd - slower

    def take(self, q: Array, qd: Array) -> None:
        """Accept a setpoint for the end of the period that begins; one beyond the limits stops the arm."""
        if self.stopped:
            return
        before = self._to if self.t - self._begun < self.period + LATE else self.state()
        limits, T = self.limits, self.period
        violations = (
            ("is not finite", ~(np.isfinite(q) & np.isfinite(qd))),
            ("leaves its range", (q < limits.q_min - 1e-6) | (q > limits.q_max + 1e-6)),
            ("is too fast", np.maximum(np.abs(qd), np.abs(q - before[0]) / T) > SLACK * limits.qd_max + 1e-3),
            ("accelerates too much", np.abs(qd - before[1]) / T > SLACK * limits.acceleration + 1e-3),
        )
        for what, joints in violations:
            if joints.any():
                self.stop(f"protective stop: joint {int(np.argmax(joints)) + 1} {what}")
                return
        self._from, self._to = self.state(), (np.array(q), np.array(qd))
        self._begun, self._coasting = self.t, self._patience

    def stop(self, why: str) -> None:
        """Brake now, and accept nothing more."""
        self._from = self._to = self.state()
        self._begun, self._coasting, self.stopped = self.t - self.period, 0.0, why


class Server:
    """Answers every connection in a thread of its own, until it is closed; ``port`` is on this machine alone."""

    def __init__(self, arm: FakeArm, behaviour: Behaviour) -> None:
        self.arm, self.behaviour = arm, behaviour
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._moving, self._last, self._closed = False, time.perf_counter(), threading.Event()
        # a stop must get through while another connection is not answered
        self._lock = threading.Lock()

    def serve(self) -> None:
        """Accept connections."""
        with suppress(OSError):  # closed
            while not self._closed.is_set():
                connection, _ = self._listening.accept()
                threading.Thread(target=self._answer_all, args=(connection,), daemon=True).start()

    def close(self) -> None:
        """Stop listening."""
        self._closed.set()
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()

    def _answer_all(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # what is no message closes the connection
        with connection, connection.makefile("rb") as lines, suppress(OSError, ValueError, TypeError, RecursionError):
            while line := lines.readline(MAX_LINE):
                kind, *numbers = json.loads(line)
                q, qd = (np.array(each, dtype=np.float64) for each in numbers)
                answer = self._answer(kind, q, qd) if q.shape == qd.shape == self.arm.limits.q_max.shape else None
                if answer is None:
                    return
                connection.sendall(answer)

    def _answer(self, kind: str, q: Array, qd: Array) -> bytes | None:
        """The answer to a message; None where the connection is to be closed."""
        arm, (at_fault, at, simulated) = self.arm, self.behaviour
        with self._lock:
            now = time.perf_counter()
            arm.advance(now - self._last if self._moving and not simulated else 0.0)
            self._last = now
            fault = at_fault if self._moving and arm.t >= at and kind != HALT else "none"
        if fault == "stall":
            self._closed.wait()
        if fault in ("drop", "stall"):
            return None
        with self._lock:
            if kind == HALT:
                arm.stop("halted")
            if kind == MOVE:
                arm.t, self._moving = arm.t if self._moving else 0.0, True
                arm.take(q, qd)
                arm.advance(arm.period if simulated else 0.0)
            if fault == "refuse":
                arm.stop("protective stop: simulated")
            q, qd = arm.state()
            q = q + JUMP if fault == "jump" else q
            return json.dumps([arm.stopped, arm.t, q.tolist(), qd.tolist()]).encode() + b"\n"


def in_thread(arm: FakeArm, behaviour: Behaviour) -> tuple[int, Callable[[], None]]:
    """Start a server in a thread; returns its port, and what ends it."""
    server = Server(arm, behaviour)
    threading.Thread(target=server.serve, daemon=True).start()
    return server.port, server.close


def in_process(arm: FakeArm, behaviour: Behaviour) -> tuple[int, Callable[[], None]]:
    """The same in its own process, so that it takes no time from the loop."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, arm, behaviour, multiprocessing.current_process().pid))
    process.start()
    theirs.close()

    def end() -> None:
        process.kill()
        process.join()

    try:
        return ours.recv(), end
    except EOFError:
        end()
        raise


def _serve(connection: Connection, arm: FakeArm, behaviour: Behaviour, parent: int) -> None:
    end_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes of a terminal: the arm goes on
    server = Server(arm, behaviour)
    connection.send(server.port)
    server.serve()


class LoopbackArm(Driver):
    """A fake arm behind a socket of this machine; options: time, fault, at, patience, off.

    With ``time=real`` the server is a process of its own, and time is the system's; with ``simulated`` a setpoint lets
    its period pass, so that nothing depends on the speed of the machine. ``fault`` (:data:`Fault`) goes wrong after
    ``at`` seconds, an answer may take ``patience`` [s], and the arm stands ``off`` [rad or m] from the scenario's
    start. With a port in the address, the server that listens there is used.
    """

    real = False
    known = ("time", "fault", "at", "patience", "off")
    watchdog = f"a process of its own, which brakes after {1e3 * PATIENCE:g} ms without a setpoint"

    def __init__(self, address: Address, setup: Setup) -> None:
        super().__init__(address, setup)
        self.simulated_time = address.choice("time", ("real", "simulated")) == "simulated"
        self._patience = address.number("patience", 0.1)
        if self._patience == 0.0:
            raise ConfigurationError("option patience of loopback must be positive: an answer takes some time")
        fault = cast(Fault, address.choice("fault", get_args(Fault)))
        behaviour = Behaviour(fault, address.number("at", 0.5), self.simulated_time)
        envelope = Envelope.of(setup.scene.robot, setup.limits, setup.Ts)
        self._arm = FakeArm(setup.q0 + address.number("off", 0.0), envelope), behaviour
        self._end: Callable[[], None] | None = None
        self._connection: Connected | None = None

    def connect(self) -> None:
        """Start the server, unless there is one, and connect to it."""
        port = self.address.port
        if port is None:
            port, self._end = (in_thread if self.simulated_time else in_process)(*self._arm)
        self._where = (self.address.host or "127.0.0.1", port)
        self._connection = Connected(self._where, self._patience, self.n)

    def _ask(self, kind: str, *state: Array) -> Joints:
        if self._connection is None:
            raise ArmError("the connection to the arm is closed")
        return self._connection.ask(kind, *state)

    def read(self) -> Joints:
        """Ask for the joints' state."""
        return self._ask(READ)

    def send(self, q: Array, qd: Array) -> None:
        """Send a setpoint."""
        self._ask(MOVE, q, qd)

    def halt(self, deceleration: float) -> None:
        """Stop the arm through a separate connection, since the first one may not be answered."""
        self.stopper()()

    def stopper(self) -> Callable[[], None]:
        """The same from another process."""
        return partial(halt, self._where, self._patience, self.n)

    def close(self) -> None:
        """Close the connection, and end the server that was started."""
        if self._connection is not None:
            self._connection.close()
        if self._end is not None:
            self._end()
        self._connection = self._end = None


class Connected:
    """A connection to the server of an arm of n joints, whose answers may take ``patience`` [s]; raises ArmError."""

    def __init__(self, where: tuple[str, int], patience: float, n: int) -> None:
        self.patience, self._still = patience, (np.zeros(n), np.zeros(n))
        try:
            self._socket = socket.create_connection(where, max(patience, 1.0))
        except OSError as error:
            raise ArmError(f"no arm answers at {where[0]}, port {where[1]}: {error}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(patience)
        self._lines = self._socket.makefile("rb")

    def ask(self, kind: str, *state: Array) -> Joints:
        """Send a message, with q and q̇ (n,) if they matter, and return the state that is answered."""
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
        """Close it."""
        self._lines.close()
        self._socket.close()


def halt(where: tuple[str, int], patience: float, n: int) -> None:
    """Stop the arm of n joints there; raises ArmError."""
    with closing(Connected(where, patience, n)) as connection:
        connection.ask(HALT)
