"""The robot as the control sees it: a double integrator (eq. 16)."""

from __future__ import annotations

from ..rows import Array


def step(q: Array, qd: Array, qdd: Array, Ts: float) -> tuple[Array, Array]:
    """Q and q̇ after Ts [s] of constant acceleration: exact for a zero-order hold, whatever Ts."""
    return q + Ts * qd + (0.5 * Ts * Ts) * qdd, qd + Ts * qdd
