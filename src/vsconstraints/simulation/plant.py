"""The robot as the control sees it: q̈ = C q̈_c + d_c (eq. 6), solved exactly for a zero-order hold."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.linalg import expm

from ..errors import InvalidInput
from ..kernels import load
from ..kernels.entry import entry
from ..order_filter import OrderFilter
from ..rows import Array
from .disturbances import Disturbances

Actuation = Literal["acceleration", "position"]
"""What the robot's own controller takes: q̈_c, or q_c of an :class:`OrderFilter` (section 5.1)."""


class Plant:
    """n joints alike: each a linear system whose state holds q, q̇, what the low-level loop remembers, q̈_c and d_c.

    With acceleration control q̈ = a + d_c, where a follows q̈_c with the time constant τ, or at once if τ is zero. With
    position control q̈ = (q_c − q)/τ² + 2 (q̇_c − q̇)/τ + d_c, or q = q_c.

    Attributes
    ----------
    x
        (s, n) the state at the beginning of the period: q and q̇ first, q̈_c and d_c last.
    varies
        Whether anything but the command changes where a period begins.
    """

    def __init__(self, q0: Array, qd0: Array, Ts: float, actuation: Actuation, disturbances: Disturbances) -> None:
        n, tau = len(q0), disturbances.time_constant
        self.Ts = Ts
        self.offset, self.noise = disturbances.per_joint("acceleration", n), disturbances.acceleration_noise
        self._random = np.random.default_rng((*disturbances.seed, 2))
        self._filter = OrderFilter(q0, qd0, Ts) if actuation == "position" else None
        if self._filter is not None and tau == 0.0 and (self.offset.any() or self.noise):
            raise InvalidInput(
                "accelerations disturb a position-controlled arm only through its position loop: give time_constant too"
            )
        self._follows_filter = self._filter is not None and tau > 0.0
        self._system = _system(actuation, tau)
        self._over_period = np.ascontiguousarray(_transition(self._system, Ts))
        self.x = np.zeros((len(self._system), n))
        self.x[0], self.x[1], self.x[-1] = q0, qd0, self.offset
        self.varies = self._follows_filter or self.noise > 0.0
        kernels = load("hold")
        self._advance = None if kernels is None else entry(kernels.advance)

    @property
    def q(self) -> Array:
        """(n,) joint coordinates."""
        q: Array = self.x[0].copy()
        return q

    @property
    def qd(self) -> Array:
        """(n,) joint speeds."""
        qd: Array = self.x[1].copy()
        return qd

    def begin(self, qdd: Array) -> None:
        """Begin a period with the command ``qdd`` (n,)."""
        if self._filter is not None and self._follows_filter:
            self.x[2], self.x[3] = self._filter.q, self._filter.qd
        self.x[-2] = qdd
        if self.noise:
            self.x[-1] = self.offset + self.noise * self._random.standard_normal(len(qdd))

    def step(self) -> None:
        """Go to the end of the period."""
        if self._filter is not None:
            self._filter.step(self.x[-2])
        if self._advance is None:
            self.x[:] = self._over_period @ self.x
        else:
            self._advance(self._over_period, self.x)

    def inside(self, states: Array, after: float) -> tuple[Array, Array]:
        """Q and q̇ (N, n) ``after`` [s] the beginning of periods that began with states (N, n, s)."""
        moved = states @ _transition(self._system, after)[:2].T
        return moved[..., 0], moved[..., 1]


def _system(actuation: Actuation, tau: float) -> tuple[tuple[float, ...], ...]:
    """A (s, s) of ẋ = A x for one joint, with x = (q, q̇, …, q̈_c, d_c)."""
    if tau == 0.0:
        return ((0, 1, 0, 0), (0, 0, 1, 1), (0, 0, 0, 0), (0, 0, 0, 0))
    if actuation == "acceleration":
        # x = (q, q̇, a, q̈_c, d_c)
        return ((0, 1, 0, 0, 0), (0, 0, 1, 0, 1), (0, 0, -1 / tau, 1 / tau, 0), (0,) * 5, (0,) * 5)
    # x = (q, q̇, q_c, q̇_c, q̈_c, d_c)
    k, d = 1 / tau**2, 2 / tau
    return ((0, 1, 0, 0, 0, 0), (-k, -d, k, d, 0, 1), (0, 0, 0, 1, 0, 0), (0, 0, 0, 0, 1, 0), (0,) * 6, (0,) * 6)


@lru_cache(maxsize=64)
def _transition(system: tuple[tuple[float, ...], ...], after: float) -> Array:
    """(s, s) exp(A t)."""
    transition: Array = expm(np.array(system, dtype=np.float64) * after)
    return transition
