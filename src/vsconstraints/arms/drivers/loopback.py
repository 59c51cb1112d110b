"""``loopback://``: a stand-in for an arm behind a socket of this machine, to try streaming, stopping and timeouts."""

from __future__ import annotations

import socket
from collections.abc import Callable
from functools import partial
from typing import cast

import numpy as np

from ...errors import ConfigurationError
from ...rows import Array
from ...simulation import Setup
from ..driver import Address, ArmError, Driver, Joints
from ..envelope import Envelope
from ..server import (
    FAULTS,
    HALT,
    MOVE,
    READ,
    STOPPED,
    Behaviour,
    Fault,
    in_process,
    in_thread,
    message,
    read_message,
    receive,
)
from ..server import length as length_of
from ..stand_in import PATIENCE, StandIn, StandInLimits


class LoopbackArm(Driver):
    """A stand-in for an arm, behind a socket of this machine; options: time, fault, at, patience, off.

    ``time``
        ``real``: the server is a process of its own, and time is the system's. ``simulated``: a setpoint lets its
        period pass, so that nothing depends on how fast the machine is.
    ``fault``, ``at``
        What goes wrong, see :data:`vsconstraints.arms.server.Fault`, and after how many seconds.
    ``patience``
        How long an answer may take [s].
    ``off``
        How far from the scenario's start the arm stands [rad or m].

    With a port, a server that runs already is used, and the other options are its own.
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
        fault = cast(Fault, address.choice("fault", FAULTS))
        behaviour = Behaviour(fault, address.number("at", 0.5), self.simulated_time)
        own = Envelope.of(setup.scene.robot, setup.limits, setup.Ts)
        limits = StandInLimits(own.q_min, own.q_max, own.qd_max, own.acceleration)
        self._made = StandIn(setup.q0 + address.number("off", 0.0), limits, setup.Ts), behaviour
        self._end: Callable[[], None] = _nothing
        self._connection: socket.socket | None = None
        self._nothing = np.zeros(self.n)

    def connect(self) -> None:
        """Start the server, unless there is one, and reach it."""
        port = self.address.port
        if port is None:
            port, self._end = (in_thread if self.simulated_time else in_process)(*self._made)
        self._where = (self.address.host or "127.0.0.1", port)
        self._connection = connected(self._where, self._patience)

    def read(self) -> Joints:
        """Ask where the joints are."""
        return self._ask(READ, self._nothing, self._nothing)

    def send(self, q: Array, qd: Array) -> None:
        """Send a setpoint."""
        self._ask(MOVE, q, qd)

    def _ask(self, kind: int, q: Array, qd: Array) -> Joints:
        if self._connection is None:
            raise ArmError("the connection to the arm is closed")
        return answered(self._connection, self._patience, kind, q, qd)

    def halt(self, deceleration: float) -> None:
        """Tell the arm through a connection of its own, since another one may not be answered."""
        self.stopper()()

    def stopper(self) -> Callable[[], None]:
        """The same from another process."""
        return partial(halt, self._where, self._patience, self.n)

    def close(self) -> None:
        """Close the connection, and end the server that was started."""
        if self._connection is not None:
            self._connection.close()
        self._connection = None
        self._end()
        self._end = _nothing


def connected(where: tuple[str, int], patience: float) -> socket.socket:
    """A connection whose answers may take so long [s]; raises ArmError."""
    try:
        connection = socket.create_connection(where, max(patience, 1.0))
    except OSError as error:
        raise ArmError(f"no arm answers at {where[0]}, port {where[1]}: {error}") from error
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.settimeout(patience)
    return connection


def answered(connection: socket.socket, patience: float, kind: int, q: Array, qd: Array) -> Joints:
    """What the arm answers to a message; raises ArmError."""
    n = len(q)
    count = length_of(n, True)
    try:
        connection.sendall(message(kind, 0.0, q, qd))
        data = receive(connection, count)
    except TimeoutError as error:
        raise ArmError(f"the arm has not answered within {1e3 * patience:g} ms") from error
    except OSError as error:
        raise ArmError(f"the connection to the arm broke: {error}") from error
    if len(data) < count:
        raise ArmError("the arm closed the connection")
    said, t, q, qd, text = read_message(data, n)
    if said == STOPPED and kind != HALT:
        raise ArmError(f"the arm stopped by itself: {text}")
    return Joints(t, q, qd)


def halt(where: tuple[str, int], patience: float, n: int) -> None:
    """Stop the arm of n joints there; raises ArmError."""
    with connected(where, patience) as connection:
        answered(connection, patience, HALT, np.zeros(n), np.zeros(n))


def _nothing() -> None:
    """No server to end."""
