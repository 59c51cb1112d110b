"""Integrator from accelerations to the commands of a robot's controller (section 5.1)."""

from __future__ import annotations

from ..errors import InvalidInput
from ..rows import Array
from .geometry import vector


class OrderFilter:
    """Pure integrator of commanded accelerations to joint speeds and positions.

    Its order is that of the command. The integration is exact for a zero-order hold of T_s [s]. The
    discontinuous q̈_c of a sliding mode becomes a continuous q̇_c, ``qd`` (n,), and a smooth q_c,
    ``q`` (n,), for position-controlled arms. The initial values are the position and speed of the
    robot. Raises InvalidInput if a number is not finite, sizes differ, or T_s is not positive.
    """

    def __init__(self, q: object, qd: object, Ts: float) -> None:
        if not 0.0 < Ts < float("inf"):
            raise InvalidInput(f"the sampling time must be a positive number of seconds, not {Ts}")
        n = len(q) if hasattr(q, "__len__") else 0
        self.q = vector(q, n, "q")
        self.qd = vector(qd, n, "qd")
        self.Ts = float(Ts)

    def step(self, qdd: Array) -> Array:
        """Return q_c (n,) after a sampling period with the acceleration ``qdd`` (n,)."""
        qdd = vector(qdd, len(self.q), "qdd")
        self.q = self.q + self.Ts * self.qd + (0.5 * self.Ts**2) * qdd
        self.qd = self.qd + self.Ts * qdd
        return self.q
