"""Arms that take velocities or positions: what they take, and their low-level loop as a plant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..compiled import load
from ..compiled.memory import Workspace, zeros
from ..controllers.delay import split_delay
from ..errors import ConfigurationError, SceneError, format_value
from ..robots.limits import PerJoint, per_joint
from ..rows import Array
from .disturbances import Disturbances
from .plant import Plant

Commands = Literal["acceleration", "velocity", "position"]
#: Tolerance of whole numbers: of periods, and relative of their number per command.
WHOLE = 1e-9
#: Most instants per period at which an arm takes commands.
MOST_TICKS = 1000


@dataclass(frozen=True)
class ArmInput:
    """Command that an arm takes, and the low-level loop that follows it.

    The other keys are those of a loop that follows velocities or positions. Raises
    ConfigurationError if a value is out of range, or a key has no meaning for the command.
    """

    #: What the arm takes in each period: q̈, q̇ or q.
    command: Commands = "acceleration"
    lag: float = 0.0  #: Time constant τ of the loop of speeds, a first-order lag [s].
    #: Limit of the loop's |q̈| [rad/s² or m/s²]; none: that of the actuators, ``limits``.
    acceleration: float | Sequence[float] | None = None
    #: Limit of its jerk [rad/s³ or m/s³]; needs a lag.
    jerk: float | Sequence[float] | None = None
    #: How often the arm takes a command [Hz]; none: every command at once. A multiple or a
    #: divisor of the rate of sampling.
    rate: float | None = None

    def __post_init__(self) -> None:
        if self.command not in ("acceleration", "velocity", "position"):
            raise ConfigurationError(
                f'arm.command is "acceleration", "velocity" or "position", not '
                f"{format_value(self.command)}"
            )
        lag: object = self.lag
        number = isinstance(lag, int | float) and not isinstance(lag, bool)
        if not (number and 0.0 <= self.lag < math.inf):
            raise ConfigurationError(
                f"arm.lag is a number of seconds, 0 or more, not {format_value(self.lag)}"
            )
        for name in ("acceleration", "jerk"):
            value = getattr(self, name)
            if not (value is None or _positive(value)):
                raise ConfigurationError(
                    f"arm.{name} must be positive and finite, not {format_value(value)}"
                )
        is_number = self.rate is not None and np.ndim(self.rate) == 0
        if self.rate is not None and not (is_number and _positive(self.rate)):
            raise ConfigurationError(
                f"arm.rate must be one positive and finite number, not {format_value(self.rate)}"
            )
        if self.command == "acceleration":
            self._refuse_loop()
        elif self.jerk is not None and self.lag == 0.0:
            raise ConfigurationError(
                "arm.jerk needs arm.lag: it limits how fast the acceleration of a lagging loop "
                "changes"
            )

    def _refuse_loop(self) -> None:
        instead = {
            "lag": "disturbances.time_constant",
            "acceleration": "limits.acceleration",
            "jerk": "limits.jerk",
            "rate": "sampling_time",
        }
        for name, other in instead.items():
            if getattr(self, name) not in (None, 0.0):
                raise ConfigurationError(
                    f"arm.{name} needs a loop that follows velocities or positions; for command "
                    f'= "acceleration" give {other}'
                )

    @property
    def streams(self) -> bool:
        """True if the arm takes velocities or positions."""
        return self.command != "acceleration"


def _positive(value: object) -> bool:
    """True if a value is one positive number, or a sequence of them."""
    if isinstance(value, bool | str):
        return False
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        return False
    return bool(((numbers > 0.0) & np.isfinite(numbers)).all())


ACCELERATIONS = ArmInput()  #: An arm that takes accelerations.


def periods_of(rate: float | None, Ts: float) -> tuple[int, int]:
    """Return ``ticks`` and ``periods``: an arm takes ``ticks`` commands in ``periods`` periods.

    One of the two is 1. ``rate`` is that of commands [Hz]; None stands for 1/T_s. Raises
    ConfigurationError unless it is a multiple or a divisor of 1/T_s, and at most MOST_TICKS times
    as high.
    """
    if rate is None:
        return 1, 1
    ticks = rate * Ts
    if ticks > MOST_TICKS:
        raise ConfigurationError(
            f"arm.rate must be at most {MOST_TICKS} times the sampling rate, {1.0 / Ts:g} Hz, not "
            f"{rate:g} Hz"
        )
    if _is_whole(ticks):
        return round(ticks), 1
    periods = 1.0 / ticks
    if _is_whole(periods):
        return 1, round(periods)
    raise ConfigurationError(
        f"arm.rate must be a multiple or a divisor of the sampling rate, {1.0 / Ts:g} Hz, not "
        f"{rate:g} Hz"
    )


def _is_whole(number: float) -> bool:
    """True if a number is a whole one from 1 on, within rounding."""
    return number >= 1.0 - WHOLE and abs(number - round(number)) <= WHOLE * number


class LowLevelLoop:
    """Low-level loop of an arm that takes velocities or positions, and the commands it gets.

    A commanded q̈_c is integrated, from one command to the next, to the q̇_c and q_c that the arm
    takes: q̇_c ← q̇_c + T_s q̈_c, q_c ← q_c + T_s q̇_c + ½T_s² q̈_c. A law that commands speeds
    determines q̇_c, and q_c ← q_c + T_s q̇_c. The integral is that of the commands alone: the
    measured q̇ in its place would lag behind them.

    ``x`` (s, n) is the state: it begins at ``q0`` and ``qd0``, and so do all commands. ``arrays``
    is the compiled :class:`vsconstraints.compiled.follower.Follower`. ``actuators`` limits |q̈|
    where ``arm`` states no limit, ``delay`` is how late commands arrive [s]. Raises
    ConfigurationError if a limit is not one number or one for each joint, or the rate does not fit
    T_s [s].
    """

    def __init__(
        self,
        arm: ArmInput,
        q0: Array,
        qd0: Array,
        Ts: float,
        actuators: PerJoint = None,
        delay: float = 0.0,
    ) -> None:
        self.kernels = load("follower")
        self.arm = arm
        self.Ts = Ts
        commands = self.kernels.COMMANDS
        n = len(q0)
        ticks, periods = periods_of(arm.rate, Ts)
        tick = Ts / ticks if periods == 1 else periods * Ts
        split_delay("disturbance command_delay", delay, Ts)  # raises if too many are pending
        # at each instant of a period, how long the period's command is still on its way
        instants = np.arange(ticks) * Ts / ticks
        late = np.maximum(delay - instants, 0.0)
        ages = np.ceil(late / Ts - WHOLE).astype(np.int64)
        # of the instant before; a command of the period before is a period older by now
        before = np.append(ages[-1] + 1, ages[:-1])
        limit = actuators if arm.acceleration is None else arm.acceleration
        # critically damped, unless the loop is faster than the arm takes commands
        feedback = 1.0 / tick
        if arm.lag != 0.0:
            feedback = min(feedback, 0.25 / arm.lag)
        pending = int(ages.max()) + 1
        # the rows before the commands; position and speed of each; q̈_c and d_c
        rows = commands + 2 * pending + 2
        known = {
            "Ts": Ts,
            "tick": tick,
            "ticks": ticks,
            "periods": periods,
            "ages": ages,
            "fresh": (ages != before).astype(np.int64),
            "positions": int(arm.command == "position"),
            "lag": float(arm.lag),
            "feedback": feedback,
            "acceleration": per_joint("arm.acceleration", limit, n),
            "jerk": per_joint("arm.jerk", arm.jerk, n),
            "reference": np.zeros((rows, n)),
        }
        self.arrays = zeros(self.kernels.Follower, {"n": n}, known)
        self.x: Array = self.arrays.reference
        self.x[self.kernels.Q] = q0
        self.x[self.kernels.QD] = qd0
        self.x[self.kernels.REFERENCE] = q0
        self.x[self.kernels.WANTED] = qd0
        # position and speed of each stored command
        stored = self.x[commands:-2].reshape(pending, 2, n)
        stored[:, 0] = q0
        stored[:, 1] = qd0
        self.workspace = Workspace(self.arrays)

    @property
    def limited(self) -> bool:
        """True if the acceleration of every joint is limited."""
        return bool(np.isfinite(self.arrays.acceleration).all())

    def lead(self, q_c: Array, qd_c: Array, mover: tuple[int, int]) -> None:
        """Let the motion be the reference of an arm with mass.

        ``q_c`` and ``qd_c`` (n,) are the arrays of that reference. ``mover`` are the addresses of
        the function that moves the arm, and of its workspace.
        """
        move, moved = mover
        self.arrays = self.arrays._replace(q_c=q_c, qd_c=qd_c, move=move, moved=moved)
        self.workspace = Workspace(self.arrays)

    def take_speeds(self) -> None:
        """Let q_c advance by T_s q̇_c with the new q̇_c, as for a law that commands speeds."""
        self.arrays.implicit[0] = 1

    def check(self) -> None:
        """Raise SceneError if the loop's motion has had more parts than are followed."""
        if self.arrays.unfollowed[0]:
            remedy = "give a longer lag"
            if self.arm.jerk is not None:
                remedy += ", or a greater jerk or none: arm.jerk is too small for this lag"
            raise SceneError(
                f"the arm's loop with arm.lag = {self.arm.lag:g} s changes its acceleration more "
                f"than {self.kernels.MOST_PARTS} times between two commands, since the speed "
                f"swings about the wanted one; {remedy}"
            )

    def speed_rows(self) -> tuple[Array, Array]:
        """Return the weight (1,) and the row (1, n) of the last commanded q̇_c in the state."""
        row = self.kernels.COMMANDS + 1
        return np.ones(1), self.x[row : row + 1]

    def remarks(self) -> list[str]:
        """Return a remark on the integration between law and arm, for a reader of the results."""
        if self.arrays.implicit[0]:
            return []
        takes = "velocities" if self.arm.command == "velocity" else "positions"
        return [f"the arm takes {takes}, to which the law's q̈_c was integrated"]


class FollowingPlant(Plant):
    """Arm without mass whose :class:`LowLevelLoop` follows velocities or positions."""

    follows = True

    def __init__(
        self,
        arm: ArmInput,
        q0: Array,
        qd0: Array,
        Ts: float,
        disturbances: Disturbances,
        actuators: PerJoint = None,
    ) -> None:
        if disturbances.time_constant:
            raise ConfigurationError(
                "disturbances.time_constant applies to an arm that takes accelerations; for "
                "velocities or positions give arm.lag"
            )
        delay = disturbances.command_delay
        super().__init__(q0, qd0, Ts, "acceleration", replace(disturbances, command_delay=0.0))
        self.loop = loop = LowLevelLoop(arm, q0, qd0, self.Ts, actuators, delay)
        if (self._offset.any() or self._noise) and arm.lag == 0.0 and not loop.limited:
            raise ConfigurationError(
                "disturbing accelerations need the arm's loop: give arm.lag or "
                "arm.acceleration, too"
            )
        self.x = loop.x
        self.x[-1] = self._offset
        self.transition = np.eye(len(self.x))
        self.mover = loop.kernels.MOVE, loop.workspace.address
        # a late command is taken at the first instant after its arrival
        self.switch = int(np.argmax(loop.arrays.fresh)) / loop.arrays.ticks

    def take_speeds(self) -> None:
        """See :class:`.Plant`."""
        self.loop.take_speeds()

    def speed_rows(self) -> tuple[Array, Array]:
        """See :class:`.Plant`."""
        return self.loop.speed_rows()

    @property
    def reversals(self) -> tuple[float, ...]:
        """See :class:`.Plant`: a loop of positions wants another speed at each instant."""
        if self.loop.arm.command == "position" and self.loop.arrays.ticks > 1:
            return tuple(sorted({0.25, 0.5, 0.75, *super().reversals}))
        return super().reversals

    def follow(self) -> None:
        """Advance to the end of the current period."""
        self.loop.kernels.follow_period(self.loop.workspace, self.x)

    step = follow

    def check(self) -> None:
        """See :class:`.Plant`."""
        self.loop.check()

    def inside(self, states: Array, after: float) -> tuple[Array, Array]:
        """See :class:`.Plant`."""
        moved = np.array(states.transpose(0, 2, 1), order="C")
        for x in moved:
            self.loop.kernels.follow_part(self.loop.workspace, x, after)
        return moved[:, 0], moved[:, 1]

    def remarks(self) -> list[str]:
        """See :class:`.Plant`."""
        return self.loop.remarks()
