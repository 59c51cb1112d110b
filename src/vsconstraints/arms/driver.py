"""What speaks to an arm: it reads where the joints are, and sends where they shall be a period
later.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import ClassVar, Literal, NamedTuple
from urllib.parse import parse_qsl, urlsplit

from ..errors import ConfigurationError, VsconstraintsError, shown, unknown_name
from ..rows import Array
from ..simulation import Setup

Takes = Literal["position", "speed"]  #: What an arm is sent in each period.


class ArmError(VsconstraintsError):
    """The arm does not answer, has stopped by itself, or does not take what it is sent."""


class Joints(NamedTuple):
    """Joints at one instant: by the arm's clock ``t`` [s], ``q`` (n,) [rad or m] and ``qd`` (n,)
    [rad/s or m/s].

    The clock may begin anywhere. It has to go on with each new state: a state whose time is not
    later than that of the one before counts as the same one, read again. A joint that turns without
    end may be given in any turn.
    """

    t: float
    q: Array
    qd: Array


@dataclass(frozen=True)
class Address:
    """Where an arm is: ``SCHEME://HOST:PORT?OPTION=VALUE&…``."""

    scheme: str  #: The driver's name.
    host: str = ""
    port: int | None = None
    options: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str) -> Address:
        """An address as it is written; raises ConfigurationError."""
        try:
            parts = urlsplit(text)
            host = parts.hostname or ""
            port = parts.port
            options = dict(
                parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))
            )
        except ValueError as error:
            raise ConfigurationError(
                f"the address {shown(text)} cannot be read: {error}"
            ) from error
        if not parts.scheme or "://" not in text:
            raise ConfigurationError(
                f"an arm's address is like ur-rtde://HOST or loopback://, not {shown(text)}"
            )
        if parts.path not in ("", "/") or parts.fragment or parts.username is not None:
            raise ConfigurationError(
                f"an arm's address is SCHEME://HOST:PORT?OPTION=VALUE, not {shown(text)}"
            )
        return cls(parts.scheme, host, port, options)

    def demand_none(self) -> None:
        """Raise ConfigurationError if it says where an arm in this process is."""
        if self.host or self.port is not None:
            raise ConfigurationError(
                f"{self.scheme}:// is in this process, and at no address like {self.host!r}"
            )

    def number(self, name: str, default: float) -> float:
        """An option that is a number of zero or more; raises ConfigurationError."""
        text = self.options.get(name, default)
        value = -1.0
        with suppress(ValueError):
            value = float(text)
        if not 0.0 <= value < float("inf"):
            raise ConfigurationError(
                f"option {name} of {self.scheme} must be a number of 0 or more, not {shown(text)}"
            )
        return value

    def choice(self, name: str, choices: tuple[str, ...]) -> str:
        """An option that is one of several words, the first if it is not given; raises
        ConfigurationError.
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

    #: Whether what moves can hurt: such an arm moves only where that is confirmed.
    real: ClassVar[bool] = True
    #: Whether time passes only as setpoints are sent: nothing has to be waited for.
    simulated_time: bool = False
    known: ClassVar[tuple[str, ...]] = ()  #: Options that an address may have.
    takes: Takes = "position"  #: What is sent.
    #: What the arm does by itself where the loop falls silent, in words; empty if unknown.
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
        """Reach the arm; nothing moves. Raises ArmError."""

    def begin(self) -> None:
        """Setpoints follow from now on, one each period: the time to start the arm's own watchdog.
        Raises ArmError.
        """

    @abstractmethod
    def read(self) -> Joints:
        """Where the joints are now. Raises ArmError, also if the arm has stopped by itself."""

    @abstractmethod
    def send(self, q: Array, qd: Array) -> None:
        """Where the joints shall be at the end of the period that begins, and how fast (n,). Raises
        ArmError.
        """

    @abstractmethod
    def halt(self, deceleration: float) -> None:
        """Let the arm stop by its own means [rad/s²], where streaming a stop is not possible.

        It may be called by another thread while a call has not returned. Raises ArmError if the arm
        is not reached.
        """

    def stopper(self) -> Callable[[], None] | None:
        """What stops the arm as :meth:`halt` does, from another process; called once the arm is
        connected.

        It is pickled and called in a process that shares nothing with this one: so it has a
        connection of its own, and raises ArmError if the arm is not reached. None where only the
        arm itself can stop while Python is blocked.
        """
        return None

    def close(self) -> None:
        """Leave the arm, which stands still; never raises ArmError. May be called more than
        once.
        """
