"""What a predictive law looks at: blocks of constant acceleration, and the instants at which rows must hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np

from ..rows import Array


class Instants(NamedTuple):
    """States along a plan: times (N,) from now [s], q and q̇ (N, n), and how they change with the plan, Q and V (N, H).

    The instant from ``braking`` on, if there is one, is that of rest after the brake that follows the plan.
    """

    times: Array
    q: Array
    qd: Array
    Q: Array
    V: Array
    braking: int

    def first(self, N: int) -> Self:
        """No more than the first N instants."""
        return type(self)(self.times[:N], self.q[:N], self.qd[:N], self.Q[:N], self.V[:N], min(self.braking, N))


@dataclass(frozen=True)
class Horizon:
    """H ``blocks`` of constant q̈, each ``length`` T [s] long, and N instants: now, after one period and every block.

    q and q̇ of a double integrator are linear in the plan u (H, n): q + τ q̇ + Q u and q̇ + V u, with Q and V (N, H) in
    s² and s. ``times`` (N,) are τ [s]; ``begins`` (H,) tells which of them are the beginnings of blocks. After the plan
    all joints brake together, as fast as the slowest to stop can.
    """

    blocks: int
    length: float
    period: float
    times: Array = field(init=False)
    begins: Array = field(init=False)
    Q: Array = field(init=False)
    V: Array = field(init=False)

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, blocks: int, block: int, period: float) -> Self:
        """So many blocks of so many sampling periods each."""
        return cls(blocks, block * period, period)

    def __post_init__(self) -> None:
        T = self.length
        ends = T * np.arange(self.blocks + 1)
        times = ends if np.isclose(self.period, T) else np.sort(np.append(ends, self.period))
        since = times[:, None] - ends[:-1]
        within = np.clip(since, 0.0, T)
        made = {"times": times, "begins": np.searchsorted(times, ends[:-1])}
        for name, value in {**made, "Q": within * (since - 0.5 * within), "V": within}.items():
            object.__setattr__(self, name, value)

    def instants(self, q: Array, qd: Array, plan: Array, most: Array) -> Instants:
        """States along a plan (H, n) from q and q̇ (n,) on, and at rest after it where accelerations are bounded.

        ``most`` (n,) is the greatest acceleration [rad/s²], infinite where there is no bound.
        """
        times, Q, V = self.times, self.Q, self.V
        N, stops = len(times), stopping_time(qd + V[-1] @ plan, most)
        if stops > 0.0:
            # q̇ falls linearly with time
            times = np.append(times, times[-1] + stops)
            Q, V = np.vstack((Q, Q[-1] + 0.5 * stops * V[-1])), np.vstack((V, np.zeros(self.blocks)))
        there, speed = q + times[:, None] * qd + Q @ plan, qd + V @ plan
        if stops > 0.0:
            # the speed of now is braked too
            there[N], speed[N] = there[N - 1] + 0.5 * stops * speed[N - 1], 0.0
        return Instants(times, there, speed, Q, V, N)

    def later(self, plan: Array, then: Array, after: float) -> Array:
        """The plan as it is ``after`` [s], means over the new blocks; after its last block comes ``then`` (n,)."""
        over, share = divmod(after / self.length, 1.0)
        gone = min(int(over), self.blocks)
        left = np.empty((self.blocks + 1, len(then)))
        left[: self.blocks - gone], left[self.blocks - gone :] = plan[gone:], then
        means: Array = (1.0 - share) * left[:-1] + share * left[1:]
        return means

    def brake(self, qd: Array, low: Array, high: Array) -> Array:
        """The plan that stops each joint as soon as possible within boxes (H, n)."""
        plan = np.empty((self.blocks, len(qd)))
        for k in range(self.blocks):
            plan[k] = np.clip(-qd / self.length, low[k], high[k])
            qd = qd + self.length * plan[k]
        return plan


def stopping_time(qd: Array, most: Array) -> float:
    """Time [s] in which all joints can stop together; 0 if a joint that moves has no bound."""
    unbounded = most == np.inf
    if unbounded.any() and qd[unbounded].any():
        return 0.0
    return float((np.abs(qd) / most).max())
