"""``loopback://``: a fake arm in this process, to test streaming, stopping and timeouts."""

from __future__ import annotations

import threading
import time
from typing import Literal, cast, get_args

import numpy as np

from ...errors import ConfigurationError
from ...rows import Array
from ...simulation import Setup
from ...simulation.plant import cubic
from ..driver import Address, ArmError, Driver, Joints
from ..envelope import Envelope

#: Faults: stop answering, close the connection, report a wrong position, stop, or keep moving while
#: the reported state stays the same.
Fault = Literal["none", "stall", "drop", "jump", "refuse", "freeze"]

JUMP = 0.5  #: Position error that the fault ``jump`` reports [rad or m].
#: Time for which the arm coasts after a period before its watchdog brakes it [s]; ten periods if
#: that is longer.
WATCHDOG_S = 0.1
#: Delay of a setpoint up to which it is compared with the previous setpoint, not with the arm's
#: position [s].
LATE = 0.01
SLACK = 1.05  #: Factor on limits beyond which a setpoint is refused.


class FakeArm:
    """Arm that follows a cubic between setpoints, then coasts, then brakes.

    Braking is the action of its watchdog: afterwards the arm accepts no more setpoints. It stands
    at ``q`` (n,). The envelope holds the limits of accepted setpoints, the arm's own deceleration,
    and the period in which a setpoint is reached.
    """

    def __init__(self, q: Array, envelope: Envelope, watchdog_s: float = WATCHDOG_S) -> None:
        self.limits = envelope
        self.period = envelope.period
        self.t = 0.0  #: Clock of the arm [s]; :meth:`advance` moves it.
        self.stopped = ""  #: Reason why it stopped; empty if it has not.
        self._begun = -np.inf
        self._watchdog_s = max(watchdog_s, 10.0 * envelope.period)
        self._coasting = self._watchdog_s
        here: tuple[Array, Array] = np.array(q), np.zeros(len(q))
        self._from = self._to = here

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        self.t += max(seconds, 0.0)
        gap = self.t - self._begun - self.period
        if np.isfinite(self._begun) and gap > self._watchdog_s and not self.stopped:
            self.stopped = f"its watchdog received nothing for {1e3 * self._watchdog_s:g} ms"

    def state(self) -> tuple[Array, Array]:
        """Return q and q̇ (n,) now."""
        T = self.period
        q, qd = self._to
        after = self.t - self._begun
        if after < T:
            return cubic(self._from, self._to, T, after / T)
        coasting = min(after - T, self._coasting)
        # duration of braking of each joint (n,)
        braking = np.minimum(after - T - coasting, np.abs(qd) / self.limits.acceleration)
        slower = np.sign(qd) * self.limits.acceleration * braking
        return q + coasting * qd + braking * (qd - 0.5 * slower), qd - slower

    def take(self, q: Array, qd: Array) -> None:
        """Accept a setpoint for the end of the period that begins.

        A setpoint beyond the limits stops the arm.
        """
        if self.stopped:
            return
        before = self._to if self.t - self._begun < self.period + LATE else self.state()
        limits = self.limits
        T = self.period
        violations = (
            ("is not finite", ~(np.isfinite(q) & np.isfinite(qd))),
            ("leaves its range", (q < limits.q_min - 1e-6) | (q > limits.q_max + 1e-6)),
            (
                "is too fast",
                np.maximum(np.abs(qd), np.abs(q - before[0]) / T) > SLACK * limits.qd_max + 1e-3,
            ),
            (
                "accelerates too much",
                np.abs(qd - before[1]) / T > SLACK * limits.acceleration + 1e-3,
            ),
        )
        for what, joints in violations:
            if joints.any():
                self.stop(f"protective stop: joint {int(np.argmax(joints)) + 1} {what}")
                return
        self._from = self.state()
        self._to = (np.array(q), np.array(qd))
        self._begun = self.t
        self._coasting = self._watchdog_s

    def stop(self, why: str) -> None:
        """Brake now, and accept no more setpoints."""
        self._from = self._to = self.state()
        self._begun = self.t - self.period
        self._coasting = 0.0
        self.stopped = why


class LoopbackArm(Driver):
    """Fake arm in this process; options: time, fault, at, patience, off.

    With ``time=real`` time is that of the system. With ``simulated``, each setpoint advances time
    by a period, so that results do not depend on the speed of the machine. ``fault``
    (:data:`Fault`) occurs ``at`` seconds after the first setpoint, an answer may take ``patience``
    [s], and the arm stands ``off`` [rad or m] from the scenario's start.
    """

    real = False
    known = ("time", "fault", "at", "patience", "off")
    watchdog = f"the arm's watchdog brakes after {1e3 * WATCHDOG_S:g} ms without a setpoint"

    def __init__(self, address: Address, setup: Setup) -> None:
        super().__init__(address, setup)
        address.require_none()
        self.simulated_time = address.choice("time", ("real", "simulated")) == "simulated"
        self._answer_s = address.number("patience", 0.1)
        self._at = address.number("at", 0.5)
        if self._answer_s == 0.0:
            raise ConfigurationError(
                "option patience of loopback must be positive: an answer takes some time"
            )
        self._fault = cast(Fault, address.choice("fault", get_args(Fault)))
        envelope = Envelope.of(setup.scene.robot, setup.limits, setup.Ts)
        self.arm = FakeArm(setup.q0 + address.number("off", 0.0), envelope)
        #: Time of the last call, by the system's clock; None until the arm moves.
        self._asked: float | None = None
        self._reported: Joints | None = None  #: Last answer.
        self._lock = threading.Lock()  #: Lets a stop pass while another call waits for an answer.

    def _advance(self) -> None:
        now = time.perf_counter()
        if self._asked is not None:
            self.arm.advance(0.0 if self.simulated_time else now - self._asked)
            self._asked = now

    def _answer(self, *setpoint: Array) -> Joints:
        """Return the joint state, after taking the setpoint if there is one; raises ArmError."""
        with self._lock:
            self._advance()
            fault = self._fault if self._asked is not None and self.arm.t >= self._at else "none"
        if fault == "stall":
            time.sleep(self._answer_s)
            raise ArmError(f"the arm has not answered within {1e3 * self._answer_s:g} ms")
        if fault == "drop":
            raise ArmError("the arm closed the connection")
        with self._lock:
            if setpoint:
                self._asked = self._asked or time.perf_counter()
                self.arm.take(*setpoint)
                self.arm.advance(self.period if self.simulated_time else 0.0)
            if fault == "refuse":
                self.arm.stop("protective stop: simulated")
            if self.arm.stopped:
                raise ArmError(f"the arm stopped by itself: {self.arm.stopped}")
            q, qd = self.arm.state()
            if fault != "freeze" or self._reported is None:
                self._reported = Joints(self.arm.t, q + JUMP if fault == "jump" else q, qd)
            return self._reported

    def read(self) -> Joints:
        """Read the current joint state."""
        return self._answer()

    def send(self, q: Array, qd: Array) -> None:
        """Take a setpoint."""
        self._answer(q, qd)

    def halt(self, deceleration: float) -> None:
        """Brake now, with the arm's own limit."""
        with self._lock:
            self._advance()
            self.arm.stop("halted")
