"""How targets and obstacles move: see :mod:`vsconstraints.motion`."""

from __future__ import annotations

import numpy as np

from ..rows import Array
from .compiler import inner
from .kinematics import rodrigues, turned


@inner
def displacement(F: Array, at: int, size: int, t: float, out: Array) -> None:
    """Write displacement, velocity and acceleration (3, size) of a motion to ``out``."""
    rate, phase = F[at + 2 * size], F[at + 2 * size + 1]
    s, c, s0 = np.sin(rate * t + phase), np.cos(rate * t + phase), np.sin(phase)
    for i in range(size):
        v, A = F[at + i], F[at + size + i]
        out[0, i] = v * t + A * (s - s0)
        out[1, i] = v + A * rate * c
        out[2, i] = -A * rate * rate * s


@inner
def target_pose(F: Array, at: int, t: float, moved: Array, R: Array, position: Array) -> None:
    """Write the target's displacement and its derivatives (3, 3), and its pose R (3, 3) and position (3,)."""
    displacement(F, at, 3, t, moved)
    omega, centre = F[at + 8 : at + 11], F[at + 11 : at + 14]
    rate = np.sqrt(omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2)
    if rate > 0.0:
        s, c = np.sin(rate * t), np.cos(rate * t)
        rodrigues(omega[0] / rate, omega[1] / rate, omega[2] / rate, s, c, R)
    turned(R, centre, position)
    for i in range(3):
        position[i] = centre[i] - position[i] + moved[0, i]
