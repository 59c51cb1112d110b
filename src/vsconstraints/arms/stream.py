"""Stream of setpoints to an arm: one per period within the limits, and the stop at the end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..errors import InvalidInput, described, format_value
from ..robots.order_filter import OrderFilter
from ..rows import Array, Command
from ..vision.measurement import INNOVATIONS
from .driver import ArmError, Driver, Joints
from .envelope import Brake, Envelope, Setpoint
from .realtime import Clock, RealClock, SimulatedClock
from .record import Period
from .supervision import Supervision

MAX_STOP = 30.0  #: Greatest duration of a streamed stop [s].
#: After such a gap between setpoints [s], an arm may have coasted, held or braked, and a stop
#: begins at the measured state.
LONG_GAP = 0.01
#: Greatest number of such gaps in a stop: each restarts it, so that it might never end.
MAX_GAPS = 3
SETTLING = 0.5  #: Time for which an arm may still move after the last setpoint of a stop [s].
HALTS = 3  #: Number of attempts to halt the arm, if the command fails.
#: Innovation of periods without a comparison with the model.
NO_INNOVATION = np.full(len(INNOVATIONS), np.nan)
STILL = 0.01  #: Measured speed that counts as rest [rad/s or m/s].
#: Number of periods in which the same state may be read again, however long a period is.
FEWEST_REPEATED = 5


class Stop(NamedTuple):
    """End of the motion of an arm."""

    description: str
    #: True if setpoints braked the arm and it was measured at rest; false if it was halted, or
    #: could not be, without observation.
    at_rest: bool


class Times(NamedTuple):
    """Times of a period [s], see :class:`Period`."""

    scheduled: float
    late: float = 0.0
    rows_time: float = 0.0
    step_time: float = 0.0
    busy: float = 0.0


class Image(NamedTuple):
    """Image of a period: pixels (M, 2), its time [s] and innovation, see :class:`Period`."""

    pixels: Array | None = None
    taken: float = np.nan
    innovation: Array = NO_INNOVATION


NO_IMAGE = Image()


class Stream:
    """Integrates accelerations to setpoints, checks them against the limits, and sends them.

    The setpoints start from ``q`` (n,); one is sent in each period.
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
        #: Number of periods that began late by a period or more, and total shift of the schedule
        #: for them [s].
        self.missed = 0
        self.shift = 0.0
        self.begun = 0.0  #: Start of the first period, by the clock.
        self.turn = threading.Lock()  #: Lock held by the thread that communicates with the arm.
        self.stop = Stop("", at_rest=False)
        self.safe = False  #: True if the arm is at rest, or has accepted a stop command.
        stalled_s = (bounds or Supervision()).stalled_s
        self._most_repeated = max(round(stalled_s / self.Ts), FEWEST_REPEATED)
        self._state_at = -np.inf  #: Arm time of the last state that was read [s].
        self._repeated = 0  #: Number of times that this state was read again.

    def begin(self) -> None:
        """Start the first period now."""
        self.begun = self._sent_at = self.clock.now()

    def now(self) -> float:
        """Return the time since the first period began [s]."""
        return self.clock.now() - self.begun

    def read(self) -> Joints:
        """Read the joint state, with endless joints in the turn nearest to the setpoint.

        Raises ArmError, also if the arm's clock has stood still for too many periods, and
        InvalidInput if the state does not have the arm's number of joints.
        """
        state = self.driver.read()
        n = len(self.sent.q)
        if np.shape(state.q) != (n,) or np.shape(state.qd) != (n,):
            raise InvalidInput(f"the arm's state must be of {n} joints, not {format_value(state)}")
        # NaN does not count as an advance either
        self._repeated = 0 if state.t > self._state_at else self._repeated + 1
        self._state_at = state.t
        if self._repeated >= self._most_repeated:
            raise ArmError(
                f"the arm's clock has stopped at {state.t:.6g} s: the same state was read for "
                f"{self._repeated} periods"
            )
        return state._replace(q=self.driver.robot.nearest_turn(state.q, self._filter.q))

    def wait(self, k: int) -> tuple[float, float]:
        """Wait for a period to begin; return its scheduled time and its delay [s].

        The scheduled time is relative to the first period.
        """
        due = self.begun + k * self.Ts + self.shift
        self.clock.wait(due)
        late = self.clock.now() - due
        if late >= self.Ts:
            # the arm has received nothing meanwhile: two setpoints at once would make it hurry
            self.missed += 1
            self.shift += late
        return due - self.begun, late

    def strayed(self, state: Joints) -> Array:
        """Distance of each joint from its setpoint (n,)."""
        off: Array = np.abs(state.q - self._filter.q)
        if self.driver.takes == "speed":
            # speeds do not define positions: the measured positions are used
            self._filter.q = state.q
            self.sent = self.sent._replace(q=state.q)
        return off

    def acceleration_of(self, command: Command) -> Array:
        """Return the acceleration (n,) that leads from the last setpoint to a command.

        Commanded accelerations are integrated as they are. For commanded speeds it is the change
        from those of the last setpoint, per period.
        """
        if not len(command.qd):
            return command.qdd
        qdd: Array = (command.qd - self.sent.qd) / self.Ts
        return qdd

    def within_limits(self, qdd: Array) -> tuple[Array, bool]:
        """Clip a command (n,) to the limits; return it, and True if that changed it."""
        least, greatest = self.envelope.box(self.sent.q, self.sent.qd, self.sent.qdd)
        kept: Array = np.clip(qdd, least, greatest)
        return kept, bool((np.abs(kept - qdd) > 1e-9 * (1.0 + np.abs(kept))).any())

    def prepare(self, qdd: Array) -> tuple[Setpoint, str]:
        """Return the setpoint after a period with acceleration ``qdd`` (n,), or why to refuse it.

        Returns the setpoint and the reason to refuse it, empty if it may be sent.
        """
        q = self._filter.step(qdd)
        after = Setpoint(q, self._filter.qd, qdd)
        refusal = self.envelope.refusal(self.sent, after)
        if refusal:
            self._filter.q = self.sent.q
            self._filter.qd = self.sent.qd
        return after, refusal

    def send(self, setpoint: Setpoint) -> None:
        """Send the setpoint; raises ArmError."""
        self.driver.send(setpoint.q, setpoint.qd)
        self.sent = setpoint
        self._sent_at = self.clock.now()

    def bring_to_rest(self, needs_halt: bool, alive: Callable[[], None]) -> None:
        """Brake the arm by setpoints, or halt it if it ``needs_halt`` or braking fails.

        :attr:`stop` and :attr:`safe` tell the result. ``alive`` is called in each period. The run
        is over after this: nothing is sent any more and nothing resumes it. A person starts a new
        run, which checks again that the arm is at rest and at the start.
        """
        self.safe = False
        trouble = ""
        if not needs_halt:
            try:
                self.stop = Stop(self._brake_to_rest(alive), at_rest=True)
                self.safe = True
            # the arm must stop after any error of a driver, including SystemExit
            except BaseException as error:
                trouble = f"while braking, {_why(error)}; "
        for _ in range(HALTS):
            if not self.safe:
                self._halt(trouble)

    def _halt(self, trouble: str) -> None:
        """Let the arm stop by its own means; ``trouble`` begins the description of the stop."""
        try:
            self.driver.halt(float(self.envelope.acceleration.min()))
            description = f"{trouble}stop command sent"
            self.safe = True
        except BaseException as error:  # any error of a driver, which is reported
            description = (
                f"{trouble}THE STOP COMMAND COULD NOT BE SENT ({_why(error)}): its watchdog, or "
                "the emergency stop, must stop the arm"
            )
        self.stop = Stop(description, at_rest=False)

    def _brake_to_rest(self, alive: Callable[[], None]) -> str:
        """Send setpoints until the arm is at rest; return a description. Raises ArmError."""
        before = len(self.periods)
        begun = max(self.clock.now(), self.begun + before * self.Ts + self.shift)
        brake = self._brake()
        from_q = self.sent.q
        rested = 0
        gaps = 0
        while True:
            k = len(self.periods) - before
            self.clock.wait(begun + k * self.Ts)
            late = self.clock.now() - begun - k * self.Ts
            # as in :meth:`wait`: missed setpoints are not sent later
            if late >= self.Ts:
                begun += late
            alive()
            if self._has_long_gap():
                brake = self._brake()
                rested = 0
                gaps += 1
                if gaps > MAX_GAPS:
                    raise ArmError(f"setpoints came too late {gaps} times")
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
            qdd = np.zeros_like(state.q)
            if not rested:
                qdd = brake.step(self._filter.q, self._filter.qd)
            q = self._filter.step(qdd)
            if (np.abs(self._filter.qd) <= 1e-12).all():
                self._filter.qd = np.zeros_like(q)
            self.send(Setpoint(q, self._filter.qd, qdd))
            self.log(Times(due), state, braking=True)
        duration = (len(self.periods) - before) * self.Ts
        moved = np.abs(self.sent.q - from_q).max()
        description = f"braked to rest in {duration:.3g} s over at most {moved:.3g} rad"
        if brake.straight is False:
            description += ", each joint separately, to stay within its range"
        return description

    def _has_long_gap(self) -> bool:
        """True if the last setpoint was sent so long ago that the arm may be elsewhere."""
        return self.clock.now() - self._sent_at > self.Ts + LONG_GAP

    def _brake(self) -> Brake:
        """Return a brake from the last setpoint or, after a gap, from the measured state.

        Raises ArmError.
        """
        if self._has_long_gap():
            here = self.read()
            if not (np.isfinite(here.q).all() and np.isfinite(here.qd).all()):
                raise ArmError("the arm's state is not finite")
            self.sent = Setpoint(here.q, here.qd, np.zeros_like(here.q))
        self._filter.q = self.sent.q
        self._filter.qd = self.sent.qd
        return Brake(self.sent.qdd, self.envelope)

    def log(
        self,
        times: Times,
        state: Joints,
        image: Image = NO_IMAGE,
        guarded: bool = False,
        braking: bool = False,
    ) -> None:
        """Append a period, whose setpoint is :attr:`sent`; see :class:`Period`."""
        period = Period(
            *times,
            q=state.q,
            qd=state.qd,
            qdd=self.sent.qdd,
            sent_q=self.sent.q,
            sent_qd=self.sent.qd,
            pixels=self._no_image if image.pixels is None else image.pixels,
            taken=image.taken,
            innovation=image.innovation,
            guarded=guarded,
            braking=braking,
        )
        self.periods.append(period)


def _why(error: BaseException) -> str:
    return str(error) if isinstance(error, ArmError) else described(error)
