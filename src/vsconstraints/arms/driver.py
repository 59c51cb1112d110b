"""Base class of drivers: the interface to an arm, which reads states and sends setpoints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import ClassVar, Literal, NamedTuple
from urllib.parse import parse_qsl, urlsplit

from ..errors import ConfigurationError, VsconstraintsError, format_value, unknown_name
from ..rows import Array
from ..simulation import Setup

Takes = Literal["position", "speed"]  #: Quantity that an arm takes as setpoint in each period.


class ArmError(VsconstraintsError):
    """The arm does not answer, has stopped, or does not accept a setpoint."""


class Joints(NamedTuple):
    """Joint state at one instant.

    ``t`` [s] is the time by the arm's clock, ``q`` (n,) [rad or m] and ``qd`` (n,) [rad/s or m/s].
    The clock may begin anywhere. It must advance with each new state: a state whose time is not
    later than that of the previous one counts as the same state, read again. A joint without end
    stops may be given in any turn.
    """

    t: float
    q: Array
    qd: Array


@dataclass(frozen=True)
class Address:
    """Address of an arm: ``SCHEME://HOST:PORT?OPTION=VALUE&…``."""

    scheme: str  #: The driver's name.
    host: str = ""
    port: int | None = None
    options: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str) -> Address:
        """Parse an address; raises ConfigurationError."""
        try:
            parts = urlsplit(text)
            host = parts.hostname or ""
            port = parts.port
            options = dict(
                parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))
            )
        except ValueError as error:
            raise ConfigurationError(
                f"the address {format_value(text)} cannot be read: {error}"
            ) from error
        if not parts.scheme or "://" not in text:
            raise ConfigurationError(
                f"an arm's address is like ur-rtde://HOST or loopback://, not {format_value(text)}"
            )
        if parts.path not in ("", "/") or parts.fragment or parts.username is not None:
            raise ConfigurationError(
                f"an arm's address is SCHEME://HOST:PORT?OPTION=VALUE, not {format_value(text)}"
            )
        return cls(parts.scheme, host, port, options)

    def require_none(self) -> None:
        """Raise ConfigurationError if a host or port is given for an arm in this process."""
        if self.host or self.port is not None:
            raise ConfigurationError(
                f"{self.scheme}:// runs in this process and takes no address: leave out "
                f"{self.host!r}"
            )

    def number(self, name: str, default: float) -> float:
        """Return an option that is a number of zero or more; raises ConfigurationError."""
        text = self.options.get(name, default)
        value = -1.0
        with suppress(ValueError):
            value = float(text)
        if not 0.0 <= value < float("inf"):
            raise ConfigurationError(
                f"option {name} of {self.scheme} must be a number of 0 or more, not "
                f"{format_value(text)}"
            )
        return value

    def choice(self, name: str, choices: tuple[str, ...]) -> str:
        """Return an option that is one of several words, by default the first.

        Raises ConfigurationError.
        """
        value = self.options.get(name, choices[0])
        if value not in choices:
            raise unknown_name(f"{name} of {self.scheme}", value, choices)
        return value


class Driver(ABC):
    """One kind of arm. Every call returns, or raises ArmError, within a bounded time.

    A new kind is a file with such a class, and a line in
    :data:`vsconstraints.arms.drivers.DRIVERS`.
    """

    #: True if the motion can cause harm: such an arm moves only after confirmation.
    real: ClassVar[bool] = True
    #: True if time passes only when setpoints are sent, so that the loop never waits.
    simulated_time: bool = False
    known: ClassVar[tuple[str, ...]] = ()  #: Options that an address may have.
    takes: Takes = "position"  #: Quantity that is sent.
    #: Description of the arm's own reaction if setpoints stop; empty if unknown.
    watchdog: str = ""

    def __init__(self, address: Address, setup: Setup) -> None:
        for option in address.options:
            if option not in self.known:
                raise unknown_name(f"option of {address.scheme}", option, self.known)
        self.address = address
        self.robot = setup.scene.robot
        self.period = setup.Ts
        self.n = self.robot.n

    def connect(self) -> None:
        """Connect to the arm; nothing moves. Raises ArmError."""

    def begin(self) -> None:
        """Start streaming: one setpoint follows in each period. Raises ArmError.

        This is the time to start the arm's own watchdog.
        """

    @abstractmethod
    def read(self) -> Joints:
        """Read the current joint state. Raises ArmError, also if the arm has stopped."""

    @abstractmethod
    def send(self, q: Array, qd: Array) -> None:
        """Send position and speed (n,) for the end of the period that begins. Raises ArmError."""

    @abstractmethod
    def halt(self, deceleration: float) -> None:
        """Halt the arm: it stops by its own means, where setpoints cannot brake it [rad/s²].

        It may be called by another thread while a call has not returned. Raises ArmError if the arm
        is not reached.
        """

    def stopper(self) -> Callable[[], None] | None:
        """Return a function that halts the arm from another process, as :meth:`halt` does.

        This method is called once the arm is connected. The function is pickled and called in a
        process that shares nothing with this one, so it opens its own connection and raises
        ArmError if the arm is not reached. None if only the arm itself can stop while Python is
        blocked.
        """
        return None

    def close(self) -> None:
        """Disconnect from the arm, which stands still; never raises ArmError.

        It may be called more than once.
        """
