"""Linear robot model q̈ = C q̈_c + d_c (eq. 6), solved exactly for a zero-order hold."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.linalg import expm

from ..compiled.samples import PlantArrays, hold
from ..controllers.delay import split_delay
from ..errors import InvalidInput
from ..formulas.limits import JointLimits
from ..rows import Array, Command, IntArray
from .disturbances import Disturbances

#: Input of the robot's low-level controller: q̈_c, or q_c, which integrates q̈_c (section 5.1).
Actuation = Literal["acceleration", "position"]
POSITION_LOOP = 6  #: System size of an arm that follows q_c.


class Plant:
    """Robot of n joints, each of which is a linear system with the same parameters.

    The state of a joint holds q, q̇, the memory of the low-level loop, q̈_c and d_c. With
    acceleration control q̈ = a + d_c, where a follows q̈_c with the time constant τ, or at once if
    τ is zero. With position control q̈ = (q_c − q)/τ² + 2 (q̇_c − q̇)/τ + d_c, or q = q_c if τ is
    zero, where q_c is the output of an :class:`vsconstraints.robots.order_filter.OrderFilter`. The
    loop saturates commands at ``limits`` (:func:`vsconstraints.compiled.samples.saturate`). A
    command begins to act with the delay δ after the beginning of its period: the last ⌈δ/T_s⌉
    commands, which are pending, are part of the state and zero at the start.
    """

    #: (s, n) state at the beginning of the period: q and q̇ first, q̈_c and d_c last, the pending
    #: commands before q̈_c, with the latest next to it.
    x: Array
    transition: Array  #: (s, s) map from the beginning to the end of the period.
    #: True if the transition does not yet yield the end of the period, and :meth:`follow` or the
    #: mover completes it.
    follows = False
    #: Share of a period after which another command begins to act; 0 if none does.
    switch = 0.0
    #: Addresses of the compiled function that completes a period and of its workspace; 0 if there
    #: is none.
    mover: tuple[int, int] = (0, 0)

    def __init__(
        self,
        q0: Array,
        qd0: Array,
        Ts: float,
        actuation: Actuation,
        disturbances: Disturbances,
        limits: JointLimits | None = None,
    ) -> None:
        tau = disturbances.time_constant
        self._offset = disturbances.per_joint("acceleration", len(q0))
        self._noise = disturbances.acceleration_noise
        self._seed = (*disturbances.seed, 2)
        self._random = np.random.default_rng(self._seed)
        if actuation == "position" and tau == 0.0 and (self._offset.any() or self._noise):
            raise InvalidInput(
                "accelerations disturb a position-controlled arm only through its position loop: "
                "give time_constant too"
            )
        self.Ts = float(Ts)
        self._limits = without_limits(Ts) if limits is None else limits
        self._system = _system(actuation, tau)
        self._delay = split_delay("disturbance command_delay", disturbances.command_delay, self.Ts)
        self.switch = self._delay[1] / self.Ts
        self.transition = np.array(_transition(self._system, self._delay, self.Ts))
        # pending commands grow older by one period: each takes the place of the one before
        s = len(self.transition)
        newest = s - 2
        oldest = newest - pending_commands(self._delay)
        self.transition[oldest:newest] = np.eye(s)[oldest + 1 : newest + 1]
        self.x = np.zeros((s, len(q0)))
        self.x[-1] = self._offset
        self.x[1] = qd0
        self.x[0] = q0
        if len(self._system) == POSITION_LOOP:
            self.x[2] = q0
            self.x[3] = qd0

    @property
    def q(self) -> Array:
        """(n,) joint coordinates [rad or m]."""
        q: Array = self.x[0].copy()
        return q

    @property
    def qd(self) -> Array:
        """(n,) joint speeds [rad/s or m/s]."""
        qd: Array = self.x[1].copy()
        return qd

    def arrays(self, periods: int, last: Array) -> PlantArrays:
        """Return the arrays with which the loop moves the robot.

        The loop writes its commands to ``last`` (n,). d_c is drawn beforehand for all periods.
        """
        speed_weights, of_speeds = self.speed_rows()
        return PlantArrays(
            transition=self.transition,
            x=self.x,
            after=np.empty_like(self.x),
            push=self._pushes(np.random.default_rng(self._seed), periods),
            limits=self._limits,
            last=last,
            speed_weights=speed_weights,
            of_speeds=of_speeds,
        )

    def _pushes(self, random: np.random.Generator, periods: int) -> Array:
        """Return d_c (N, n) of the coming periods; (1, n) if it is constant."""
        n = len(self._offset)
        if not self._noise:
            return self._offset[None].copy()
        return self._offset + self._noise * random.standard_normal((periods, n))

    def begin(self, qdd: Array) -> None:
        """Begin a period with the command ``qdd`` (n,)."""
        self.x[-2] = qdd
        self.x[-1] = self._pushes(self._random, 1)[0]

    def step(self) -> None:
        """Advance to the end of the period."""
        hold(self.transition, self.x, np.empty_like(self.x))

    def follow(self) -> None:
        """Advance to the end of the current period, if the transition does not."""

    def take_speeds(self) -> None:
        """Prepare for a law that commands speeds."""

    def speed_rows(self) -> tuple[Array, Array]:
        """Return weights (r,) and rows of a state (r, n), whose sum are the ``speeds``."""
        rest = self._delay[1]
        weights = np.zeros(len(self.x))
        weights[1] = 1.0
        waiting = pending_commands(self._delay)
        if waiting:
            first = len(self.x) - 2 - waiting
            weights[first : first + waiting] = self.Ts
            weights[first] = rest or self.Ts
        return weights, self.x

    @property
    def speeds(self) -> Array:
        """(n,) speeds from which the arm goes to commanded ones within a period.

        They are q̇ when the command begins to act, by the commands before it; for a loop that takes
        velocities or positions, the last commanded q̇_c.
        """
        weights, state = self.speed_rows()
        speeds: Array = weights @ state
        return speeds

    @property
    def reversals(self) -> tuple[float, ...]:
        """Shares of a period at which speeds, beside those at its ends, tell of a reversal."""
        return (self.switch,) if self.switch else ()

    def acceleration_of(self, command: Command) -> Array:
        """Return the q̈_c (n,) by which the arm carries out a command.

        Commanded speeds are reached within a period: (q̇_c − ``speeds``) / T_s.
        """
        if not len(command.qd):
            return command.qdd
        qdd: Array = (command.qd - self.speeds) / self.Ts
        return qdd

    def check(self) -> None:
        """Raise SceneError if the motion cannot go on."""

    def remarks(self) -> list[str]:
        """Return remarks on the robot for a reader of the results."""
        return []

    def within(self, states: Array, periods: IntArray, share: float) -> tuple[Array, Array]:
        """Return q and q̇ (P, n) at a share of some periods, given the states (N, s, n) of all."""
        return self.inside(states[periods].transpose(0, 2, 1), share * self.Ts)

    def inside(self, states: Array, after: float) -> tuple[Array, Array]:
        """Return q and q̇ (N, n) at ``after`` [s] in periods that begin with states (N, n, s)."""
        moved = states @ _transition(self._system, self._delay, after)[:2].T
        return moved[..., 0], moved[..., 1]


def without_limits(Ts: float) -> JointLimits:
    """Return the limits of actuators that have none."""
    none = np.empty(0)
    return JointLimits(none, none, none, none, none, ranges=0, period=float(Ts))


def _system(actuation: Actuation, tau: float) -> tuple[tuple[float, ...], ...]:
    """Return A (s, s) of ẋ = A x for one joint, with x = (q, q̇, …, q̈_c, d_c)."""
    if tau == 0.0:
        return (
            (0, 1, 0, 0),
            (0, 0, 1, 1),
            (0, 0, 0, 0),
            (0, 0, 0, 0),
        )
    if actuation == "acceleration":
        # x = (q, q̇, a, q̈_c, d_c)
        return (
            (0, 1, 0, 0, 0),
            (0, 0, 1, 0, 1),
            (0, 0, -1 / tau, 1 / tau, 0),
            (0, 0, 0, 0, 0),
            (0, 0, 0, 0, 0),
        )
    # x = (q, q̇, q_c, q̇_c, q̈_c, d_c)
    k = 1 / tau**2
    d = 2 / tau
    return (
        (0, 1, 0, 0, 0, 0),
        (-k, -d, k, d, 0, 1),
        (0, 0, 0, 1, 0, 0),
        (0, 0, 0, 0, 1, 0),
        (0, 0, 0, 0, 0, 0),
        (0, 0, 0, 0, 0, 0),
    )


def pending_commands(delay: tuple[int, float]) -> int:
    """Count the commands before the newest that are yet to act, or act.

    The count is the delay in periods, rounded up.
    """
    return delay[0] + (delay[1] > 0.0)


@lru_cache(maxsize=64)
def _transition(
    system: tuple[tuple[float, ...], ...], delay: tuple[int, float], after: float
) -> Array:
    """Return the map (s, s) from the beginning of a period to ``after`` [s] in it.

    It is exp(A t), with one command and then another if the delay is not a multiple of the period.
    """
    whole, rest = delay
    s = len(system) + pending_commands(delay)

    def held(periods: int, t: float) -> Array:
        """Return the map over ``t`` [s], with the command that is ``periods`` periods old."""
        A = np.zeros((s, s))
        states = [*range(len(system) - 2), s - 2 - periods, s - 1]
        A[np.ix_(states, states)] = system
        moved: Array = expm(A * t)
        return moved

    if rest == 0.0:
        return held(whole, after)
    first = min(after, rest)
    older = held(whole + 1, first)
    newer = held(whole, after - first)
    return newer @ older


def cubic(
    begin: tuple[Array, Array], end: tuple[Array, Array], T: float, share: float
) -> tuple[Array, Array]:
    """Return q and q̇ at a share of a period of T [s].

    They lie on the cubic with the given q and q̇ at both ends.
    """
    s = share
    q0, v0 = begin
    q1, v1 = end
    way = q1 - q0
    by_way = s * s * (3.0 - 2.0 * s) * way
    by_speeds = T * s * (1.0 - s) * ((1.0 - s) * v0 - s * v1)
    q = q0 + by_way + by_speeds
    of_way = 6.0 * s * (1.0 - s) * way / T
    of_begin = (1.0 - s) * (1.0 - 3.0 * s) * v0
    of_end = s * (3.0 * s - 2.0) * v1
    return q, of_way + of_begin + of_end
