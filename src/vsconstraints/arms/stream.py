"""Setpoints to an arm, in time: one each period within the limits, and the stop at the end."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from ..errors import InvalidInput, described, shown
from ..robots.order_filter import OrderFilter
from ..rows import Array
from ..vision.measurement import INNOVATIONS
from .driver import ArmError, Driver, Joints
from .envelope import Brake, Envelope, Setpoint
from .realtime import Clock, RealClock, SimulatedClock
from .record import Period
from .supervision import Supervision

MAX_STOP = 30.0  #: A stop that is streamed takes no longer [s].
#: After so long without a setpoint an arm may have gone on, held or braked: a stop begins where it
#: is measured [s].
SILENT = 0.01
MAX_SILENCES = 3  #: In a stop: each begins it anew, so that with more of them it might not end.
SETTLING = 0.5  #: How long after the last setpoint of a stop an arm may still move [s].
HALTS = 3  #: How often the arm's own stop is tried, where the command fails.
#: Of periods in which nothing is compared with the model.
NO_INNOVATION = np.full(len(INNOVATIONS), np.nan)
STILL = 0.01  #: Measured speed that is rest [rad/s or m/s].
FEWEST_REPEATED = 5  #: Periods in which the same state may be read again, however long a period is.


class Stream:
    """Integrates accelerations to setpoints, from ``q`` (n,) on, and sends them, checked once more,
    in each period.
    """

    def __init__(
        self,
        driver: Driver,
        envelope: Envelope,
        q: Array,
        markers: int,
        bounds: Supervision | None = None,
    ) -> None:
        self.driver = driver
        self.envelope = envelope
        self.Ts = envelope.period
        self.clock: Clock = SimulatedClock() if driver.simulated_time else RealClock()
        self.sent = Setpoint(q, np.zeros_like(q), np.zeros_like(q))
        self._filter = OrderFilter(q, np.zeros_like(q), self.Ts)
        self._no_image = np.full((markers, 2), np.nan)
        self._sent_at = np.inf
        self.periods: list[Period] = []
        #: How many periods began late by one or more, and by how much the schedule was moved for
        #: that [s].
        self.missed = 0
        self.shift = 0.0
        self.begun = 0.0  #: When the first period began, by the clock.
        self.turn = threading.Lock()  #: Held by the thread that speaks to the arm.
        #: How the arm came to rest, in words, and whether setpoints brought it there.
        self.stop = "", False
        self.safe = False  #: Whether it is at rest, or has taken it that it is to stop.
        stalled_s = (bounds or Supervision()).stalled_s
        self._most_repeated = max(round(stalled_s / self.Ts), FEWEST_REPEATED)
        self._state_at = -np.inf  #: The arm's time of the state that was read last [s].
        self._repeated = 0  #: How often it was read again since.

    def begin(self) -> None:
        """The first period begins now."""
        self.begun = self._sent_at = self.clock.now()

    def now(self) -> float:
        """Time since the first period began [s]."""
        return self.clock.now() - self.begun

    def read(self) -> Joints:
        """Where the joints are; those that turn without end in the turn nearest to where they were
        sent.

        Raises ArmError, also if the arm's clock has stood still for too many periods, and
        InvalidInput if the state is not of the arm's joints.
        """
        state = self.driver.read()
        n = len(self.sent.q)
        if np.shape(state.q) != (n,) or np.shape(state.qd) != (n,):
            raise InvalidInput(f"the arm's state must be of {n} joints, not {shown(state)}")
        # a time that is no number does not go on either
        self._repeated = 0 if state.t > self._state_at else self._repeated + 1
        self._state_at = state.t
        if self._repeated >= self._most_repeated:
            raise ArmError(
                f"the arm's clock stands still at {state.t:.6g} s: the same state was read for "
                f"{self._repeated} periods"
            )
        return state._replace(q=self.driver.robot.nearest_turn(state.q, self._filter.q))

    def wait(self, k: int) -> tuple[float, float]:
        """Wait for a period's beginning: when it was to be, since the first one, and how late it is
        [s].
        """
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
            self.sent = self.sent._replace(q=state.q)
        return off

    def within_limits(self, qdd: Array) -> tuple[Array, bool]:
        """A command (n,) brought to what the limits leave, and whether that changed it."""
        least, greatest = self.envelope.box(self.sent.q, self.sent.qd, self.sent.qdd)
        kept: Array = np.clip(qdd, least, greatest)
        return kept, bool((np.abs(kept - qdd) > 1e-9 * (1.0 + np.abs(kept))).any())

    def prepare(self, qdd: Array) -> tuple[Setpoint, str]:
        """The setpoint at the end of a period with this acceleration (n,), and why it must not be
        sent, if so.
        """
        q = self._filter.step(qdd)
        after = Setpoint(q, self._filter.qd, qdd)
        refusal = self.envelope.refusal(self.sent, after)
        if refusal:
            self._filter.q = self.sent.q
            self._filter.qd = self.sent.qd
        return after, refusal

    def send(self, setpoint: Setpoint) -> None:
        """Send it; raises ArmError."""
        self.driver.send(setpoint.q, setpoint.qd)
        self.sent = setpoint
        self._sent_at = self.clock.now()

    def bring_to_rest(self, by_arm: bool, alive: Callable[[], None]) -> None:
        """Bring the arm to rest by setpoints, ``alive`` being called in each period, or ``by_arm``
        itself; see stop.
        """
        trouble = ""
        tries = 0
        self.safe = False
        try:
            if not by_arm:
                self.stop = (self._stream_stop(alive), True)
                self.safe = True
        # whatever a driver raises, SystemExit too, the arm must stop
        except BaseException as error:
            trouble = f"while braking, {_why(error)}; "
        while not self.safe and tries < HALTS:
            tries += 1
            try:
                self.driver.halt(float(self.envelope.acceleration.min()))
                self.stop = (f"{trouble}told to stop by its own means", False)
                self.safe = True
            except BaseException as error:  # as above: then it is reported
                failed = f"{trouble}IT COULD NOT BE TOLD TO STOP ({_why(error)})"
                self.stop = f"{failed}: its own watchdog, or the emergency stop, must do so", False

    def _stream_stop(self, alive: Callable[[], None]) -> str:
        """Send setpoints until the arm is seen to be at rest; how that went. Raises ArmError."""
        before = len(self.periods)
        begun = max(self.clock.now(), self.begun + before * self.Ts + self.shift)
        brake = self._brake()
        from_q = self.sent.q
        rested = 0
        silences = 0
        while True:
            k = len(self.periods) - before
            self.clock.wait(begun + k * self.Ts)
            late = self.clock.now() - begun - k * self.Ts
            # as in :meth:`wait`: setpoints that were missed are not made up for
            begun += late if late >= self.Ts else 0.0
            alive()
            if self._silent():
                brake = self._brake()
                rested = 0
                silences = silences + 1
                if silences > MAX_SILENCES:
                    raise ArmError(f"setpoints came too late {silences} times")
            due = self.now()
            state = self.read()
            if brake.at_rest(self._filter.qd):
                if (np.abs(state.qd) <= STILL).all():
                    break
                rested += 1
                if rested * self.Ts > SETTLING:
                    j = int(np.argmax(np.abs(state.qd)))
                    moves = f"joint {j + 1} still moves at {state.qd[j]:.3g} rad/s"
                    raise ArmError(f"{moves}, {SETTLING:g} s after it was sent to rest")
            if k * self.Ts > MAX_STOP:
                raise ArmError(f"the stop has taken {MAX_STOP:g} s")
            qdd = (
                brake.step(self._filter.q, self._filter.qd)
                if not rested
                else np.zeros_like(state.q)
            )
            q = self._filter.step(qdd)
            if (np.abs(self._filter.qd) <= 1e-12).all():
                self._filter.qd = np.zeros_like(q)
            self.send(Setpoint(q, self._filter.qd, qdd))
            self.log((due, 0.0, 0.0, 0.0, 0.0), state, braking=True)
        taken = (len(self.periods) - before) * self.Ts
        moved = np.abs(self.sent.q - from_q).max()
        line = (
            ""
            if brake.straight in (None, True)
            else ", each joint for itself, to stay within its range"
        )
        return f"braked to rest in {taken:.3g} s over at most {moved:.3g} rad{line}"

    def _silent(self) -> bool:
        """Whether the arm was sent nothing for so long that it may be elsewhere than it was
        sent.
        """
        return self.clock.now() - self._sent_at > self.Ts + SILENT

    def _brake(self) -> Brake:
        """From what was sent last or, after silence, from where the arm is measured; raises
        ArmError.
        """
        if self._silent():
            here = self.read()
            if not (np.isfinite(here.q).all() and np.isfinite(here.qd).all()):
                raise ArmError("the arm's state is not finite")
            self.sent = Setpoint(here.q, here.qd, np.zeros_like(here.q))
        self._filter.q = self.sent.q
        self._filter.qd = self.sent.qd
        return Brake(self.sent.qdd, self.envelope)

    def log(
        self,
        times: tuple[float, float, float, float, float],
        state: Joints,
        image: tuple[Array | None, float, Array] = (None, np.nan, NO_INNOVATION),
        guarded: bool = False,
        braking: bool = False,
    ) -> None:
        """Keep a period, whose setpoint is :attr:`sent`: see :class:`Period`."""
        sent = self.sent
        pixels = self._no_image if image[0] is None else image[0]
        moved = state.q, state.qd, sent.qdd, sent.q, sent.qd
        self.periods.append(Period(*times, *moved, pixels, *image[1:], guarded, braking))


def _why(error: BaseException) -> str:
    return str(error) if isinstance(error, ArmError) else described(error)
