"""``ur-rtde://HOST``: arms of Universal Robots, by the package ur-rtde.

Install it with ``pip install 'vsconstraints[ur-rtde]'``.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, cast

import numpy as np

from ...errors import ConfigurationError
from ...plugins.extras import demand
from ...rows import Array
from ...simulation import Setup
from ..driver import Address, ArmError, Driver, Joints, Takes
from ..envelope import Envelope

LEAST_PERIOD = 0.002  #: Shortest period of an e-Series arm [s]; a CB3 arm has 0.008 s.
#: Rate of setpoints [1/s] below which the arm's program ends, which stops the arm; at most one
#: setpoint in ten periods.
WATCHDOG = 10.0
MOST_ACCELERATION = 40.0  #: Greatest acceleration of speedJ [rad/s²].
FULL = 0.999  #: Speed fraction from which the arm counts as not slowed down by its slider.
#: Safety status bits of RTDE with which an arm does not follow setpoints.
STOPPED_BY = {
    2: "protective stop",
    3: "recovery mode",
    4: "safeguard stop",
    5: "emergency stop of the system",
    6: "emergency stop of the robot",
    7: "emergency stop",
    8: "violation of a safety limit",
    9: "fault",
    10: "stopped due to safety",
}


class UrRtde(Driver):
    """Arm of Universal Robots at HOST, by the package ur-rtde; options: send, lookahead, gain.

    ``send`` is ``position`` (servoJ) or ``speed`` (speedJ). servoJ has a ``lookahead`` of 0.03 to
    0.2 s (longer is smoother, with more delay) and a ``gain`` of 100 to 2000. The order of the
    joints is that of the URDF: base, shoulder, elbow, wrist 1 to 3. The safety functions of the arm
    remain in force: this driver checks if they have acted, and changes none.

    The arm's own watchdog is started before the first setpoint and reset by every setpoint. The
    package's ``kickWatchdog`` would write *no command* to the same register, over a setpoint that
    the arm has not read yet.
    """

    known = ("send", "lookahead", "gain")

    def __init__(self, address: Address, setup: Setup) -> None:
        super().__init__(address, setup)
        if not address.host:
            raise ConfigurationError(
                "ur-rtde:// needs the arm's address, as in ur-rtde://192.168.0.2"
            )
        if address.port is not None:
            raise ConfigurationError(
                f"the ports of the arm are fixed: give ur-rtde://{address.host}, without "
                f":{address.port}"
            )
        if self.n != 6:
            raise ConfigurationError(
                f"an arm of Universal Robots has 6 joints, the scenario's robot {self.n}"
            )
        if self.period < LEAST_PERIOD - 1e-9:
            raise ConfigurationError(
                f"an arm of Universal Robots accepts a setpoint every {1e3 * LEAST_PERIOD:g} ms "
                f"at most, not every {1e3 * self.period:g} ms"
            )
        self.takes = cast(Takes, address.choice("send", ("position", "speed")))
        self._lookahead = address.number("lookahead", 0.03)
        self._gain = address.number("gain", 1000.0)
        if not 0.03 <= self._lookahead <= 0.2 or not 100.0 <= self._gain <= 2000.0:
            raise ConfigurationError(
                "servoJ needs a lookahead of 0.03 to 0.2 s and a gain of 100 to 2000"
            )
        least = Envelope.of(setup.scene.robot, setup.limits, setup.Ts).acceleration.min()
        self._acceleration = min(float(least), MOST_ACCELERATION)
        # last, so that a wrong address is reported even if the package is not installed
        demand("ur-rtde")
        self._frequency = min(WATCHDOG, 0.1 / self.period)
        self.watchdog = (
            f"the arm's watchdog ends its program after {1e3 / self._frequency:g} ms without a "
            "setpoint"
        )
        self._control: Any = None
        self._receive: Any = None
        self._dashboard: Any = None

    def connect(self) -> None:
        """Connect to the arm, and start the package's program on it."""
        import dashboard_client
        import rtde_control
        import rtde_receive

        host = self.address.host
        rate = 1.0 / self.period
        connecting = f"connect to {host}"
        self._dashboard = _Interface(_tried(connecting, dashboard_client.DashboardClient, host))
        _tried(connecting, self._dashboard.wrapped.connect)
        self._receive = _Interface(
            _tried(connecting, rtde_receive.RTDEReceiveInterface, host, rate)
        )
        self._require_safe()
        slider = float(self._receive.getTargetSpeedFraction())
        if slider < FULL:
            raise ArmError(
                f"the arm's speed slider is at {100.0 * slider:.0f} %, too slow to follow the "
                "setpoints: set it to 100 %, and limit the speed by the scenario's limits"
            )
        self._control = _Interface(
            _tried(connecting, rtde_control.RTDEControlInterface, host, rate)
        )

    def begin(self) -> None:
        """Start the arm's watchdog: from now on it waits for setpoints.

        The first setpoint keeps the position; it returns once the arm is ready for others.
        """
        _require_taken("setWatchdog", self._control.setWatchdog(self._frequency))
        q = self.read().q
        self.send(q, np.zeros_like(q))

    def read(self) -> Joints:
        """Read the current joint state."""
        receive = self._receive
        if not receive.isConnected():
            raise ArmError("the connection to the arm broke")
        self._require_safe()
        t = float(receive.getTimestamp())
        return Joints(t, np.array(receive.getActualQ()), np.array(receive.getActualQd()))

    def _require_safe(self) -> None:
        """Raise ArmError if a safety function of the arm has acted."""
        bits = int(self._receive.getSafetyStatusBits())
        acted = [name for bit, name in STOPPED_BY.items() if bits >> bit & 1]
        if acted:
            raise ArmError(f"the arm stopped by itself: {', '.join(acted)}")

    def send(self, q: Array, qd: Array) -> None:
        """Send a position or a speed; return at once."""
        if self.takes == "position":
            # servoJ does not use the second and third argument
            taken = self._control.servoJ(
                q.tolist(), 0.0, 0.0, self.period, self._lookahead, self._gain
            )
            _require_taken("servoJ", taken)
        else:
            _require_taken(
                "speedJ", self._control.speedJ(qd.tolist(), self._acceleration, self.period)
            )

    def halt(self, deceleration: float) -> None:
        """Stop the arm's program by its dashboard server.

        The arm then brakes with its configured deceleration.
        """
        self._dashboard.stop()

    def stopper(self) -> Callable[[], None]:
        """Return a function that stops the program from another process, by its own connection."""
        return partial(stop_program, self.address.host)

    def close(self) -> None:
        """Leave servo or speed mode, and disconnect."""
        control = self._control
        receive = self._receive
        dashboard = self._dashboard
        self._control = self._receive = self._dashboard = None
        # after any error, the other parts are still closed
        if control is not None:
            with suppress(Exception):
                # deceleration: of the tool [m/s²] (the package's default), or of the joints
                control.servoStop() if self.takes == "position" else control.speedStop(
                    self._acceleration
                )
            with suppress(Exception):
                control.stopScript()
        for part in (control, receive, dashboard):
            if part is not None:
                with suppress(Exception):
                    part.disconnect()


class _Interface:
    """Interface of the package, whose calls raise ArmError."""

    def __init__(self, wrapped: Any) -> None:
        self.wrapped = wrapped

    def __getattr__(self, name: str) -> Any:
        return partial(_tried, name, getattr(self.wrapped, name))


def _tried(what: str, call: Callable[..., Any], *arguments: Any) -> Any:
    try:
        return call(*arguments)
    except Exception as error:  # the package raises what its C++ code throws
        raise ArmError(f"{what}: {error}") from error


def _require_taken(what: str, accepted: object) -> None:
    if accepted is False:
        raise ArmError(f"the arm rejected {what}")


def stop_program(host: str) -> None:
    """Stop the program of an arm, which then brakes; raises ArmError."""
    import dashboard_client

    def stop() -> None:
        dashboard = dashboard_client.DashboardClient(host)
        dashboard.connect()
        dashboard.stop()

    _tried("stop", stop)
