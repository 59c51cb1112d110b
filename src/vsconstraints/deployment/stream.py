"""Setpoints to an arm, in time: one each period within the limits, and the stop at the end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..order_filter import OrderFilter
from ..rows import Array
from .brake import Brake
from .clock import Clock, RealClock, SimulatedClock
from .driver import ArmError, Driver, Joints
from .envelope import Envelope, Setpoint
from .log import Period

LONGEST_STOP = 30.0
"""A stop that is streamed takes no longer [s]."""


class Stream:
    """Integrates accelerations to setpoints, and sends them, checked once more, at the beginning of periods.

    Parameters
    ----------
    driver
        Connected.
    envelope
        What must be kept.
    q
        (n,) where the arm stands.
    markers
        How many there are, for the log.

    Attributes
    ----------
    clock
        The system's, or one that goes as fast as the loop.
    sent
        What was sent last.
    periods
        The log.
    missed, shift
        How many periods began late by one or more, and by how much the schedule was moved for that [s].
    begun
        When the first period began, by the clock.
    turn
        Held by the thread that speaks to the arm.
    stop
        How the arm came to rest, in words, and whether setpoints brought it there.
    """

    def __init__(self, driver: Driver, envelope: Envelope, q: Array, markers: int) -> None:
        self.driver, self.envelope, self.Ts = driver, envelope, envelope.period
        self.clock: Clock = SimulatedClock() if driver.simulated_time else RealClock()
        self.sent = Setpoint(q, np.zeros_like(q), np.zeros_like(q))
        self._filter = OrderFilter(q, np.zeros_like(q), self.Ts)
        self._no_image = np.full((markers, 2), np.nan)
        self.periods: list[Period] = []
        self.missed, self.shift, self.begun = 0, 0.0, 0.0
        self.turn, self.stop = threading.Lock(), ("", False)

    def begin(self) -> None:
        """The first period begins now."""
        self.begun = self.clock.now()

    def wait(self, k: int) -> tuple[float, float]:
        """Wait for a period's beginning: when it was to be, since the first one, and how late it is [s]."""
        due = self.begun + k * self.Ts + self.shift
        self.clock.wait(due)
        late = self.clock.now() - due
        if late >= self.Ts:
            # the arm was not sent anything meanwhile: two setpoints at once would make it hurry
            self.missed += 1
            self.shift += late
        return due - self.begun, late

    def strayed(self, state: Joints) -> Array:
        """(n,) how far each joint is from where it was sent."""
        off: Array = np.abs(state.q - self._filter.q)
        if self.driver.takes == "speed":
            # speeds do not say where: positions are those that were measured
            self._filter.q = state.q
            self.sent = replace(self.sent, q=state.q)
        return off

    def within_limits(self, qdd: Array) -> tuple[Array, bool]:
        """A command (n,) brought to what the limits leave, and whether that changed it."""
        least, greatest = self.envelope.box(self.sent.q, self.sent.qd, self.sent.qdd)
        kept: Array = np.clip(qdd, least, greatest)
        return kept, bool((np.abs(kept - qdd) > 1e-9 * (1.0 + np.abs(kept))).any())

    def prepare(self, qdd: Array) -> tuple[Setpoint, str]:
        """The setpoint at the end of a period with this acceleration (n,), and why it must not be sent, if so."""
        q = self._filter.step(qdd)
        after = Setpoint(q, self._filter.qd, qdd)
        refusal = self.envelope.refusal(self.sent, after)
        if refusal:
            self._filter.q, self._filter.qd = self.sent.q, self.sent.qd
        return after, refusal

    def send(self, setpoint: Setpoint) -> None:
        """Send it; raises ArmError."""
        self.driver.send(setpoint.q, setpoint.qd)
        self.sent = setpoint

    def bring_to_rest(self, by_arm: bool, alive: Callable[[], None]) -> None:
        """Bring the arm to rest: by setpoints or, where it does not take them, by its own means. See :attr:`stop`.

        Parameters
        ----------
        by_arm
            Whether it is known not to take them.
        alive
            Called in each period.
        """
        trouble = ""
        if not by_arm:
            try:
                self.stop = self._stream_stop(alive), True
                return
            except ArmError as error:
                trouble = f"while braking, {error}; "
        try:
            self.driver.halt(float(self.envelope.acceleration.min()))
            self.stop = f"{trouble}told to stop by its own means", False
        except ArmError as error:
            self.stop = (
                f"{trouble}IT COULD NOT BE TOLD TO STOP ({error}): its own watchdog, or the emergency stop, must do so",
                False,
            )

    def _stream_stop(self, alive: Callable[[], None]) -> str:
        """Send setpoints until the arm is at rest; how that went. Raises ArmError."""
        before, from_q = len(self.periods), self.sent.q
        self._filter.q, self._filter.qd = self.sent.q, self.sent.qd
        begun = max(self.clock.now(), self.begun + before * self.Ts + self.shift)
        brake = Brake(self.sent.qdd, self.envelope)
        while not brake.at_rest(self._filter.qd):
            k = len(self.periods) - before
            if k * self.Ts > LONGEST_STOP:
                raise ArmError(f"the stop has taken {LONGEST_STOP:g} s")
            self.clock.wait(begun + k * self.Ts)
            alive()
            qdd = brake.step(self._filter.q, self._filter.qd)
            q = self._filter.step(qdd)
            if (np.abs(self._filter.qd) <= 1e-12).all():
                self._filter.qd = np.zeros_like(q)
            due, state = self.clock.now() - self.begun, self.driver.read()
            self.send(Setpoint(q, self._filter.qd, qdd))
            self.log((due, 0.0, 0.0, 0.0, 0.0), state, braking=True)
        if len(self.periods) > before:
            self.clock.wait(begun + (len(self.periods) - before) * self.Ts)
        taken, moved = (len(self.periods) - before) * self.Ts, np.abs(self.sent.q - from_q).max()
        line = "" if brake.straight in (None, True) else ", each joint for itself, to stay within its range"
        return f"braked to rest in {taken:.3g} s over at most {moved:.3g} rad{line}"

    def log(
        self,
        times: tuple[float, float, float, float, float],
        state: Joints,
        image: tuple[Array | None, float] = (None, np.nan),
        guarded: bool = False,
        braking: bool = False,
    ) -> None:
        """Keep a period, whose setpoint is :attr:`sent`: see :class:`Period`."""
        pixels = self._no_image if image[0] is None else image[0]
        sent = self.sent
        self.periods.append(
            Period(
                *times,
                q=state.q,
                qd=state.qd,
                qdd=sent.qdd,
                sent_q=sent.q,
                sent_qd=sent.qd,
                pixels=pixels,
                taken=image[1],
                guarded=guarded,
                braking=braking,
            )
        )
